r"""Which inputs decide the outcome: Sobol' indices.

For a quantity Y = f(X₁, …, X_d) of independent inputs, the variance of Y splits into parts of single inputs and of
their interactions. The *first-order* index :math:`S_i = \mathrm{Var}(E[Y \mid X_i]) / \mathrm{Var}(Y)` is the share
that input i explains by itself; the *total* index
:math:`S_{Ti} = E[\mathrm{Var}(Y \mid X_{\sim i})] / \mathrm{Var}(Y)` what it has a part in, so that an input with a
total index of zero could be fixed anywhere (Sobol' 2001). Here Y is an outcome, as 0 or 1, or the termination time.

Two matrices A and B of n points each and the d matrices A with one column from B, n (d + 2) games in all, give both
indices of every input (Saltelli et al. 2010; `scipy.stats.sobol_indices` has the same estimators). The points are a
scrambled Sobol' sequence. Intervals are percentiles of a bootstrap over the n rows, each by itself: an approximation,
which no theorem bounds. A Sobol' sequence is more even than independent points, which makes them wide. A quantity that
is the same at all but few points makes them far too narrow: for events at 30 of 2,048 points 95 % intervals held in
23 % to 100 % of 100 repetitions, at 120 of them in 99 % or more. So where it is one value at most points, and another
at fewer than 100 of A and B, the interval is all that is known, [0, 1]. An estimate of a small index may be a little
below 0.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import Floats, as_index, refuse_where
from tadcore._shared.html import as_html
from tadcore._shared.shares import estimate as interval, percent
from tadcore._shared.text import as_text
from tadcore.errors import ScenarioError, TadcoreError

from .outcomes import as_level

if TYPE_CHECKING:
    import pandas as pd

_FEWEST = 100  # points of A and B at which an event happens, or does not, for a bootstrap to see it


class Distribution(Protocol):
    """Anything with an inverse distribution function, such as a frozen `scipy.stats` distribution."""

    def ppf(self, q: Any) -> Any:
        """The value below which a share q lies."""


@dataclass(frozen=True, eq=False, repr=False)
class Sensitivity:
    """Sobol' indices of some quantities in some inputs; made by `sensitivity` or `sobol`.

    Attributes
    ----------
    inputs : tuple of str
        Names of the d inputs.
    outputs : tuple of str
        Names of the s quantities.
    first, first_low, first_high : ndarray, shape (s, d)
        First-order indices with their intervals; NaN for a quantity that is the same at all points of A and B.
    total, total_low, total_high : ndarray, shape (s, d)
        Total indices with theirs.
    mean, variance : ndarray, shape (s,)
        Of each quantity.
    points : int
        n, the points in each of the two matrices.
    level : float
        Nominal level of each interval by itself.
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    first: Floats
    first_low: Floats
    first_high: Floats
    total: Floats
    total_low: Floats
    total_high: Floats
    mean: Floats
    variance: Floats
    points: int
    level: float

    @property
    def evaluations(self) -> int:
        """How many points were evaluated in all, n (d + 2)."""
        return self.points * (len(self.inputs) + 2)

    def to_pandas(self) -> pd.DataFrame:
        """A table with one row for each (output, input)."""
        import pandas as pd

        names = ("first", "first_low", "first_high", "total", "total_low", "total_high")
        index = pd.MultiIndex.from_product([self.outputs, self.inputs], names=["output", "input"])
        return pd.DataFrame({name: getattr(self, name).ravel() for name in names}, index=index)

    def _table(self) -> tuple[str, list[str], list[list[str]]]:
        rows = [
            [
                f"{output} ← {name}",
                *interval(self.first[o, i], self.first_low[o, i], self.first_high[o, i], least=3),
                *interval(self.total[o, i], self.total_low[o, i], self.total_high[o, i], least=3),
            ]
            for o, output in enumerate(self.outputs)
            for i, name in enumerate(self.inputs)
        ]
        level = f"{percent(self.level)} (bootstrap)"
        return f"{self.evaluations:,} evaluations", ["output ← input", "first", level, "total", level], rows

    def __repr__(self) -> str:
        return as_text(*self._table())

    def _repr_html_(self) -> str:
        return as_html(*self._table())


