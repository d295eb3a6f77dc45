r"""Two studies on common random numbers: what the change did, trial by trial.

Trial i of both studies has the same inputs, so its two outcomes form a pair. For one outcome let b trials end so in
study A only and c in study B only; the rest agree and say nothing about the difference
:math:`\Delta = p_A - p_B`, whose estimate is (b - c) / M.

- **Test** of Δ = 0: given b + c, b is binomial with probability ½ (McNemar 1947, exact form).
- **Interval**: all Δ that the score test does not reject,

  .. math:: \frac{|b - c - M\Delta|}{\sqrt{M (2 \tilde q + \Delta (1 - \Delta))}} \le z,

  with q̃ the maximum-likelihood estimate under Δ of the probability to end so in B only. At Δ = 0 the statistic is
  McNemar's; the interval has no width of zero where b = c = 0 and never leaves [-1, 1] (Tango, Statistics in Medicine
  17, 1998).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tadcore._shared.arrays import Floats, Integers, refuse_where
from tadcore._shared.text import as_text
from tadcore.errors import ScenarioError
from tadcore.game.outcome import OutcomeKind

from .outcomes import KINDS, TrialOutcomes, as_level, as_outcomes, indicators, outcome_names

if TYPE_CHECKING:
    import pandas as pd

_APART = 1e-12  # keeps a bracket off the estimate itself, where the squared test statistic may be 0 / 0


@dataclass(frozen=True, eq=False, repr=False)
class Comparison:
    """How outcomes differ between two studies of the same trials; made by `compare`.

    Attributes
    ----------
    names : tuple of str
        ``"timeout"``, ``"captured"``, ``"intercepted"``, then ``"d1"`` … ``"dn"``.
    difference, low, high : ndarray, shape (3 + n,)
        P_A - P_B and the ends of its interval.
    only_a, only_b : ndarray of int, shape (3 + n,)
        Trials that end so in A but not in B, and the reverse.
    p_value : ndarray, shape (3 + n,)
        Of the exact McNemar test of no difference.
    transitions : ndarray of int, shape (3, 3)
        Trials by their kind in A (row) and in B (column), in the order of `OutcomeKind`.
    flipped : ndarray of int
        The trials whose kind differs.
    redirected : ndarray of int
        The trials that are intercepted in both, by different defenders.
    trials : int
        M.
    level : float
        Confidence level of each interval.
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

    def to_pandas(self) -> pd.DataFrame:
        """A table with one row for each outcome."""
        import pandas as pd

        columns = {name: getattr(self, name) for name in ("difference", "low", "high", "only_a", "only_b", "p_value")}
        return pd.DataFrame(columns, index=pd.Index(self.names, name="outcome"))

    def __repr__(self) -> str:
        rows = [
            [name, f"{a:,}", f"{b:,}", f"{d:+.4f}", _p_text(p), f"[{low:+.4f}, {high:+.4f}]"]
            for name, a, b, d, p, low, high in zip(
                self.names, self.only_a, self.only_b, self.difference, self.p_value, self.low, self.high, strict=True
            )
        ]
        head = ["outcome", "only A", "only B", "P(A) - P(B)", "p-value", f"{100 * self.level:g} %"]
        return as_text(f"{self.trials:,} trials, {len(self.flipped):,} flipped", head, rows)


def _p_text(p: float) -> str:
    return f"{p:.2g}" if p > 0.0 else "< 1e-300"  # smaller than any double


