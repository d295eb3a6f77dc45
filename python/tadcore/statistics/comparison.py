r"""Two studies on common random numbers: what the change did, trial by trial.

Trial i of both studies has the same inputs, so its two outcomes form a pair. For one outcome let b trials end so in
study A only and c in study B only; the rest agree and say nothing about the difference
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
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tadcore._shared.arrays import Floats, Integers, as_index, refuse_where
from tadcore._shared.html import as_html
from tadcore._shared.shares import estimate, percent
from tadcore._shared.text import as_text
from tadcore.errors import ScenarioError
from tadcore.game.outcome import OutcomeKind

from .outcomes import (
    KINDS,
    MOST_TRIALS,
    TrialOutcomes,
    as_counts,
    as_level,
    as_outcomes,
    diverged_of,
    indicators,
    outcome_names,
)
from .sequences import log_stirling
from .stopping import level_of, stopping_of

if TYPE_CHECKING:
    import pandas as pd

Method = Literal["score", "sequence"]


@dataclass(frozen=True, eq=False, repr=False)
class Comparison:
    """How outcomes differ between two studies of the same trials; made by `compare`.

    Attributes
    ----------
    names : tuple of str
        ``"timeout"``, ``"captured"``, ``"intercepted"``, then ``"d1"`` … ``"dn"``; last ``"diverged"``, where some
        trials did in A or in B.
    difference, low, high : ndarray, shape (3 + n,) or (4 + n,)
        P_A - P_B and the ends of its interval.
    only_a, only_b : ndarray of int, shape (3 + n,)
        Trials that end so in A but not in B, and the reverse.
    p_value : ndarray, shape (3 + n,)
        Of the exact McNemar test of no difference; with ``"sequence"`` of a test that holds whenever one stops.
    transitions : ndarray of int, shape (3, 3) or (4, 4)
        Trials by their kind in A (row) and in B (column), in the order of `OutcomeKind`; last those that diverged,
        where there are any.
    flipped : ndarray of int
        The trials whose kind differs, or that diverged in one of the two.
    redirected : ndarray of int
        The trials that are intercepted in both, by different defenders.
    trials : int
        M.
    level : float
        Confidence level of each interval by itself.
    method : {"score", "sequence"}
        For a number of trials that was fixed beforehand, or for one that a rule decided.
    rule : str
        The rule that was asked when to stop; empty where there was none.
    """

    names: tuple[str, ...]
    difference: Floats
    low: Floats
    high: Floats
    only_a: Integers
    only_b: Integers
    p_value: Floats
    transitions: Integers
    flipped: Integers
    redirected: Integers
    trials: int
    level: float
    method: Method = "score"
    rule: str = ""

    def to_pandas(self) -> pd.DataFrame:
        """A table with one row for each outcome."""
        import pandas as pd

        columns = {name: getattr(self, name) for name in ("difference", "low", "high", "only_a", "only_b", "p_value")}
        return pd.DataFrame(columns, index=pd.Index(self.names, name="outcome"))

    def _table(self) -> tuple[str, list[str], list[list[str]]]:
        rows = [
            [name, f"{a:,}", f"{b:,}", shown[0], _p_text(p), shown[1]]
            for name, a, b, shown, p in zip(
                self.names, self.only_a, self.only_b, self._texts(), self.p_value, strict=True
            )
        ]
        head = ["outcome", "only A", "only B", "P(A) - P(B)", "p-value", f"{percent(self.level)} ({self.method})"]
        by = f", {self.rule}" if self.rule else ""
        return f"{self.trials:,} trials{by}, {len(self.flipped):,} flipped", head, rows

    def __repr__(self) -> str:
        return as_text(*self._table())

    def _repr_html_(self) -> str:
        return as_html(*self._table())

    def _texts(self) -> list[tuple[str, str]]:
        columns = zip(self.difference, self.low, self.high, strict=True)
        return [estimate(d, low, high, sign=True) for d, low, high in columns]


def _p_text(p: float) -> str:
    return f"{p:.2g}" if p > 0.0 else "< 1e-300"  # smaller than any double


def compare(a: TrialOutcomes, b: TrialOutcomes, *, level: float | None = None) -> Comparison:
    """Compare two studies of the same trials.

    Where a rule was asked when to stop one of them, intervals and p-values are those that hold whenever one stops.

    Parameters
    ----------
    a, b : StudyResult
        Two studies with the same seed, number of trials and varied inputs, of scenarios that may differ in everything
        else but the number of defenders.
    level : float, optional
        Confidence level of each interval by itself; 0.95, or that of the rule that was asked when to stop.

    Returns
    -------
    Comparison
        Paired differences A - B, transitions, and the trials that flipped.

    Raises
    ------
    ScenarioError
        The studies do not share their random numbers.
    """
    if a.scenario.n != b.scenario.n:
        raise ScenarioError("b.scenario", f"{b.scenario.n} defenders", f"a game of {a.scenario.n}, as a's is")
    if a.seed != b.seed:
        raise ScenarioError("b.seed", b.seed, f"{a.seed}, as a's is: the comparison needs common random numbers")
    if a.trials != b.trials:
        raise ScenarioError("b.trials", b.trials, f"{a.trials}, as a's are: trials are compared one by one")
    if set(a.inputs) != set(b.inputs):
        wanted = ", ".join(sorted(a.inputs)) or "nothing"
        raise ScenarioError("b.vary", ", ".join(sorted(b.inputs)) or "nothing", f"what a varies: {wanted}")
    for name in a.inputs:
        unlike = np.flatnonzero(~np.equal(a.inputs[name], b.inputs[name]))
        if unlike.size:
            i = int(unlike[0])
            rule = f"{float(a.inputs[name][i])!r}, as a's is: the comparison needs common random numbers"
            raise ScenarioError(f"b.inputs[{name!r}][{i}]", float(b.inputs[name][i]), rule)
    rules = {f"{name} {stopping}": stopping for name, one in (("A", a), ("B", b)) if (stopping := stopping_of(one))}
    found = paired(
        a.kind,
        a.defender,
        b.kind,
        b.defender,
        a.scenario.n,
        diverged_a=diverged_of(a),
        diverged_b=diverged_of(b),
        level=level_of(next(iter(rules.values()), None), level),
        method="sequence" if rules else "score",
    )
    return replace(found, rule=", ".join(rules))


def paired(
    kind_a: ArrayLike,
    defender_a: ArrayLike,
    kind_b: ArrayLike,
    defender_b: ArrayLike,
    n: int,
    *,
    diverged_a: ArrayLike | None = None,
    diverged_b: ArrayLike | None = None,
    level: float = 0.95,
    method: Method = "score",
) -> Comparison:
    """Compare the outcomes of the same M trials under two conditions, as `compare` does.

    Parameters
    ----------
    kind_a, defender_a, kind_b, defender_b : array_like of int, shape (M,)
        Outcomes under A and under B, as in `tadcore.Batch`.
    n : int
        Number of defenders.
    diverged_a, diverged_b : array_like of bool, shape (M,), optional
        Which trials diverged; these are counted apart.
    level : float
        Confidence level of each interval by itself.
    method : {"score", "sequence"}
        Tango's interval and McNemar's test for a number of trials that was fixed beforehand, or a confidence sequence
        and a test that hold whenever one stops.

    Returns
    -------
    Comparison
        Paired differences A - B.

    Raises
    ------
    ScenarioError
        The arrays do not fit together.
    """
    as_level(level)
    lost = diverged_a is not None or diverged_b is not None
    none_a, none_b = (np.zeros(np.size(kind), dtype=np.bool_) if lost else None for kind in (kind_a, kind_b))
    events_a = indicators(kind_a, defender_a, n, none_a if diverged_a is None else diverged_a)
    events_b = indicators(kind_b, defender_b, n, none_b if diverged_b is None else diverged_b)
    code_a, who_a = as_outcomes(kind_a, defender_a, n, diverged_a)
    code_b, who_b = as_outcomes(kind_b, defender_b, n, diverged_b)
    if code_a.shape != code_b.shape:
        raise ScenarioError("kind_b", f"{len(code_b)} trials", f"{len(code_a)} trials, as in A")
    only_a, only_b = discordant(events_a, events_b)
    trials = len(code_a)
    low, high = difference_interval(only_a, only_b, trials, level=level, method=method)
    test = _fair_coins if method == "sequence" else _mcnemar
    p_values = [test(int(x), int(y)) for x, y in zip(only_a, only_b, strict=True)]
    transitions = np.zeros((len(KINDS) + lost, len(KINDS) + lost), dtype=np.int64)
    np.add.at(transitions, (code_a, code_b), 1)
    both = (code_a == OutcomeKind.INTERCEPTED) & (code_b == OutcomeKind.INTERCEPTED)
    return Comparison(
        names=outcome_names(n, diverged=lost),
        difference=(only_a - only_b) / trials,
        low=low,
        high=high,
        only_a=only_a,
        only_b=only_b,
        p_value=np.array(p_values, dtype=np.float64),
        transitions=transitions,
        flipped=np.flatnonzero(code_a != code_b),
        redirected=np.flatnonzero(both & (who_a != who_b)),
        trials=trials,
        level=float(level),
        method=method,
    )


def _mcnemar(b: int, c: int) -> float:
    from scipy.stats import binomtest

    return float(binomtest(b, b + c).pvalue) if b + c else 1.0


def _fair_coins(b: int, c: int) -> float:
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
