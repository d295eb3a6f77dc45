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

import numpy as np
from numpy.typing import ArrayLike

from tadcore._shared.arrays import as_index
from tadcore.errors import ScenarioError

from .outcomes import KINDS, as_level, outcome_names


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
        if not number or not 0.0 < float(self.width) < 0.5:
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
        total = as_index("trials", trials, 2**53)
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
        α, the probability with which the sequence of intervals may ever miss the truth.

    Returns
    -------
    low, high : float
        Ends of the interval.
    """
    failures = trials - successes
    return _lower_end(successes, failures, error), 1.0 - _lower_end(failures, successes, error)


def _lower_end(successes: int, failures: int, error: float) -> float:
    from scipy.optimize import brentq
    from scipy.special import betaln, xlog1py, xlogy

    if successes == 0:
        return 0.0
    evidence = float(betaln(successes + 1, failures + 1)) + math.log(error)

    def excess(p: float) -> float:
        """Logarithm of α M_t(p): negative inside the interval, decreasing up to s / t."""
        return evidence - float(xlogy(successes, p) + xlog1py(failures, -p))

    outside = math.exp(evidence / successes) * (1.0 - 1e-9)  # there p^s alone makes M_t reach 1/α
    found: float = brentq(excess, outside, successes / (successes + failures), xtol=1e-15, rtol=1e-13)
    return found
