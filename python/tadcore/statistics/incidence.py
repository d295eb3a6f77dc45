r"""When games end, and how: cumulative incidence of each outcome.

The cumulative incidence of outcome j is :math:`F_j(t) = P(\text{the game has ended by } t, \text{ in outcome } j)`.
Every trial is followed to its end or to T, so nothing is censored and the share of trials that ended so by t is the
estimate, no product-limit formula needed. Trials end on the grid t_k = k T / K, so most share their instant with
others: ends are counted by k, and ties cost nothing.

**Bands.** Put T_j = t where a trial ended in outcome j, T_j = ∞ elsewhere: F_j is the distribution function of T_j, and
its estimate the empirical one. For a continuous law, :math:`\sup_t |\hat F - F|` has the Kolmogorov distribution, whose
exact quantile at M trials is the half-width here. A law with atoms, as on a grid, is that of a function of a
continuous one: its supremum runs over fewer places, so it is stochastically smaller and the bands are conservative
(Kolmogorov 1933; Noether 1963). They hold at all t at once, for one outcome; with ``jointly`` for all outcomes at once,
1 - level split evenly between them.

Where a rule was asked when to stop, after chunks of trials, the bands have to hold at whichever look it stopped: the
j-th look has the share 1 / (j (j + 1)) of 1 - level. These shares sum to 1, so the bands hold at all looks at once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from tadcore import _core
from tadcore._shared.arrays import Floats, Integers, as_amount, as_index
from tadcore._shared.html import as_html
from tadcore._shared.shares import decimals, percent, share
from tadcore._shared.text import one_of
from tadcore.errors import ScenarioError

from .outcomes import KINDS, TrialOutcomes, as_level, diverged_of, excluding, indicators, outcome_names
from .reached import ReachedTime, reached
from .stopping import level_of, stopping_of
from .tally import Tally, instants

if TYPE_CHECKING:
    import pandas as pd

_RAREST = 1e-5  # below this the quantiles of SciPy are too small: at 1e-16 the law exceeds them five times as often
_MOST_ENTRIES = 2**28  # of a curve for every outcome: 2 GiB each of the estimate and of both ends of its band


@dataclass(frozen=True, eq=False, repr=False)
class Incidence:
    """Cumulative incidence of every outcome on the grid; made by `incidence`.

    Attributes
    ----------
    times : ndarray, shape (K + 1,)
        The grid t_k = k T / K.
    names : tuple of str
        ``"timeout"``, ``"captured"``, ``"intercepted"``, then ``"d1"`` … ``"dn"``; last ``"diverged"``, where some
        trials did: they end in no other outcome, and are counted at the instants of their ends.
    estimate, low, high : ndarray, shape (3 + n, K + 1) or (4 + n, K + 1)
        F_j and its band, simultaneous over time.
    trials : int
        M.
    level : float
        Confidence level of the bands.
    half_width : float
        Half the width of a band before it is cut to [0, 1].
    jointly : bool
        Whether the level holds for all outcomes at once.
    rule : str
        The rule that was asked when to stop; empty where the number of trials was fixed beforehand.
    """

    times: Floats
    names: tuple[str, ...]
    estimate: Floats
    low: Floats
    high: Floats
    trials: int
    level: float
    half_width: float
    jointly: bool
    rule: str = ""

    @property
    def running(self) -> Floats:
        """Share of the trials that have not ended at or before each instant, shape (K + 1,)."""
        return np.asarray(1.0 - self.estimate[excluding(self.names)].sum(axis=0))

    def __getitem__(self, name: str) -> Floats:
        """The curve of one outcome, shape (K + 1,)."""
        return np.asarray(self.estimate[self.names.index(name)])

    def reached(self, at_least: float, outcome: str = "intercepted") -> ReachedTime:
        """By when a share of all trials has ended in an outcome, with an interval from the band.

        Parameters
        ----------
        at_least : float
            The share, in (0, 1).
        outcome : str
            One of `names`.

        Returns
        -------
        ReachedTime
            The instant and what the true one lies between, or that there is none until T.

        Raises
        ------
        ScenarioError
            No such share or outcome.
        """
        row = self.names.index(one_of("outcome", outcome, self.names))
        return reached(self.times, (self.estimate[row], self.low[row], self.high[row]), outcome, at_least, self.level)

    def to_pandas(self) -> pd.DataFrame:
        """A table with one row for each instant; columns (outcome, "estimate" | "low" | "high")."""
        import pandas as pd

        parts = {"estimate": self.estimate, "low": self.low, "high": self.high}
        columns = {(name, part): rows[i] for i, name in enumerate(self.names) for part, rows in parts.items()}
        return pd.DataFrame(columns, index=pd.Index(self.times, name="time"))

    def __repr__(self) -> str:
        places = decimals(0.0, 2.0 * self.half_width)
        ends = ", ".join(f"{name} {share(self.estimate[i, -1], places)}" for i, name in enumerate(self.names))
        by = f"; {self.rule}" if self.rule else ""
        bands = f"{percent(self.level)} bands ± {share(self.half_width, places)}"
        return f"Incidence({self.trials:,} trials up to t = {self.times[-1]:g}: {ends}; {bands}{by})"

    def _repr_html_(self) -> str:
        title = f"{self.trials:,} trials{f', {self.rule}' if self.rule else ''}: share that has ended by t"
        at = np.linspace(0, len(self.times) - 1, min(len(self.times), 9)).round().astype(int)[1:]
        places = decimals(0.0, 2.0 * self.half_width)
        head = ["outcome", *(f"t = {self.times[k]:.4g}" for k in at), f"{percent(self.level)} bands"]
        rows = [
            [name, *(share(float(self.estimate[i, k]), places) for k in at), f"± {share(self.half_width, places)}"]
            for i, name in enumerate(self.names)
        ]
        return as_html(title, head, rows)


def incidence(
    kind: ArrayLike,
    defender: ArrayLike,
    time: ArrayLike,
    *,
    horizon: float,
    step: float,
    n: int,
    level: float = 0.95,
    jointly: bool = False,
    looks: int = 0,
    between: bool = False,
    diverged: ArrayLike | None = None,
) -> Incidence:
    """Estimate the cumulative incidence of each outcome.

    Parameters
    ----------
    kind, defender : array_like of int, shape (M,)
        Outcomes of M independent trials, as in `tadcore.Batch`.
    time : array_like of float, shape (M,)
        Termination times, multiples of δ.
    horizon, step : float
        T and δ.
    n : int
        Number of defenders.
    level : float
        Confidence level of the bands.
    jointly : bool
        Whether the bands of all outcomes hold at once, or each by itself.
    looks : int
        How often a rule was asked whether to stop, the last time included; 0 where the number of trials was fixed
        beforehand.
    between : bool
        Whether games may end between instants, as with ``termination="continuous"``. A curve then counts at each
        instant what has ended by then.
    diverged : array_like of bool, shape (M,), optional
        Which trials diverged; these are counted apart, in a last row ``"diverged"`` where there are any.

    Returns
    -------
    Incidence
        Curves on the grid, one for each outcome.

    Raises
    ------
    ScenarioError
        A time is off the grid or beyond T, or the arrays do not fit together.

    Examples
    --------
    >>> from tadcore.statistics import incidence
    >>> found = incidence([2, 2, 1], [0, 0, -1], [0.5, 0.5, 1.0], horizon=1.0, step=0.25, n=1)
    >>> found["intercepted"].round(3)
    array([0.   , 0.   , 0.667, 0.667, 0.667])
    """
    events = indicators(kind, defender, n, diverged)
    names = outcome_names(n, diverged=diverged is not None)
    times = _grid(as_amount("horizon", horizon), step, n)
    steps = len(times) - 1
    at = instants(time, events.shape[1], horizon, steps, between=between)
    ended = np.array([np.bincount(at[event], minlength=steps + 1) for event in events])
    return _curves(names, times, ended, as_level(level), jointly=jointly, looks=as_index("looks", looks, 2**32))


def _curves(
    names: tuple[str, ...], times: Floats, ended: Integers, level: float, *, jointly: bool, looks: int
) -> Incidence:
    """The curves from the number of trials that ended in each outcome at each step."""
    trials = int(ended[excluding(names)].sum())
    estimate = ended.cumsum(axis=1) / trials
    error = (1.0 - level) / (len(names) if jointly else 1) / (looks * (looks + 1) if looks else 1)
    half = _half_width(error, trials)
    return Incidence(
        times=times,
        names=names,
        estimate=estimate,
        low=np.maximum(estimate - half, 0.0),
        high=np.minimum(estimate + half, 1.0),
        trials=trials,
        level=level,
        half_width=half,
        jointly=jointly,
    )


def incidence_of(result: TrialOutcomes, *, level: float | None = None, jointly: bool = False) -> Incidence:
    """Estimate the cumulative incidence of each outcome of a study, as its number of trials was decided.

    Parameters
    ----------
    result : StudyResult
        The trials.
    level : float, optional
        Confidence level of the bands; 0.95, or that of the rule that was asked when to stop.
    jointly : bool
        Whether the bands of all outcomes hold at once, or each by itself.

    Returns
    -------
    Incidence
        Curves on the grid, one for each outcome.

    Raises
    ------
    ScenarioError
        There is no trial, or an option breaks a rule.
    """
    sc, stopping = result.scenario, stopping_of(result)
    confidence, looks = level_of(stopping, level), 0 if stopping is None else stopping.looks(result.trials)
    tally = getattr(result, "tally", None)
    if isinstance(tally, Tally):
        ended, times = tally.ended(), _grid(sc.horizon, sc.step, sc.n)
        found = _curves(tally.names(), times, ended, confidence, jointly=jointly, looks=looks)
    else:
        found = incidence(
            result.kind,
            result.defender,
            result.time,
            horizon=sc.horizon,
            step=sc.step,
            n=sc.n,
            level=confidence,
            jointly=jointly,
            looks=looks,
            between=getattr(result, "termination", "sampled") == "continuous",
            diverged=diverged_of(result),
        )
    return found if stopping is None else replace(found, rule=str(stopping))


def _half_width(error: float, trials: int) -> float:
    """The quantile of Kolmogorov's law at M trials; where SciPy has none so far out, Massart's bound on it."""
    from scipy.stats import kstwo

    if error < _RAREST:
        return min(math.sqrt(math.log(2.0 / error) / (2.0 * trials)), 1.0)
    return float(kstwo.isf(error, trials))


def _grid(horizon: float, step: float, n: int) -> Floats:
    """The instants of the game itself; T over the whole number of steps, as δ may differ from it in the last digits."""
    number = isinstance(step, int | float | np.integer | np.floating) and not isinstance(step, bool)
    if not (number and step > 0.0 and horizon > 0.0 and np.isfinite(horizon / step)):
        raise ScenarioError("step", step, f"a positive divisor of the horizon ({horizon!r})")
    most = _MOST_ENTRIES // (len(KINDS) + n)
    if horizon / step > most:
        raise ScenarioError("step", step, f"large enough for at most {most:,} instants up to {horizon!r}")
    return _core.grid_times(horizon, step)
