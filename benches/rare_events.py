"""Rare events against crude Monte Carlo: bias and coverage at P ≈ 1e-4, and what 1e-8 costs.

    python benches/rare_events.py [--calls 500] [--crude 100000000] [full] [limited] [target] [deep]

Each case but the last is estimated by so many calls of `tadcore.rare`, each with a seed of its own, and by one crude
study. Printed are the mean of the calls with its standard error, the crude estimate with its own, their difference in
standard errors, and how often the 95 % intervals hold the crude estimate. ``deep`` is the full game at P ≈ 1e-8.
"""

from __future__ import annotations

import argparse
import math
import time

import numpy as np

import tadcore
from tadcore.sampling import Gaussian

CASES = {
    "full": ("paper-i1-full", "intercepted", 0.033),
    "limited": ("paper-i1", "d3", 0.093),
    "target": ("paper-i2", "captured", 0.032),
}


def study_of(name: str, spread: float, seed: int, trials: int = 1, **changes: float) -> tadcore.Study:
    """Every player starts normally around its place."""
    sc = tadcore.scenarios.load(name)
    sc = sc.replace(changes) if changes else sc
    starts = zip(sc.players, sc.positions, strict=True)
    vary = {f"{player}.position": Gaussian(list(at), spread) for player, at in starts}
    return tadcore.Study(sc, vary, trials=trials, seed=seed)


def compare(case: str, calls: int, crude: int) -> None:
    """Many calls beside one crude study."""
    name, event, spread = CASES[case]
    began = time.perf_counter()
    found = [tadcore.rare(study_of(name, spread, 1_000 + i, step=0.02), event) for i in range(calls)]
    between = time.perf_counter()
    result = study_of(name, spread, 7, crude, step=0.02).run(keep="counts")
    shares = result.probabilities()
    row = shares.names.index(event)
    truth = float(shares.estimate[row])
    own = math.sqrt(truth / crude)
    means = np.array([one.probability for one in found])
    error = means.std(ddof=1) / math.sqrt(calls)
    z = (means.mean() - truth) / math.hypot(error, own)
    held = np.mean([one.interval[0] <= truth <= one.interval[1] for one in found])
    runs = [one.runs for one in found]
    print(
        f"{case}: {calls} calls, mean {means.mean():.4e} ± {error:.1e}; crude {truth:.4e} ± {own:.1e} "
        f"({int(shares.count[row]):,} of {crude:,}); {z:+.2f} standard errors apart; coverage {held:.1%}; "
        f"relative error of a call {means.std(ddof=1) / means.mean():.1%}, as it says "
        f"{np.mean([one.error for one in found]):.1%}; {np.mean(runs):,.0f} runs, at most {max(runs):,}; "
        f"{(between - began) / calls:.2f} s a call, {time.perf_counter() - between:.0f} s crude",
        flush=True,
    )


def deep(seeds: int) -> None:
    """One in a hundred million, by as many seeds."""
    found = []
    for seed in range(seeds):
        began = time.perf_counter()
        found.append(tadcore.rare(study_of("paper-i1-full", 0.022, seed), "intercepted"))
        print(f"{found[-1]!r}; {time.perf_counter() - began:.1f} s", flush=True)
    means = np.array([one.probability for one in found])
    print(f"deep: mean {means.mean():.3e} ± {means.std(ddof=1) / math.sqrt(seeds):.1e}", flush=True)


def main() -> None:
    """Measure what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", nargs="*", default=[*CASES, "deep"])
    parser.add_argument("--calls", type=int, default=500)
    parser.add_argument("--crude", type=int, default=100_000_000)
    given = parser.parse_args()
    for case in given.cases:
        if case == "deep":
            deep(20)
        else:
            compare(case, given.calls, given.crude)


if __name__ == "__main__":
    main()
