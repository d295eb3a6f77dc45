r"""How much of what is uncertain is the start's: the variance of an outcome, split between starts and failures.

Let Y be whether a game ends in an outcome, of a random start X and of random failures and disturbances. Its variance is

.. math:: \operatorname{Var} Y = \operatorname{Var}\,E[Y \mid X] + E \operatorname{Var}[Y \mid X],

and two trials Y, Y' from one start, drawn apart, have Cov(Y, Y') = Var E[Y | X]. So the share of the start is the
intraclass correlation ρ of pairs, here estimated from M pairs: with p the share of all 2M trials and D that of pairs
that differ, ρ = 1 - D / (2 p (1 - p)). Its interval has every ρ that Pearson's χ² test of the three counts (both end
so, one does, none) does not reject at this p (Donner and Eliasziw, Statistics in Medicine 11, 1992).

Where a start costs c times as much as a trial, m trials from each start estimate P(Y) best for a given effort at
m = √(c (1 - ρ) / ρ): with c = 1 and ρ ≥ ½ a start deserves one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tadcore._shared.arrays import as_amount, as_index
from tadcore._shared.shares import estimate, percent
from tadcore.errors import ScenarioError

from .outcomes import MOST_TRIALS, as_level


@dataclass(frozen=True, repr=False)
class StartShare:
    """The share of an outcome's variance that is the start's; made by `tadcore.analysis.start_share`.

    Attributes
    ----------
    outcome : str
        Which outcome.
    probability : float
        P(outcome) over starts, failures and disturbances, from both trials of each start.
    share, low, high : float
        ρ and its interval; NaN and [0, 1] where all trials, or none, ended so.
    both, one, none : int
        Starts of which both trials ended so, one did, or none.
    level : float
        Confidence level.
    """

    outcome: str
    probability: float
    share: float
    low: float
    high: float
    both: int
    one: int
    none: int
    level: float

    @property
    def starts(self) -> int:
        """M, of two trials each."""
        return self.both + self.one + self.none

    def trials_per_start(self, cost: float = 1.0) -> float:
        """How many trials a start deserves: √(c (1 - ρ) / ρ), at least 1.

        Parameters
        ----------
        cost : float
            c, the cost of a start over that of a trial.

        Returns
        -------
        float
            inf where nothing is the start's; NaN where the share is unknown.
        """
        ratio = as_amount("cost", cost)
        if math.isnan(self.share):
            return math.nan
        return max(1.0, math.sqrt(ratio * (1.0 - self.share) / self.share)) if self.share > 0.0 else math.inf

    def __repr__(self) -> str:
        share, interval = estimate(self.share, self.low, self.high)
        return (
            f"StartShare({share} {interval} of the variance of P({self.outcome}) = {self.probability:.4g} is the "
            f"start's, {percent(self.level)}; {self.starts:,} starts, two trials each)"
        )


def start_share_of(both: int, one: int, none: int, *, outcome: str = "", level: float = 0.95) -> StartShare:
    """The share of the start from counts of pairs.

    Parameters
    ----------
    both, one, none : int
        Starts of which both trials ended in the outcome, exactly one did, or none.
    outcome : str
        Its name.
    level : float
        Confidence level.

    Returns
    -------
    StartShare
        The estimate, clipped at 0, and its interval.

    Raises
    ------
    ScenarioError
        A count is none, there are no starts, or the level is not in (0, 1).
    """
    both, one, none = (as_index(s, n, MOST_TRIALS) for s, n in (("both", both), ("one", one), ("none", none)))
    counts = (both, one, none)
    confidence, starts = as_level(level), sum(counts)
    if starts == 0:
        raise ScenarioError("both", both, "a count of at least one start")
    p = (2 * counts[0] + counts[1]) / (2 * starts)
    if p in (0.0, 1.0):
        return StartShare(outcome, p, math.nan, 0.0, 1.0, both, one, none, confidence)
    spread = p * (1.0 - p)
    share = 1.0 - counts[1] / (2.0 * spread * starts)
    from scipy.optimize import brentq
    from scipy.special import chdtri

    limit = float(chdtri(1, 1.0 - confidence))
    observed = np.array(counts, dtype=np.float64)

    def beyond(rho: float) -> float:
        law = np.array([p**2 + rho * spread, 2.0 * spread * (1.0 - rho), (1.0 - p) ** 2 + rho * spread]) * starts
        with np.errstate(divide="ignore", invalid="ignore"):
            terms = np.where((law == 0.0) & (observed == 0.0), 0.0, (observed - law) ** 2 / law)
        return float(min(terms.sum(), 1e300)) - limit

    least = max(-p / (1.0 - p), -(1.0 - p) / p)  # of any pair; that of a start is not below 0
    low = brentq(beyond, least, share) if beyond(least) > 0.0 else least
    high = brentq(beyond, share, 1.0) if beyond(1.0) > 0.0 else 1.0
    middle, left, right = (min(max(float(end), 0.0), 1.0) for end in (share, low, high))
    return StartShare(outcome, p, middle, left, right, both, one, none, confidence)
