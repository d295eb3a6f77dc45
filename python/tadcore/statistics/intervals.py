"""Outcome probabilities with their intervals.

For a count s out of M independent trials the estimate of the probability p is s / M. Three intervals:

- ``"wilson"``: all p at which the score test does not reject, |s/M - p| ≤ z √(p (1 - p) / M). Its coverage is near the
  level on average over p, not for every p: at 95 % it falls to about 83 % where M p is near 0.18, and further where the
  level is higher (Wilson 1927; Brown, Cai and DasGupta 2001).
- ``"exact"``: all p that neither one-sided binomial test rejects at half of 1 - level; its coverage is never below the
  level (Clopper and Pearson 1934).
- ``"sequence"``: a confidence sequence (`mixture_interval`). It holds at all numbers of trials at once, so also where a
  rule, or somebody who looked, decided when to stop. 1 - level is split between the three kinds of outcome, whose
  intervals hold together; each defender's has the same share of it, and holds by itself.

The first two hold each by itself, and at a number of trials that was fixed beforehand.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from tadcore._shared.arrays import Floats, Integers, as_index, refuse_where
from tadcore._shared.html import as_html
from tadcore._shared.shares import estimate, percent
from tadcore._shared.text import as_text
from tadcore.errors import ScenarioError

from .outcomes import KINDS, MOST_TRIALS, TrialOutcomes, as_counts, as_level, diverged_of, excluding, outcome_counts
from .sequences import mixture_interval
from .stopping import level_of, stopping_of
from .tally import Tally

if TYPE_CHECKING:
    import pandas as pd

Method = Literal["wilson", "exact", "sequence"]
METHODS: tuple[Method, ...] = ("wilson", "exact", "sequence")


@dataclass(frozen=True, eq=False, repr=False)
class OutcomeProbabilities:
    """Outcome probabilities with their intervals; made by `probabilities`.

    Attributes
    ----------
    names : tuple of str
        ``"timeout"``, ``"captured"``, ``"intercepted"``, then ``"d1"`` … ``"dn"``: interception by that defender;
        last ``"diverged"``, where some trials did.
    count : ndarray of int, shape (3 + n,) or (4 + n,)
        Trials that ended so.
    estimate, low, high : ndarray, shape (3 + n,) or (4 + n,)
        The share of the trials, and the ends of its interval.
    trials : int
        M.
    level : float
        Confidence level, of each interval by itself, or with ``"sequence"`` of the three kinds of outcome together.
    method : {"wilson", "exact", "sequence"}
        How the intervals were made.
    rule : str
        The rule that decided how many trials there are, or that their design is not random; empty for independent
        trials of which the number was fixed beforehand.
    """

    names: tuple[str, ...]
    count: Integers
    estimate: Floats
    low: Floats
    high: Floats
    trials: int
    level: float
    method: Method
    rule: str = ""

    def __getitem__(self, name: str) -> tuple[float, float, float]:
        """Estimate, low and high of one outcome."""
        i = self.names.index(name)
        return float(self.estimate[i]), float(self.low[i]), float(self.high[i])

    def to_pandas(self) -> pd.DataFrame:
        """A table with one row for each outcome."""
        import pandas as pd

        columns = {"count": self.count, "estimate": self.estimate, "low": self.low, "high": self.high}
        return pd.DataFrame(columns, index=pd.Index(self.names, name="outcome"))

    def rows(self) -> list[tuple[str, str, str, str]]:
        """Name, count, estimate and interval of each outcome as text, with the digits that the interval supports."""
        columns = zip(self.names, self.count, self.estimate, self.low, self.high, strict=True)
        return [(name, f"{count:,}", *estimate(p, low, high)) for name, count, p, low, high in columns]

    def _table(self) -> tuple[str, list[str], list[tuple[str, str, str, str]]]:
        head = ["outcome", "count", "estimate", f"{percent(self.level)} ({self.method})"]
        return f"{self.trials:,} trials{f', {self.rule}' if self.rule else ''}", head, self.rows()

    def __repr__(self) -> str:
        return as_text(*self._table())

    def _repr_html_(self) -> str:
        return as_html(*self._table())


def probabilities(
    kind: ArrayLike,
    defender: ArrayLike,
    n: int,
    *,
    diverged: ArrayLike | None = None,
    level: float = 0.95,
    method: Method = "wilson",
    rule: str = "",
) -> OutcomeProbabilities:
    """Estimate the probability of each outcome.

    Parameters
    ----------
    kind, defender : array_like of int, shape (M,)
        Outcomes of M independent trials, as in `tadcore.Batch`.
    n : int
        Number of defenders.
    diverged : array_like of bool, shape (M,), optional
        Which trials diverged; these are counted apart, in a last row ``"diverged"`` where there are any.
    level : float
        Confidence level.
    method : {"wilson", "exact", "sequence"}
        Wilson's score interval, that of Clopper and Pearson, or a confidence sequence, the one that holds where the
        number of trials was not fixed beforehand.
    rule : str
        What decided the number of trials or their design, to be printed with them.

    Returns
    -------
    OutcomeProbabilities
        A table; it prints as one.

    Raises
    ------
    ScenarioError
        The arrays do not fit together or hold no trial, or an option is not one.

    Examples
    --------
    >>> from tadcore.statistics import probabilities
    >>> probabilities([2, 2, 1, 2], [0, 0, -1, 1], 2)
    4 trials
    outcome      count  estimate  95 % (wilson)
    timeout          0    0.0000  [0.0000, 0.4899]
    captured         1    0.2500  [0.0456, 0.6994]
    intercepted      3    0.7500  [0.3006, 0.9544]
    d1               2    0.5000  [0.1500, 0.8500]
    d2               1    0.2500  [0.0456, 0.6994]
    """
    return _estimated(outcome_counts(kind, defender, n, diverged), level, method, rule)


def _estimated(counts: dict[str, int], level: float, method: Method, rule: str) -> OutcomeProbabilities:
    """The probabilities from the counts of every outcome."""
    names = tuple(counts)
    trials = sum(counts[names[i]] for i in excluding(names))
    count = np.array(list(counts.values()), dtype=np.int64)
    error = (1.0 - as_level(level)) / (len(KINDS) if method == "sequence" else 1)
    low, high = ends(count, trials, error, method)
    return OutcomeProbabilities(names, count, count / trials, low, high, trials, float(level), method, rule)


def probabilities_of(
    result: TrialOutcomes, *, level: float | None = None, method: Method | None = None
) -> OutcomeProbabilities:
    """Estimate the probability of each outcome of a study, as its number of trials was decided.

    Parameters
    ----------
    result : StudyResult
        The trials.
    level : float, optional
        Confidence level; 0.95, or that of the rule that was asked when to stop.
    method : {"wilson", "exact", "sequence"}, optional
        As in `probabilities`; by default Wilson's interval where the number of trials was fixed beforehand, and the
        confidence sequence where a rule was asked when to stop.

    Returns
    -------
    OutcomeProbabilities
        A table that names the rule.

    Raises
    ------
    ScenarioError
        There is no trial, an option breaks a rule, or ``method`` needs a number of trials that no rule decided.
    """
    stopping = stopping_of(result)
    if stopping is not None and method not in (None, "sequence"):
        raise ScenarioError("method", method, f'left out or "sequence": the study was {stopping}')
    by_default: Method = "wilson" if stopping is None else "sequence"
    design = getattr(getattr(result, "study", None), "design", "random")
    even = "" if design == "random" else f"{design} design: intervals are those of independent draws"
    tally = getattr(result, "tally", None)
    if isinstance(tally, Tally):
        counts = tally.outcomes()
    else:
        counts = outcome_counts(result.kind, result.defender, result.scenario.n, diverged_of(result))
    decided = even if stopping is None else str(stopping)
    return _estimated(counts, level_of(stopping, level), by_default if method is None else method, decided)


def proportion_interval(
    count: ArrayLike, trials: int, *, level: float = 0.95, method: Method = "wilson"
) -> tuple[Floats, Floats]:
    """Ends of the interval for a probability, for each of many counts out of the same number of trials.

    Parameters
    ----------
    count : array_like of int
        Counts, each in [0, trials].
    trials : int
        M, at least 1.
    level : float
        Confidence level of each interval by itself.
    method : {"wilson", "exact", "sequence"}
        As in `probabilities`.

    Returns
    -------
    low, high : ndarray
        Of the shape of ``count``.

    Raises
    ------
    ScenarioError
        A count or an option breaks a rule.
    """
    total = as_index("trials", trials, MOST_TRIALS, least=1)
    counts = as_counts("count", count)
    refuse_where("count", counts, (counts < 0) | (counts > total), f"in [0, {total}]")
    return ends(counts, total, 1.0 - as_level(level), method)


def ends(count: Integers, trials: int, error: float, method: Method) -> tuple[Floats, Floats]:
    """Ends of intervals that each miss with probability ``error``, which may be smaller than any 1 - level."""
    from scipy.stats import norm

    if method not in METHODS:
        raise ScenarioError("method", method, f"one of {', '.join(METHODS)}")
    s = count.astype(np.float64)
    if method != "wilson":
        interval = mixture_interval if method == "sequence" else _tails
        distinct, where = np.unique(count, return_inverse=True)
        found = np.array([interval(one, trials, error) for one in distinct.tolist()]).reshape(-1, 2)
        return found[where, 0].reshape(s.shape), found[where, 1].reshape(s.shape)
    z = float(norm.isf(error / 2.0))
    rest = trials - s
    few = 2.0 * s <= trials
    low = np.where(few, _smaller(s, trials, z), 1.0 - _larger(rest, trials, z))
    return low, np.where(few, _larger(s, trials, z), 1.0 - _smaller(rest, trials, z))


def band(count: Integers, trials: int, error: float, many: int, method: Method) -> tuple[Floats, Floats]:
    """Intervals of which ``many`` hold together: each has its share of the error (Bonferroni), whatever they share."""
    together = 1.0 - error / many
    # bitwise that of `proportion_interval` at this level, where there is such a level in double precision
    return ends(count, trials, 1.0 - together if together < 1.0 else error / many, method)


def _smaller(s: Floats, trials: int, z: float) -> Floats:
    """The smaller root of (s/M - p)² = z² p (1 - p) / M, its numerator made rational: nothing cancels near 0."""
    found = (s * s / trials) / np.maximum(s + _spread(s, trials, z), np.finfo(float).tiny)
    return np.minimum(found, s / trials)


def _larger(s: Floats, trials: int, z: float) -> Floats:
    """The larger root."""
    return np.maximum((s + _spread(s, trials, z)) / (trials + z * z), s / trials)


def _spread(s: Floats, trials: int, z: float) -> Floats:
    return z * np.sqrt(s * ((trials - s) / trials) + z * z / 4.0) + z * z / 2.0


def _tails(count: int, trials: int, error: float) -> tuple[float, float]:
    """Where the binomial tails beyond a count are half of the error (Clopper and Pearson).

    A root of the tail itself: the inverse of the beta distribution in SciPy is wrong for many counts of 10⁹ trials, by
    a factor of two for 1,000 of them.
    """
    from scipy.optimize import brentq
    from scipy.special import betainc, betaincc

    s, rest, half = float(count), float(trials - count), error / 2.0
    low, high = 0.0, 1.0
    precise = {"xtol": 1e-300, "rtol": 1e-13, "maxiter": 5_000}
    if count > 0:
        low = brentq(lambda p: betainc(s, rest + 1.0, p) - half, 0.0, s / trials, **precise)
    if rest > 0:
        high = brentq(lambda p: betaincc(s + 1.0, rest, p) - half, s / trials, 1.0, **precise)
    return low, high
