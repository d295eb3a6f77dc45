"""How often is the minimum of Θ proved, by what, and what is left? Random games, instants and networks.

    python benches/global_minimum.py [--trials 1000] [--starts 1] [--seed 0]
    python benches/global_minimum.py --visited 20000 [--starts 48] [--seed 0]

For both interactions and n = 1 … 4: weights log-uniform in [0.3, 3], a horizon within the escape time, an instant
uniform on the grid, a network of uniform density. Trial i of a line depends on (seed, interaction, n, i) alone.
Needs the extra ``bounds``. The output is quoted in docs/theory/global.md.

With ``--visited``: pairs that games pass through, of n = 2 … 5 with weights and γ log-uniform in [0.1, 10] (γ divided
by its largest entry), every network of a game at one instant at which the game was in it; certified pairs too. Each is
searched by the independent descents of ``wide_search.py``, from as many starts as asked for. Needs Numba.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter

import numpy as np

import tadcore
from tadcore.verification.bound.bounds import bound_theta
from tadcore.verification.checks.gains import multistart
from tadcore.verification.oracle.matrices import matrices_of
from tadcore.verification.oracle.objective import FullObjective

INSTANTS = 20
"""Networks drawn for each game: a game costs a Riccati solution."""
LOWER = 1e-8
"""How much lower, relatively, a rival must be to count."""


def random_scenario(rng: np.random.Generator, interaction: str, n: int) -> tadcore.Scenario:
    """A game with an equilibrium on its horizon: 3, or 95 % of the way to its escape."""

    def weight() -> float:
        return float(np.exp(rng.uniform(np.log(0.3), np.log(3.0))))

    first = interaction == "I1"
    own = ("running_weight", "terminal_weight") if first else ()
    both = ("evasion_running_weight", "evasion_terminal_weight")
    data = {
        "interaction": interaction,
        "horizon": 3.0,
        "step": 0.05,
        "attacker": {
            "position": [-2.0, 2.0],
            "capture_radius": 0.1,
            **{k: weight() for k in ("control_weight", "target_running_weight", "target_terminal_weight")},
        },
        "target": {"position": [0.0, 1.0], **{k: weight() for k in ("control_weight", *own)}},
        "defenders": [
            {"position": [float(i), 0.0], "capture_radius": 0.1}
            | {k: weight() for k in ("control_weight", *own, *both)}
            for i in range(n)
        ],
    }
    sc = tadcore.Scenario.model_validate(data)
    try:
        tadcore.solve_equilibrium(sc)
    except tadcore.NoEquilibriumError as error:
        horizon = 0.95 * error.escape_time
        sc = sc.replace(horizon=horizon, step=horizon / 60)
    return sc


def line(interaction: str, n: int, trials: int, starts: int, seed: int) -> tuple[Counter[str], list[float], float]:
    """Counts over one line of the table, the relative gaps left, and milliseconds for a bound."""
    counts: Counter[str] = Counter()
    gaps: list[float] = []
    spent = 0.0
    for i in range(trials):
        key = [seed, 10_000_000 * n + 2 * i + (interaction == "I2")]
        if i % INSTANTS == 0:
            sc = random_scenario(np.random.Generator(np.random.Philox(key=key)), interaction, n)
            m = matrices_of(sc)
            values = m.values(tadcore.solve_equilibrium(sc).P)
        rng = np.random.Generator(np.random.Philox(key=key, counter=[0, 0, 0, 1]))
        k, network = int(rng.integers(sc.steps + 1)), rng.random((len(sc.constrained), n + 1)) < rng.random()
        found = tadcore.synthesize(sc, step=k, adjacency=network, method="restarts")
        reduced = FullObjective(sc, m, values[:, k], network, dim=1)
        begun = time.perf_counter()
        bound = bound_theta(reduced, found.theta)
        spent += time.perf_counter() - begun
        in_blocks = bound_theta(reduced, found.theta, blocks=True)
        counts["pairs"] += 1
        counts["not converged"] += not found.converged
        counts["certified by the first descent"] += found.certified and found.start == "canonical"
        counts["certified"] += found.certified
        counts["a further start went lower"] += found.start != "canonical"
        counts["first or complex start"] += found.start in ("canonical", "complex")
        counts["bound tight"] += bound.tight
        counts["certified, bound not tight"] += found.certified and not bound.tight
        counts["bound in blocks tight"] += in_blocks.tight
        counts["certified, bound in blocks not tight"] += found.certified and not in_blocks.tight
        rounding = 1e-10 * bound.scale
        counts["below the bound"] += bound.gap < -rounding
        if not bound.tight:
            gaps.append(bound.relative_gap)
        floor = found.theta - LOWER * max(found.theta, 1e-10 * bound.scale)
        full = FullObjective(sc, m, values[:, k], network)
        for name, objective, limit in (("scalars", reduced, bound), ("blocks", full, in_blocks)):
            best = multistart(objective, objective.blocks(found.rows), starts, rng)
            counts[f"beaten by {name}"] += best < floor
            counts[f"certified, beaten by {name}"] += found.certified and best < floor
            counts[f"bound in {name} tight, beaten"] += limit.tight and best < floor
            counts["below the bound"] += best < limit.value - rounding
    return counts, gaps, 1e3 * spent / trials


def played(rng: np.random.Generator) -> tadcore.Run | None:
    """A random game played to its end; None where it has no equilibrium even on a shorter horizon."""
    interaction, n = ("I1", "I2")[int(rng.integers(2))], int(rng.integers(2, 6))
    first = interaction == "I1"

    def weight() -> float:
        return float(10.0 ** rng.uniform(-1.0, 1.0))

    def sight() -> float:
        return float("inf") if rng.random() < 0.15 else float(rng.uniform(0.4, 5.0))

    own = ("running_weight", "terminal_weight") if first else ()
    both = ("evasion_running_weight", "evasion_terminal_weight")
    gamma = np.array([weight() for _ in range(4 if first else 3)])
    positions = rng.uniform(-3.0, 3.0, (n + 2, 3 if rng.random() < 0.15 else 2)).tolist()
    horizon, steps = float(np.exp(rng.uniform(np.log(0.5), np.log(6.0)))), int(rng.choice([40, 100]))
    data = {
        "interaction": interaction,
        "horizon": horizon,
        "step": horizon / steps,
        "synthesis_weights": (gamma / gamma.max()).tolist(),
        "attacker": {
            "position": positions[-1],
            "capture_radius": 0.1,
            **{k: weight() for k in ("control_weight", "target_running_weight", "target_terminal_weight")},
        }
        | ({"evasion": float(rng.choice([0.0, 0.5, 1.0]))} if first else {}),
        "target": {"position": positions[-2], **{k: weight() for k in ("control_weight", *own)}}
        | ({} if first else {"visibility_radius": sight()}),
        "defenders": [
            {"position": positions[i], "capture_radius": 0.05, "visibility_radius": sight()}
            | {k: weight() for k in ("control_weight", *own, *both)}
            for i in range(n)
        ],
    }
    sc = tadcore.Scenario.model_validate(data)
    try:
        return tadcore.simulate(sc)
    except tadcore.NoEquilibriumError as error:
        if not error.escape_time > 1e-3:
            return None
        horizon = 0.95 * error.escape_time
        return tadcore.simulate(sc.replace(horizon=horizon, step=horizon / steps))


def visited(pairs: int, starts: int, seed: int) -> None:
    """Print how many of the pairs that random games pass through the independent search beats."""
    from wide_search import LOWER as BEATEN, Pair

    counts: Counter[str] = Counter()
    game = 0
    while counts["pairs"] < pairs:
        rng = np.random.Generator(np.random.Philox(key=[seed, game]))
        game += 1
        run = played(rng)
        if run is None:
            continue
        sc, instants = run.scenario, {}
        for k, network in enumerate(run.adjacency):
            instants.setdefault(network.tobytes(), []).append(k)
        P = list(tadcore.solve_equilibrium(sc).P.values())
        for which in list(instants.values())[: pairs - counts["pairs"]]:
            k = int(rng.choice(which))
            network = run.adjacency[k]
            found = tadcore.synthesize(sc, step=k, adjacency=network)
            pair = Pair(sc, np.array([p[k] for p in P]), network)
            best, _ = pair.lowest(found.rows, starts, rng)
            beaten = best < found.theta * (1.0 - BEATEN) - 1e-13 * pair.scale
            counts["pairs"] += 1
            counts["certified"] += found.certified
            counts["not converged"] += not found.converged
            counts["Newton steps"] += found.iterations
            counts["beaten"] += beaten
            counts["certified, beaten"] += beaten and found.certified
            if beaten:
                gamma = ", ".join(f"{g:.3f}" for g in sc.synthesis_weights)
                by = 1.0 - best / found.theta
                print(f"game {game - 1}: {sc.interaction} n={sc.n} k={k} γ=({gamma}) lower by {by:.2e}", flush=True)
    for name, count in counts.items():
        print(f"{name:40}{count:10}")
    print(f"{'beaten, of 20,000':40}{20_000 * counts['beaten'] / counts['pairs']:10.1f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=1000, help="pairs for each interaction and n")
    parser.add_argument("--visited", type=int, help="pairs that games pass through, instead of random ones")
    parser.add_argument("--starts", type=int, help="starts of the other searches for each pair (1; visited: 48)")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    if args.visited is not None:
        visited(args.visited, args.starts or 48, args.seed)
        return
    args.starts = 1 if args.starts is None else args.starts
    columns = {
        "first": "certified by the first descent",
        "certified": "certified",
        "tight": "bound tight",
        "in blocks": "bound in blocks tight",
        "lower": "a further start went lower",
        "complex": "first or complex start",
    }
    head = ("pairs", *columns, "gap 50%", "gap max", "scalars", "blocks", "ms")
    print(" " * 6 + "".join(f"{name:>10}" for name in head))
    total: Counter[str] = Counter()
    for interaction in ("I1", "I2"):
        for n in range(1, 5):
            counts, gaps, cost = line(interaction, n, args.trials, args.starts, args.seed)
            total.update(counts)
            share = [f"{counts[name] / counts['pairs']:.1%}" for name in columns.values()]
            middle, most = (f"{np.median(gaps):.1e}", f"{max(gaps):.1e}") if gaps else ("-", "-")
            beaten = counts["beaten by scalars"], counts["beaten by blocks"]
            cells = (counts["pairs"], *share, middle, most, *beaten, f"{cost:.1f}")
            print(f"{interaction} n={n}" + "".join(f"{cell:>10}" for cell in cells), flush=True)
    for name, count in total.items():
        print(f"{name:40}{count:8}")


if __name__ == "__main__":
    main()
