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
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from tadcore import _core
from tadcore._shared.arrays import Floats, as_real, refuse_where
from tadcore.errors import ScenarioError
from tadcore.game.outcome import OutcomeKind

from .outcomes import KINDS, as_level, as_outcomes, outcome_names

if TYPE_CHECKING:
    import pandas as pd

_OFF_GRID = 1e-6  # steps


@dataclass(frozen=True, eq=False, repr=False)
class Incidence:
    """Cumulative incidence of every outcome on the grid; made by `incidence`.

    Attributes
    ----------
    times : ndarray, shape (K + 1,)
        The grid t_k = k T / K.
    names : tuple of str
        ``"timeout"``, ``"captured"``, ``"intercepted"``, then ``"d1"`` … ``"dn"``.
    estimate, low, high : ndarray, shape (3 + n, K + 1)
        F_j and its band, simultaneous over time.
    trials : int
        M.
    level : float
        Confidence level of the bands.
    half_width : float
        Half the width of a band before it is cut to [0, 1].
    jointly : bool
        Whether the level holds for all outcomes at once.
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

    @property
    def running(self) -> Floats:
        """Share of the trials that have not ended at or before each instant, shape (K + 1,)."""
        return np.asarray(1.0 - self.estimate[: len(KINDS)].sum(axis=0))

    def __getitem__(self, name: str) -> Floats:
        """The curve of one outcome, shape (K + 1,)."""
        return np.asarray(self.estimate[self.names.index(name)])

    def to_pandas(self) -> pd.DataFrame:
        """A table with one row for each instant; columns (outcome, "estimate" | "low" | "high")."""
        import pandas as pd

        parts = {"estimate": self.estimate, "low": self.low, "high": self.high}
        columns = {(name, part): rows[i] for i, name in enumerate(self.names) for part, rows in parts.items()}
        return pd.DataFrame(columns, index=pd.Index(self.times, name="time"))

    def __repr__(self) -> str:
        ends = ", ".join(f"{name} {self.estimate[i, -1]:.4f}" for i, name in enumerate(self.names))
        return f"Incidence({self.trials:,} trials up to t = {self.times[-1]:g}: {ends}; bands ± {self.half_width:.4f})"


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
    from scipy.stats import kstwo

    codes, who = as_outcomes(kind, defender, n)
    confidence = as_level(level)
    times = _grid(horizon, step)
    steps = len(times) - 1
    at = _instants(time, len(codes), horizon, steps)
    names = outcome_names(n)
    ended = np.zeros((len(names), steps + 1), dtype=np.int64)
    np.add.at(ended, (codes, at), 1)
    intercepted = codes == OutcomeKind.INTERCEPTED
    np.add.at(ended, (who[intercepted] + len(KINDS), at[intercepted]), 1)
    estimate = ended.cumsum(axis=1) / len(codes)
    error = (1.0 - confidence) / (len(names) if jointly else 1)
    half = float(kstwo.isf(error, len(codes)))
    return Incidence(
        times=times,
        names=names,
        estimate=estimate,
        low=np.maximum(estimate - half, 0.0),
        high=np.minimum(estimate + half, 1.0),
        trials=len(codes),
        level=confidence,
        half_width=half,
        jointly=jointly,
    )


def _grid(horizon: float, step: float) -> Floats:
    """The instants of the game itself; T over the whole number of steps, as δ may differ from it in the last digits."""
    if not (step > 0.0 and horizon > 0.0 and np.isfinite(horizon / step)):
        raise ScenarioError("step", step, f"a positive divisor of the horizon ({horizon!r})")
    return _core.grid_times(horizon, step)


def _instants(time: ArrayLike, trials: int, horizon: float, steps: int) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """The number k of each instant t_k."""
    times = as_real("time", time, "an array of instants")
    if times.shape != (trials,):
        raise ScenarioError("time", f"shape {times.shape}", f"of shape ({trials},), one instant for each trial")
    count = times / horizon * steps
    with np.errstate(invalid="ignore"):
        good = np.abs(count - np.rint(count)) <= max(_OFF_GRID, 1e-15 * steps)
        good &= (count > -0.5) & (count < steps + 0.5)
    rule = f"a multiple of the step ({horizon / steps!r}) between 0 and the horizon ({horizon!r})"
    refuse_where("time", times, ~good, rule)
    whole: np.ndarray[tuple[int], np.dtype[np.int64]] = np.rint(count).astype(np.int64)
    return whole