@dataclass(frozen=True)
class Joint:
    """An input of several numbers that are drawn together, such as a position in a disk: its indices are those of all.

    Attributes
    ----------
    coordinates : int
        Coordinates of the unit cube that one draw takes.
    draw : callable
        Takes points of the open unit cube, shape (n, coordinates), and returns values, shape (n, k).
    """

    coordinates: int
    draw: Callable[[Floats], Floats]


def sobol(
    function: Callable[[Floats], Floats],
    inputs: Mapping[str, Distribution | Joint],
    outputs: Sequence[str],
    *,
    points: int = 1024,
    seed: int = 0,
    level: float = 0.95,
    resamples: int = 500,
) -> Sensitivity:
    """Sobol' indices of any function of independent inputs.

    Parameters
    ----------
    function : callable
        Takes points, shape (d, M), and returns s quantities at each, shape (s, M). An input of k numbers takes k rows.
    inputs : mapping of str to distribution
        Names of the d inputs, and their distributions; `Joint` where an input is several numbers.
    outputs : sequence of str
        Names of the s quantities.
    points : int
        n, a power of 2.
    seed : int
        Of the points and of the bootstrap.
    level : float
        Confidence level of each interval.
    resamples : int
        Bootstrap resamples. With fewer than 2 / (1 - level) - 1 there are no such percentiles, and every interval is
        [0, 1].

    Returns
    -------
    Sensitivity
        First-order and total indices.

    Raises
    ------
    ScenarioError
        An option breaks a rule, a distribution has no ``ppf`` or gives NaN, or the function's values are not finite.
    """
    from scipy.stats import qmc

    confidence = as_level(level)
    n = as_index("points", points, 2**30, least=2)
    if n & (n - 1):
        raise ScenarioError("points", points, "a power of 2")
    again = as_index("resamples", resamples, 1_000_000, least=1)
    d, s = len(inputs), len(outputs)
    if not d or not s:
        raise ScenarioError("inputs" if s else "outputs", "nothing", "at least one name")
    for name, distribution in inputs.items():
        if not isinstance(distribution, Joint) and not callable(getattr(distribution, "ppf", None)):
            raise ScenarioError(f"inputs[{name!r}]", distribution, "a distribution with a ppf, as scipy.stats has them")
    rng = np.random.Generator(np.random.Philox(as_index("seed", seed, 2**128 - 1)))
    axes = np.cumsum([0, *(p.coordinates if isinstance(p, Joint) else 1 for p in inputs.values())])
    unit = qmc.Sobol(2 * int(axes[-1]), scramble=True, rng=rng).random(n).T.reshape(2, -1, n)
    values = [
        _drawn(name, p, unit[:, axes[i] : axes[i + 1]]) for i, (name, p) in enumerate(inputs.items())
    ]  # of each input in A and in B, (2, k, n)
    rows = np.cumsum([0, *(value.shape[1] for value in values)])
    a, b = np.concatenate(values, axis=1)
    mixed = np.repeat(a[np.newaxis], d, axis=0)  # (d, rows, n): the i-th matrix has the rows of input i from B
    for i in range(d):
        mixed[i, rows[i] : rows[i + 1]] = b[rows[i] : rows[i + 1]]
    everything = np.concatenate([a, b, *mixed], axis=1)
    f = _evaluated(function, everything, tuple(outputs)).reshape(s, d + 2, n)
    estimate = _indices(f)
    resampled = np.array([_indices(f[..., rng.integers(0, n, n)]) for _ in range(again)])
    low, high = _percentiles(resampled, (1.0 - confidence) / 2.0, estimate)
    rare = _rare(f[:, :2].reshape(s, -1))
    low[:, rare], high[:, rare] = np.minimum(estimate, 0.0)[:, rare], np.maximum(estimate, 1.0)[:, rare]
    return Sensitivity(
        inputs=tuple(inputs),
        outputs=tuple(outputs),
        first=estimate[0],
        first_low=low[0],
        first_high=high[0],
        total=estimate[1],
        total_low=low[1],
        total_high=high[1],
        mean=f[:, :2].mean(axis=(1, 2)),
        variance=f[:, :2].var(axis=(1, 2)),
        points=n,
        level=confidence,
    )


