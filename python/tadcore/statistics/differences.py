r"""Differences of probabilities from paired trials: intervals and tests.

Trial i of two studies A and B has the same inputs, so its two outcomes form a pair. For one outcome let b trials end so
in A only and c in B only; the rest agree and say nothing about the difference
:math:`\Delta = p_A - p_B`, whose estimate is (b - c) / M.

- **Test** of Δ = 0: given b + c, b is binomial with probability ½ (McNemar 1947, exact form).
- **Interval**: all Δ that the score test does not reject,

  .. math:: \frac{|b - c - M\Delta|}{\sqrt{M (2 \tilde q + \Delta (1 - \Delta))}} \le z,

  with q̃ the maximum-likelihood estimate under Δ of the probability to end so in B only. At Δ = 0 the statistic is
  McNemar's; the interval has no width of zero where b = c = 0 and never leaves [-1, 1] (Tango, Statistics in Medicine
  17, 1998). Like Wilson's its coverage is near the level for most probabilities, not for all.

Both hold for a number of trials that was fixed beforehand. With ``method="sequence"`` they hold at all numbers of
trials at once, so also where a rule was asked when to stop. A mixture over all laws of (in A only, in B only, neither),

.. math::  M(p) = \frac{2\, b!\, c!\, r! / (M + 2)!}{p_b^b\, p_c^c\, p_r^r},

is a nonnegative martingale of mean 1 at the true p, as that of `mixture_interval` is; the interval has every Δ for
which some p with :math:`p_b - p_c = \Delta` is not refuted. Under Δ = 0 the pairs that differ are fair coins, and
:math:`B(b + 1, c + 1)\, 2^{b + c}` is such a martingale: its inverse is a p-value at any time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tadcore._shared.arrays import Floats, Integers, as_index, refuse_where
from tadcore.errors import ScenarioError

from .outcomes import MOST_TRIALS, as_counts, as_level
from .sequences import log_stirling

Method = Literal["score", "sequence"]


def mcnemar(b: int, c: int) -> float:
    """The p-value of McNemar's exact test."""
    from scipy.stats import binomtest

    return float(binomtest(b, b + c).pvalue) if b + c else 1.0


def fair_coins(b: int, c: int) -> float:
    """The inverse of the uniform mixture against ½, at most 1."""
    from scipy.special import betaln

    return math.exp(min(-float(betaln(b + 1, c + 1)) - (b + c) * math.log(2.0), 0.0))


def discordant(a: NDArray[np.bool_], b: NDArray[np.bool_]) -> tuple[Integers, Integers]:
    """How many trials (last axis) are in A only and in B only."""
    return np.count_nonzero(a & ~b, axis=-1).astype(np.int64), np.count_nonzero(b & ~a, axis=-1).astype(np.int64)


def difference_interval(
    only_a: ArrayLike, only_b: ArrayLike, trials: int, *, level: float = 0.95, method: Method = "score"
) -> tuple[Floats, Floats]:
    """Interval for P_A - P_B from paired trials, for each of many pairs of counts.

    Parameters
    ----------
    only_a, only_b : array_like of int
        b and c: trials that end so in A only and in B only.
    trials : int
        M, at least b + c.
    level : float
        Confidence level of each interval by itself.
    method : {"score", "sequence"}
        Tango's score interval, or a confidence sequence, which holds at all M at once.

    Returns
    -------
    low, high : ndarray
        Of the shape of ``only_a``.

    Raises
    ------
    ScenarioError
        A pair of counts is impossible, or an option is not one.
    """
    from scipy.stats import norm

    error = 1.0 - as_level(level)
    if method not in ("score", "sequence"):
        raise ScenarioError("method", method, 'one of "score" and "sequence"')
    total = as_index("trials", trials, MOST_TRIALS, least=1)
    counts = as_counts("only_a", only_a), as_counts("only_b", only_b)
    try:
        first, second = np.broadcast_arrays(*counts)
    except ValueError:
        raise ScenarioError("only_b", f"shape {counts[1].shape}", f"the shape of only_a, {counts[0].shape}") from None
    impossible = (np.minimum(first, second) < 0) | (first + second > total)
    refuse_where("only_a", first, impossible, f"at least 0, as only_b, and together with it at most {total}")
    z = float(norm.isf(error / 2.0))

    def upper(b: int, c: int) -> float:
        return _score_end(b, c, total, z) if method == "score" else _sequence_end(b, c, total, error)

    pairs = list(zip(first.ravel().tolist(), second.ravel().tolist(), strict=True))
    found = {(b, c): (-upper(c, b), upper(b, c)) for b, c in set(pairs)}
    ends = np.array([found[pair] for pair in pairs])
    low, high = (column.reshape(first.shape) for column in ends.reshape(-1, 2).T)
    return low, high


def _score_end(b: int, c: int, trials: int, z: float) -> float:
    """The largest Δ that the score test does not reject; the smallest is that of (c, b), negated."""
    if b + c == 0:  # there q̃ = 0 for every Δ > 0, and the equation is linear
        return z * z / (trials + z * z)
    if c == trials:  # at Δ = -1 the variance is 0, too
        return (z * z - trials) / (z * z + trials)
    middle = (b - c) / trials

    def beyond(delta: float) -> float:
        """Squared distance from Δ minus z² times its variance under Δ, per trial: positive outside the interval."""
        variance = 2.0 * _only_b(b, c, trials, delta) + delta * (1.0 - delta)
        return trials * (middle - delta) ** 2 - z * z * variance

    return _root(beyond, middle)


def _sequence_end(b: int, c: int, trials: int, error: float) -> float:
    """The largest Δ with some (p_b, p_c, p_r) that the mixture has not refuted."""
    counts = (b, c, trials - b - c)
    peak = sum(map(log_stirling, counts)) - log_stirling(trials) + math.log(2.0 * error)
    peak -= math.log1p(trials) + math.log(trials + 2.0)

    def beyond(delta: float) -> float:
        """Logarithm of α M at the likeliest probabilities under Δ: positive outside the interval."""
        q = _only_b(b, c, trials, delta)
        found = peak
        for count, p in zip(counts, (q + delta, q, 1.0 - 2.0 * q - delta), strict=True):
            if count:
                found += count * (math.log(count / trials) - math.log(max(p, 1e-300)))
        return found

    return _root(beyond, (b - c) / trials)


def _only_b(b: int, c: int, trials: int, delta: float) -> float:
    """The likeliest probability of "in B only" under Δ, a root of a quadratic; that of "in A only" is Δ more."""
    linear = -(b + c) / trials + (2.0 - (b - c) / trials) * delta
    constant = -(c / trials) * delta * (1.0 - delta)
    root = math.sqrt(max(linear * linear - 8.0 * constant, 0.0))
    q = (root - linear) / 4.0 if linear <= 0.0 else -2.0 * constant / (root + linear)
    return max(q, -delta, 0.0)


def _root(beyond: Callable[[float], float], middle: float) -> float:
    """Where a function that grows from the estimate to Δ = 1 turns positive; the estimate itself where it begins so."""
    from scipy.optimize import brentq

    if not (middle < 1.0 and beyond(middle) < 0.0):
        return middle
    found: float = brentq(beyond, middle, 1.0, xtol=1e-15, rtol=1e-13, maxiter=1_000)
    return found
