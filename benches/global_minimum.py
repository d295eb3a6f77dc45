"""How often is the minimum of Θ proved, by what, and what is left? Random games, instants and networks.

    python benches/global_minimum.py [--trials 1000] [--starts 2] [--seed 0]

For both interactions and n = 1 … 4: weights log-uniform in [0.3, 3], a horizon within the escape time, an instant
uniform on the grid, a network of uniform density. Trial i of a line depends on (seed, interaction, n, i) alone.
Needs the extra ``bounds``. The output is quoted in docs/theory/global.md.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter

import numpy as np

import tadcore
from tadcore.verification._matrices import matrices_of
from tadcore.verification.bounds import bound_theta
from tadcore.verification.gains import multistart
from tadcore.verification.objective import FullObjective

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
        found = tadcore.synthesize(sc, step=k, adjacency=network)
        begun = time.perf_counter()
        bound = bound_theta(FullObjective(sc, m, values[:, k], network, dim=1), found.theta)
        spent += time.perf_counter() - begun
        counts["trials"] += 1
        counts["converged"] += found.converged
        counts["first"] += found.certified and found.look == "canonical"
        counts["certified"] += found.certified
        counts["complex"] += found.look in ("canonical", "complex")
        counts["lower"] += found.look != "canonical"
        counts["tight"] += bound.tight
        counts["certified, not tight"] += found.certified and not bound.tight
        counts["above"] += bound.gap < -1e-10 * bound.scale
        if not bound.tight:
            gaps.append(bound.relative_gap)
        if starts:
            full = FullObjective(sc, m, values[:, k], network)
            best = multistart(full, full.blocks(found.rows), starts, rng)
            floor = LOWER * max(found.theta, 1e-10 * bound.scale)
            counts["beaten"] += best < found.theta - floor
            counts["beaten, certified"] += found.certified and best < found.theta - floor
            counts["below bound"] += best < bound.value - 1e-10 * bound.scale
    return counts, gaps, 1e3 * spent / trials


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=1000, help="instants for each interaction and n")
    parser.add_argument("--starts", type=int, default=2, help="random starts in full blocks for each instant")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    head = ("pairs", "first", "certified", "complex", "tight", "gap 50%", "gap max", "beaten", "ms")
    print(" " * 6 + "".join(f"{name:>10}" for name in head))
    total: Counter[str] = Counter()
    for interaction in ("I1", "I2"):
        for n in range(1, 5):
            counts, gaps, cost = line(interaction, n, args.trials, args.starts, args.seed)
            total += counts
            share = {k: f"{counts[k] / counts['trials']:.1%}" for k in ("first", "certified", "complex", "tight")}
            middle, most = (f"{np.median(gaps):.1e}", f"{max(gaps):.1e}") if gaps else ("-", "-")
            cells = (counts["trials"], *share.values(), middle, most, counts["beaten"], f"{cost:.1f}")
            print(f"{interaction} n={n}" + "".join(f"{cell:>10}" for cell in cells), flush=True)
    for name in ("trials", "converged", "first", "certified", "complex", "lower", "tight", "certified, not tight"):
        print(f"{name:24}{total[name]:8}")
    for name in ("above", "beaten", "beaten, certified", "below bound"):
        print(f"{name:24}{total[name]:8}")


if __name__ == "__main__":
    main()