def _drawn(name: str, distribution: Distribution | Joint, unit: Floats) -> Floats:
    """The values of one input in A and in B, all of them numbers: (2, k, n) from (2, coordinates, n)."""
    if isinstance(distribution, Joint):
        return np.array([distribution.draw(np.ascontiguousarray(points.T)).T for points in unit])
    rule = "a distribution whose ppf gives a number for each entry of an array"
    try:
        values = np.asarray(distribution.ppf(unit), dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ScenarioError(f"inputs[{name!r}]", distribution, rule) from error
    if values.shape != unit.shape or np.isnan(values).any():
        raise ScenarioError(f"inputs[{name!r}]", distribution, rule)
    return values


def _evaluated(function: Callable[[Floats], Floats], points: Floats, outputs: tuple[str, ...]) -> Floats:
    """The quantities at all points, all of them finite."""
    wanted = (len(outputs), points.shape[1])
    try:
        found = np.asarray(function(points), dtype=np.float64)
    except (TypeError, ValueError) as error:
        if isinstance(error, TadcoreError):
            raise
        raise ScenarioError("function", type(error).__name__, f"one that returns numbers of shape {wanted}") from error
    if found.shape != wanted:
        raise ScenarioError("function", f"shape {found.shape}", f"one that returns an array of shape {wanted}")
    for name, row in zip(outputs, found, strict=True):
        refuse_where(f"function: {name}", row, ~np.isfinite(row), "a finite number")
    return found


def _indices(f: Floats) -> Floats:
    """First-order and total indices, shape (2, s, d), by Saltelli et al. (2010), table 2 (b) and (f).

    NaN where a quantity does not vary in A and B, such as in a resample that misses the few points which differ.
    """
    f = f - f[:, :2].mean(axis=(1, 2), keepdims=True)
    a, b, mixed = f[:, :1], f[:, 1:2], f[:, 2:]
    variance = np.where(np.ptp(f[:, :2], axis=(1, 2)) > 0.0, f[:, :2].var(axis=(1, 2)), np.nan)[:, np.newaxis]
    variance = np.where(variance > 0.0, variance, np.nan)  # squares of tiny differences may vanish
    return np.array([(b * (mixed - a)).mean(axis=2), 0.5 * ((a - mixed) ** 2).mean(axis=2)]) / variance


def _rare(values: Floats) -> NDArray[np.bool_]:
    """Which quantities are mostly one value, with too few others for a bootstrap; shape (s,) from (s, 2n)."""
    others = np.array([len(row) - np.unique(row, return_counts=True)[1].max() for row in values])
    return np.asarray((others < _FEWEST) & (others <= values.shape[1] // 2))


def _percentiles(resampled: Floats, tail: float, estimate: Floats) -> tuple[Floats, Floats]:
    """Ends of percentile intervals: the order statistics beyond which lies a share ``tail`` of the resamples.

    All that is known of an index is that it is in [0, 1] where there are too few resamples for such a share, and in a
    resample in which the quantity did not vary.
    """
    least, most = np.minimum(estimate, 0.0), np.maximum(estimate, 1.0)
    rank = int((len(resampled) + 1) * tail * (1.0 + 1e-12))
    if rank < 1:
        return least, most
    missing = np.isnan(resampled)
    low = np.sort(np.where(missing, -np.inf, resampled), axis=0)[rank - 1]
    high = np.sort(np.where(missing, np.inf, resampled), axis=0)[-rank]
    return np.where(np.isinf(low), least, low), np.where(np.isinf(high), most, high)
