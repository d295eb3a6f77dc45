"""A search on common random numbers, and its answer judged by fresh trials.

Every candidate is played with the same trials, so P, as estimated from M of them, is a function without noise and
piecewise constant, which an optimiser can search. What it returns was chosen for the trials that it was chosen with, so
its share there is too high: it is played again with fresh trials, and those are reported.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import Floats, as_seed
from tadcore._shared.progress import bar
from tadcore.errors import ScenarioError
from tadcore.statistics import difference_interval, proportion_interval
from tadcore.study.study import Study


@dataclass(frozen=True)
class Judged:
    """P(outcome) of what was found and of what it is compared with, from fresh trials, by fields of their results."""

    estimate: float
    low: float
    high: float
    own: float
    gain: float
    gain_low: float
    gain_high: float


def fresh_study(study: Study, seed: int | None, *, progress: bool) -> Study:
    """The study of the fresh trials; its draws and those of the search are checked before anything is played."""
    if not isinstance(study, Study):
        raise ScenarioError("study", study, "a tadcore.Study: fresh trials are drawn from it")
    fresh = (study.seed + 1) % 2**64 if seed is None else as_seed(seed)
    if fresh == study.seed:
        raise ScenarioError("seed", seed, "another than the study's own: the fresh trials must be new")
    again = study.replace(seed=fresh)
    for one in (study, again):
        one.check(progress=progress)
    return again


def search(
    share: Callable[[Floats], float], bounds: Sequence[tuple[float, float]], most: int, what: str, *, progress: bool
) -> tuple[Floats, float, int]:
    """Where `share` is largest in a box, as far as so many evaluations tell; its value there, and how many there were.

    The search divides the box into ever smaller ones (`scipy.optimize.direct`, locally biased).
    """
    from scipy.optimize import direct

    steps = iter(bar(range(most), what, show=progress))
    played = 0

    def loss(place: Floats) -> float:
        nonlocal played
        next(steps, None)
        played += 1
        return -share(place)

    found = direct(loss, list(bounds), maxfun=most, maxiter=most, vol_tol=0.0, len_tol=0.0)
    for _ in steps:
        pass
    return np.asarray(found.x), -float(found.fun), played


def judged(found: NDArray[np.bool_], own: NDArray[np.bool_], level: float) -> Judged:
    """Which fresh trials ended in the outcome with what was found, and which with what it is compared with."""
    trials, hits, others = len(found), int(found.sum()), int(own.sum())
    low, high = proportion_interval(hits, trials, level=level, method="exact")
    better, worse = int(np.count_nonzero(found & ~own)), int(np.count_nonzero(own & ~found))
    gain_low, gain_high = difference_interval(better, worse, trials, level=level)
    return Judged(
        estimate=hits / trials,
        low=float(low),
        high=float(high),
        own=others / trials,
        gain=(hits - others) / trials,
        gain_low=float(gain_low),
        gain_high=float(gain_high),
    )
