"""Does following minima between anchors lose any? Pairs that random games pass through, searched at every instant, too.

    python benches/anchors.py [--pairs 100000] [--seed 0]

Games as in ``global_minimum.py --visited``: n = 2 … 5, weights and γ log-uniform in [0.1, 10], on grids of 40 to 1,200
steps. At pairs of instant and network of each game the gains of runs are compared with a search with restarts at that
instant alone. Printed: how many pairs are followed from between two anchors, at how many of them Θ is higher, or lower,
than the search's by more than a 10⁻⁸th, and the steps that both take. The figures are quoted in ``docs/decisions``.
"""

from __future__ import annotations

import argparse
from collections import Counter

import numpy as np
from global_minimum import LOWER, played

import tadcore
from tadcore.game.compiled import game_of

OF_EACH = 60
"""Pairs of one game: a game costs a Riccati solution and a run."""


def refined(rng: np.random.Generator, run: tadcore.Run) -> tadcore.Run:
    """The same game on a grid up to thirty times as fine."""
    sc = run.scenario
    times = int(rng.choice([1, 3, 10, 30]))
    if times == 1 or sc.steps * times > 1_200:
        return run
    return tadcore.simulate(sc.replace(step=sc.horizon / (sc.steps * times)))


def main(pairs: int, seed: int) -> None:
    """The counts of so many pairs."""
    counts: Counter[str] = Counter()
    worst, game = 0.0, 0
    while counts["pairs"] < pairs:
        rng = np.random.Generator(np.random.Philox(key=[seed, game]))
        game += 1
        run = played(rng)
        if run is None:
            continue
        try:
            run = refined(rng, run)
        except tadcore.NoEquilibriumError:
            continue
        core, seen = game_of(run.scenario), np.asarray(run.adjacency)
        for k in rng.permutation(len(seen))[:OF_EACH]:
            if seen[k].all():
                continue
            found, alone = (core.synthesize(int(k), seen[k], method=m) for m in ("newton", "restarts"))
            scale = max(alone.theta, 1e-12)
            apart = (found.theta - alone.theta) / scale
            between = found.start == "between"
            counts["pairs"] += 1
            counts["between anchors"] += between
            counts["  not certified"] += between and not alone.certified
            counts["  higher"] += between and apart > LOWER
            counts["  higher though certified"] += between and apart > LOWER and found.certified
            counts["  lower"] += between and apart < -LOWER
            counts["  certified there alone"] += between and found.certified and not alone.certified
            counts["  certified by the search alone"] += between and alone.certified and not found.certified
            counts["  not converged"] += between and not found.converged
            counts["  steps"] += found.iterations if between else 0
            counts["  steps of the search"] += alone.iterations if between else 0
            if between and apart > LOWER:
                worst = max(worst, apart)
                where = f"seed {seed}, game {game - 1}, k = {k} of {run.scenario.steps}"
                print(f"  higher by {apart:.1e}: {where}, {seen[k].astype(int).tolist()}", flush=True)
    print(f"{game} games")
    for name, count in counts.items():
        print(f"{name:<32} {count:>9,}")
    print(f"highest above the search's: {worst:.1e} of it")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    main(given.pairs, given.seed)
