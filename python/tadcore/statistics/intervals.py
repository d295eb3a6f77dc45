"""Outcome probabilities with their intervals.

For a count s out of M independent trials the estimate of the probability p is s / M. Two intervals:

- ``"wilson"``: all p at which the score test does not reject, |s/M - p| ≤ z √(p (1 - p) / M); its coverage is near the
  level on average over p (Wilson 1927; Brown, Cai and DasGupta 2001).
- ``"exact"``: all p that neither one-sided binomial test rejects at half of 1 - level; its coverage is never below the
  level (Clopper and Pearson 1934).

Each interval holds by itself. For all outcomes at once, or while trials come in, see `HalfWidth`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from tadcore._shared.arrays import Floats, Integers, as_index, refuse_where
from tadcore._shared.text import as_text
from tadcore.errors import ScenarioError

from .outcomes import as_level, outcome_counts, outcome_names

if TYPE_CHECKING:
    import pandas as pd

Method = Literal["wilson", "exact"]


@dataclass(frozen=True, eq=False, repr=False)
class OutcomeProbabilities:
    """Outcome probabilities with their intervals; made by `probabilities`.

    Attributes
    ----------
    names : tuple of str
        ``"timeout"``, ``"captured"``, ``"intercepted"``, then ``"d1"`` … ``"dn"``: interception by that defender.
    count : ndarray of int, shape (3 + n,)
        Trials that ended so.
    estimate, low, high : ndarray, shape (3 + n,)
        The share of the trials, and the ends of its interval.
    trials : int
        M.
    level : float
        Confidence level of each interval by itself.
    method : {"wilson", "exact"}
        How the intervals were made.
    """

    names: tuple[str, ...]
    count: Integers
    estimate: Floats
    low: Floats
    high: Floats
    trials: int
    level: float
    method: Method

    def __getitem__(self, name: str) -> tuple[float, float, float]:
        """Estimate, low and high of one outcome."""
        i = self.names.index(name)
        return float(self.estimate[i]), float(self.low[i]), float(self.high[i])

    def to_pandas(self) -> pd.DataFrame:
        """A table with one row for each outcome."""
        import pandas as pd

        columns = {"count": self.count, "estimate": self.estimate, "low": self.low, "high": self.high}
        return pd.DataFrame(columns, index=pd.Index(self.names, name="outcome"))

    def __repr__(self) -> str:
        rows = [
            [name, f"{count:,}", f"{estimate:.4f}", f"[{low:.4f}, {high:.4f}]"]
            for name, count, estimate, low, high in zip(
                self.names, self.count, self.estimate, self.low, self.high, strict=True
            )
        ]
        head = ["outcome", "count", "estimate", f"{100 * self.level:g} % ({self.method})"]
        return as_text(f"{self.trials:,} trials", head, rows)


def probabilities(
    kind: ArrayLike, defender: ArrayLike, n: int, *, level: float = 0.95, method: Method = "wilson"
) -> OutcomeProbabilities:
    """Estimate the probability of each outcome.

    Parameters
    ----------
    kind, defender : array_like of int, shape (M,)
        Outcomes of M independent trials, as in `tadcore.Batch`.
    n : int
        Number of defenders.
    level : float
        Confidence level of each interval.
    method : {"wilson", "exact"}
        Wilson's score interval, or that of Clopper and Pearson.

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
    counts = outcome_counts(kind, defender, n)
    trials = np.size(np.asarray(kind))
    count = np.array(list(counts.values()), dtype=np.int64)
    low, high = proportion_interval(count, trials, level=level, method=method)
    return OutcomeProbabilities(outcome_names(n), count, count / trials, low, high, trials, float(level), method)


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
        Confidence level of each interval.
    method : {"wilson", "exact"}
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
    from scipy.stats import binomtest

    confidence = as_level(level)
    if method not in ("wilson", "exact"):
        raise ScenarioError("method", method, 'one of "wilson" and "exact"')
    total = as_index("trials", trials, 2**53, least=1)
    counts = np.asarray(count, dtype=np.int64)
    refuse_where("count", counts, (counts < 0) | (counts > total), f"in [0, {total}]")
    distinct, where = np.unique(counts, return_inverse=True)
    ends = np.array([binomtest(int(s), total).proportion_ci(confidence, method=method) for s in distinct])
    low, high = (column[where].reshape(counts.shape) for column in ends.reshape(-1, 2).T)
    return low, high
