"""Are the gains without a certificate global minima? Proofs of order two for pairs (instant, network) that games pass.

    python benches/proved_along_games.py [--pairs 10000] [--most 8] [--seed 0]
    python benches/proved_along_games.py --hard FILE

Random games of two to four defenders, alternately I1 and I2, with random γ, drawn as in turning_gains.py and played;
every network that one meets, at one random instant of those at which it is in it, where the gains have no certificate
and at most `most` players are seen in all. For each the sum of squares is checked in whole numbers. *closed*: Θ less
the proved bound is below 1e-6 of Θ. *missed*: gains with a lower Θ were found; each is printed. *gap*: the largest of
the closed. Set OMP_NUM_THREADS=1: the matrices are small. Quoted in docs/theory/global.md.

With ``--hard`` the instants of a file like tests/reference/synthesis_hard.json, from the best of BFGS's descents.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import defaultdict
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from scipy.optimize import minimize
from turning_gains import drawn

import tadcore
from tadcore.verification.bound.bounds import ThetaBound, prove_theta
from tadcore.verification.oracle.matrices import matrices_of
from tadcore.verification.oracle.objective import FullObjective

HEAD = f"{'unknowns':>10} {'pairs':>7} {'closed':>7} {'missed':>7} {'open':>5} {'gap':>8} {'s, mean':>8} {'s, most':>8}"


def line(name: str, bounds: list[tuple[ThetaBound, float]]) -> str:
    """One line of the table."""
    closed = [b for b, _ in bounds if b.proved and b.tight]
    missed = sum(b.lower is not None for b, _ in bounds)
    gap = max((b.relative_gap for b in closed), default=0.0)
    spent = [s for _, s in bounds]
    rest = len(bounds) - len(closed) - missed
    return (
        f"{name:>10} {len(bounds):7,} {len(closed):7,} {missed:7} {rest:5} {gap:8.1e} {np.mean(spent):8.3f} "
        f"{max(spent):8.2f}"
    )


def along_games(pairs: int, most: int, seed: int) -> None:
    """Print a line for each number of unknowns."""
    found: defaultdict[int, list[tuple[ThetaBound, float]]] = defaultdict(list)
    game = count = 0
    while count < pairs:
        rng = np.random.Generator(np.random.Philox([seed, game]))
        sc = drawn(rng, ("I1", "I2")[game % 2])
        m, run = matrices_of(sc), tadcore.simulate(sc)
        values = m.values(tadcore.solve_equilibrium(sc).P)
        instants: defaultdict[bytes, list[int]] = defaultdict(list)
        for k, adjacency in enumerate(run.adjacency[:-1]):
            instants[adjacency.tobytes()].append(k)
        for which in instants.values():
            k = int(rng.choice(which))
            adjacency = run.adjacency[k]
            unknowns = int(adjacency.sum())
            if not 0 < unknowns <= most or count == pairs:
                continue
            gains = tadcore.synthesize(sc, step=k, adjacency=adjacency)
            if gains.certified:
                continue
            begun = time.perf_counter()
            bound = prove_theta(FullObjective(sc, m, values[:, k], adjacency, dim=1), gains.rows)
            found[unknowns].append((bound, time.perf_counter() - begun))
            count += 1
            if not (bound.proved and bound.tight):
                print(
                    f"game {game} k={k} {sc.interaction} gap {bound.relative_gap:.3e} missed: {bound.lower is not None}"
                )
                print(adjacency.astype(int).tolist(), sc.model_dump(mode="json"), flush=True)
            if count % 500 == 0:
                print(f"{count:,} pairs, {game + 1:,} games", flush=True)
        game += 1
    print(f"{game} games\n{HEAD}")
    for unknowns in sorted(found):
        print(line(str(unknowns), found[unknowns]))
    print(line("all", [b for bounds in found.values() for b in bounds]))


def hard(path: Path) -> None:
    """Print a line for each instant of a file."""
    print(HEAD)
    for case in json.loads(path.read_text(encoding="utf-8"))["cases"]:
        weights, P = case["control_weights"], np.array(case["P"])
        r = np.array([*weights["defenders"], weights["target"], weights["attacker"]])
        sc = SimpleNamespace(dim=1, interaction=case["interaction"], synthesis_weights=case["gamma"])
        seen = np.array(case["adjacency"], dtype=bool)
        objective = FullObjective(sc, SimpleNamespace(r=r), np.stack([-P, P]), seen, dim=1)
        rng = np.random.default_rng(0)
        best = None
        for _ in range(300):
            x = rng.normal(size=objective.unknowns)
            at = minimize(objective.theta, x, jac=objective.gradient, method="BFGS", options={"gtol": 1e-12})
            best = at if best is None or at.fun < best.fun else best
        begun = time.perf_counter()
        bound = prove_theta(objective, objective.rows(best.x))
        row = line(str(objective.unknowns), [(bound, time.perf_counter() - begun)])
        print(f"{row}  best known {case['best_theta']:.15g}, proved {bound.value:.15g}", flush=True)


def main() -> None:
    """Read the options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=10_000)
    parser.add_argument("--most", type=int, default=8, help="unknowns of a pair")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--hard", type=Path, help="a file of instants instead")
    options = parser.parse_args()
    if options.hard is not None:
        hard(options.hard)
    else:
        along_games(options.pairs, options.most, options.seed)


if __name__ == "__main__":
    main()
