r"""Intervals that hold at all numbers of trials at once, and the rule that stops a study at a given precision.

An ordinary interval holds at a number of trials fixed beforehand. Looking after every chunk and stopping when it is
narrow enough breaks its promise. A *confidence sequence* holds at all numbers of trials at once, so stopping by it at
any moment, for any reason, is sound.

After t Bernoulli trials with s successes, the likelihood ratio of a uniform mixture of probabilities against p is

.. math::  M_t(p) = \int_0^1 \frac{q^s (1-q)^{t-s}}{p^s (1-p)^{t-s}}\,dq
                  = \frac{B(s + 1,\, t - s + 1)}{p^s (1-p)^{t-s}},

a nonnegative martingale of mean 1 where p is true, so by Ville's inequality it ever reaches 1/α with probability at
most α. What it has not refuted, :math:`\{p : M_t(p) < 1/\alpha\}`, is an interval around s / t, and contains the truth
at every t at once with probability at least 1 - α.

References
----------
H. Robbins, "Statistical methods related to the law of the iterated logarithm", Annals of Mathematical Statistics 41
(1970), example (uniform mixture of Bernoulli laws). J. Ville, "Étude critique de la notion de collectif" (1939).
S. R. Howard, A. Ramdas, J. McAuliffe and J. Sekhon, "Time-uniform, nonparametric, nonasymptotic confidence sequences",
Annals of Statistics 49 (2021).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tadcore._shared.arrays import as_index
from tadcore.errors import ScenarioError

from .outcomes import KINDS, MOST_TRIALS, as_level, outcome_names


@dataclass(frozen=True)
class HalfWidth:
    """Stop when every outcome probability is known to within ±width.

    The intervals hold at every number of trials and for all outcomes at once, with probability at least ``level``:
    1 - level is split evenly between the outcomes. They depend on the counts alone, not on when one looked. They need
    independent trials: a plain random study, not a Sobol' or Latin hypercube design.

    Parameters
    ----------
    width : float
        The largest accepted half-width of an interval, in (0, 0.5).
    level : float
        Confidence that all intervals hold at all times.

    Raises
    ------
    ScenarioError
        A number is out of its range.

    Examples
    --------
    >>> from tadcore.statistics import HalfWidth
    >>> rule = HalfWidth(0.05)
    >>> rule.satisfied({"captured": 30, "intercepted": 70}, 100)
    False
    >>> rule.satisfied({"captured": 600, "intercepted": 1400}, 2000)
    True
    """

    width: float
    level: float = 0.95

    def __post_init__(self) -> None:
        as_level(self.level)
        number = isinstance(self.width, int | float | np.floating) and not isinstance(self.width, bool)
        if not number or not 0.0 < self.width < 0.5:
            raise ScenarioError("width", self.width, "a half-width in (0, 0.5)")

    def intervals(self, counts: Mapping[str, int] | ArrayLike, trials: int) -> dict[str, tuple[float, float]]:
        """Low and high of each outcome's probability after so many trials.

        Parameters
        ----------
        counts : mapping of str to int, or array_like of int
            How many trials ended in each outcome, as `outcome_counts` gives them; without names, in that order:
            by `OutcomeKind`, then by defender. A study must count the same outcomes at every evaluation.
        trials : int
            How many trials there were.

        Returns
        -------
        dict of str to (float, float)
            An interval for each name; (0, 1) before the first trial.

        Raises
        ------
        ScenarioError
            No outcome is counted, or a count is not in [0, trials].
        """
        total = as_index("trials", trials, MOST_TRIALS)
        named = _named(counts)
        error = (1.0 - self.level) / len(named)
        return {
            name: mixture_interval(as_index(f"counts[{name!r}]", count, total), total, error)
            for name, count in named.items()
        }

    def satisfied(self, counts: Mapping[str, int] | ArrayLike, trials: int) -> bool:
        """Whether every interval of `intervals` is at most ``2 * width`` wide."""
        return all(high - low <= 2.0 * self.width for low, high in self.intervals(counts, trials).values())


def _named(counts: Mapping[str, int] | ArrayLike) -> Mapping[str, int]:
    if isinstance(counts, Mapping):
        named: Mapping[str, int] = counts
    else:
        array = np.asarray(counts)
        if array.ndim != 1 or len(array) < len(KINDS) or array.dtype.kind not in "iu":
            raise ScenarioError("counts", counts, "whole numbers: one for each kind of outcome, then for each defender")
        named = dict(zip(outcome_names(len(array) - len(KINDS)), map(int, array), strict=True))
    if not named:
        raise ScenarioError("counts", counts, "one count for each outcome")
    return named


def mixture_interval(successes: int, trials: int, error: float) -> tuple[float, float]:
    """All p with M_t(p) < 1 / error, where s of t trials succeeded.

    Parameters
    ----------
    successes, trials : int
        s and t, 0 ≤ s ≤ t.
    error : float
        α, the probability with which the sequence of intervals may ever miss the truth, in (0, 1].

    Returns
    -------
    low, high : float
        Ends of the interval.

    Raises
    ------
    ScenarioError
        A number is out of its range.
    """
    total = as_index("trials", trials, MOST_TRIALS)
    s = as_index("successes", successes, total)
    alpha = as_error(error)
    return _lower_end(s, total - s, alpha), 1.0 - _lower_end(total - s, s, alpha)


def as_error(error: Any) -> float:
    """A probability of error: a number in (0, 1]."""
    number = isinstance(error, int | float | np.floating) and not isinstance(error, bool)
    if not number or not 0.0 < float(error) <= 1.0:
        raise ScenarioError("error", error, "a probability in (0, 1]")
    return float(error)


def log_stirling(count: int) -> float:
    """Logarithm of count! e^count / count^count, accurate for large counts."""
    if count < 1_000:
        return math.lgamma(count + 1.0) - count * math.log(max(count, 1)) + count
    return math.log(2.0 * math.pi * count) / 2.0 + 1.0 / (12.0 * count) - 1.0 / (360.0 * count**3)


def _lower_end(successes: int, failures: int, error: float) -> float:
    from scipy.optimize import brentq

    if successes == 0:
        return 0.0
    trials = successes + failures
    top, rest = successes / trials, failures / trials
    # logarithm of α M_t at s/t; differences from it are computed as such, since each likelihood is tiny
    peak = log_stirling(successes) + log_stirling(failures) - log_stirling(trials) - math.log1p(trials)
    peak += math.log(error)

    def excess(p: float) -> float:
        """Logarithm of α M_t(p): negative inside the interval, decreasing up to s / t."""
        lost = failures * math.log1p((top - p) / rest) if failures else 0.0
        won = math.log(p / top) if 2.0 * p < top else math.log1p((p - top) / top)
        return peak - successes * won - lost

    if not excess(top) < 0.0:  # a level so low that nothing but the estimate is left
        return top
    alone = failures * (math.log1p(-top) if top < 0.5 else math.log(rest)) if failures else 0.0
    outside = top * math.exp((peak + alone) / successes) * (1.0 - 1e-9)  # there p^s alone makes M_t reach 1/α
    if outside == 0.0:  # smaller than any double
        return 0.0
    found: float = brentq(excess, outside, top, xtol=1e-300, rtol=1e-13, maxiter=2_000)
    return found