def compare(a: TrialOutcomes, b: TrialOutcomes, *, level: float = 0.95) -> Comparison:
    """Compare two studies of the same trials.

    Parameters
    ----------
    a, b : StudyResult
        Two studies with the same seed, number of trials and varied inputs, of scenarios that may differ in everything
        else but the number of defenders.
    level : float
        Confidence level of each interval.

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
    return paired(a.kind, a.defender, b.kind, b.defender, a.scenario.n, level=level)


def paired(
    kind_a: ArrayLike, defender_a: ArrayLike, kind_b: ArrayLike, defender_b: ArrayLike, n: int, *, level: float = 0.95
) -> Comparison:
    """Compare the outcomes of the same M trials under two conditions, as `compare` does.

    Parameters
    ----------
    kind_a, defender_a, kind_b, defender_b : array_like of int, shape (M,)
        Outcomes under A and under B, as in `tadcore.Batch`.
    n : int
        Number of defenders.
    level : float
        Confidence level of each interval.

    Returns
    -------
    Comparison
        Paired differences A - B.

    Raises
    ------
    ScenarioError
        The arrays do not fit together.
    """
    from scipy.stats import binomtest

    as_level(level)
    code_a, who_a = as_outcomes(kind_a, defender_a, n)
    code_b, who_b = as_outcomes(kind_b, defender_b, n)
    if code_a.shape != code_b.shape:
        raise ScenarioError("kind_b", f"{len(code_b)} trials", f"{len(code_a)} trials, as in A")
    only_a, only_b = discordant(indicators(code_a, who_a, n), indicators(code_b, who_b, n))
    trials = len(code_a)
    low, high = difference_interval(only_a, only_b, trials, level=level)
    p_values = [binomtest(int(x), int(x + y)).pvalue if x + y else 1.0 for x, y in zip(only_a, only_b, strict=True)]
    transitions = np.zeros((len(KINDS), len(KINDS)), dtype=np.int64)
    np.add.at(transitions, (code_a, code_b), 1)
    both = (code_a == OutcomeKind.INTERCEPTED) & (code_b == OutcomeKind.INTERCEPTED)
    return Comparison(
        names=outcome_names(n),
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
    )


def discordant(a: NDArray[np.bool_], b: NDArray[np.bool_]) -> tuple[Integers, Integers]:
    """How many trials (last axis) are in A only and in B only."""
    return np.count_nonzero(a & ~b, axis=-1).astype(np.int64), np.count_nonzero(b & ~a, axis=-1).astype(np.int64)


def difference_interval(
    only_a: ArrayLike, only_b: ArrayLike, trials: int, *, level: float = 0.95
) -> tuple[Floats, Floats]:
    """Tango's score interval for P_A - P_B from paired trials, for each of many pairs of counts.

    Parameters
    ----------
    only_a, only_b : array_like of int
        b and c: trials that end so in A only and in B only.
    trials : int
        M, at least b + c.
    level : float
        Confidence level of each interval.

    Returns
    -------
    low, high : ndarray
        Of the shape of ``only_a``.

    Raises
    ------
    ScenarioError
        A pair of counts is impossible.
    """
    from scipy.stats import norm

    z = float(norm.isf((1.0 - as_level(level)) / 2.0))
    first, second = np.broadcast_arrays(np.asarray(only_a, dtype=np.int64), np.asarray(only_b, dtype=np.int64))
    impossible = (np.minimum(first, second) < 0) | (first + second > trials)
    refuse_where("only_a", first, impossible, f"at least 0, as only_b, and together with it at most {trials}")
    pairs = zip(first.ravel().tolist(), second.ravel().tolist(), strict=True)
    ends = np.array([(-_upper_end(c, b, trials, z), _upper_end(b, c, trials, z)) for b, c in pairs])
    low, high = (column.reshape(first.shape) for column in ends.reshape(-1, 2).T)
    return low, high


def _upper_end(b: int, c: int, trials: int, z: float) -> float:
    """The largest Δ that the score test does not reject; the smallest is that of (c, b), negated."""
    from scipy.optimize import brentq

    def beyond(delta: float) -> float:
        """Squared distance from Δ minus z² times its variance under Δ, per trial: positive outside the interval."""
        linear = -(b + c) / trials + (2.0 - (b - c) / trials) * delta
        constant = -(c / trials) * delta * (1.0 - delta)
        root = math.sqrt(max(linear * linear - 8.0 * constant, 0.0))
        q = (root - linear) / 4.0 if linear <= 0.0 else -2.0 * constant / (root + linear)
        variance = 2.0 * q + delta * (1.0 - delta)
        return trials * ((b - c) / trials - delta) ** 2 - z * z * variance

    start = (b - c) / trials + _APART
    if start >= 1.0:
        return 1.0
    found: float = brentq(beyond, start, 1.0, xtol=1e-15, rtol=1e-13)
    return found
