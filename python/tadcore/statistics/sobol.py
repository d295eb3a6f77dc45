r"""Which inputs decide the outcome: Sobol' indices.

For a quantity Y = f(X₁, …, X_d) of independent inputs, the variance of Y splits into parts of single inputs and of
their interactions. The *first-order* index :math:`S_i = \mathrm{Var}(E[Y \mid X_i]) / \mathrm{Var}(Y)` is the share
that input i explains by itself; the *total* index
:math:`S_{Ti} = E[\mathrm{Var}(Y \mid X_{\sim i})] / \mathrm{Var}(Y)` what it has a part in, so that an input with a
total index of zero could be fixed anywhere (Sobol' 2001). Here Y is an outcome, as 0 or 1, or the termination time.

Two matrices A and B of n points each and the d matrices A with one column from B, n (d + 2) games in all, give both
indices of every input (Saltelli et al. 2010, as computed by `scipy.stats.sobol_indices`). The points are a scrambled
Sobol' sequence. Intervals are percentiles of a bootstrap over the n rows; since a Sobol' sequence is more even than
independent points, they are on the wide side. An estimate of a small index may be a little below 0.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import Floats, as_index
from tadcore._shared.text import as_text
from tadcore.errors import ScenarioError

from .outcomes import as_level

if TYPE_CHECKING:
    import pandas as pd


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
        First-order indices with their intervals; NaN for a quantity that never varied.
    total, total_low, total_high : ndarray, shape (s, d)
        Total indices with theirs.
    mean, variance : ndarray, shape (s,)
        Of each quantity.
    points : int
        n, the points in each of the two matrices.
    level : float
        Confidence level of each interval.
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

    def __repr__(self) -> str:
        rows = [
            [
                f"{output} ← {name}",
                f"{self.first[o, i]:.3f}",
                f"[{self.first_low[o, i]:.3f}, {self.first_high[o, i]:.3f}]",
                f"{self.total[o, i]:.3f}",
                f"[{self.total_low[o, i]:.3f}, {self.total_high[o, i]:.3f}]",
            ]
            for o, output in enumerate(self.outputs)
            for i, name in enumerate(self.inputs)
        ]
        share = f"{100 * self.level:g} %"
        return as_text(f"{self.evaluations:,} evaluations", ["output ← input", "first", share, "total", share], rows)


def sobol(
    function: Callable[[Floats], Floats],
    inputs: Mapping[str, Distribution],
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
        Takes points, shape (d, M), and returns s quantities at each, shape (s, M).
    inputs : mapping of str to distribution
        Names of the d inputs, and their distributions.
    outputs : sequence of str
        Names of the s quantities.
    points : int
        n, a power of 2.
    seed : int
        Of the points and of the bootstrap.
    level : float
        Confidence level of each interval.
    resamples : int
        Bootstrap resamples.

    Returns
    -------
    Sensitivity
        First-order and total indices.

    Raises
    ------
    ScenarioError
        An option breaks a rule, or a distribution has no ``ppf``.
    """
    from scipy.stats import qmc

    confidence = as_level(level)
    n = as_index("points", points, 2**30, least=2)
    if n & (n - 1):
        raise ScenarioError("points", points, "a power of 2")
    as_index("resamples", resamples, 1_000_000, least=1)
    d, s = len(inputs), len(outputs)
    if not d or not s:
        raise ScenarioError("inputs" if s else "outputs", "nothing", "at least one name")
    for name, distribution in inputs.items():
        if not callable(getattr(distribution, "ppf", None)):
            raise ScenarioError(f"inputs[{name!r}]", distribution, "a distribution with a ppf, as scipy.stats has them")
    rng = np.random.Generator(np.random.Philox(as_index("seed", seed, 2**128 - 1)))
    unit = qmc.Sobol(2 * d, scramble=True, rng=rng).random(n).T
    values = np.array([p.ppf(unit[[i, d + i]]) for i, p in enumerate(inputs.values())], dtype=np.float64)
    a, b = values[:, 0], values[:, 1]
    mixed = np.repeat(a[np.newaxis], d, axis=0)  # (d, d, n): the i-th matrix has its row i from B
    mixed[np.arange(d), np.arange(d)] = b
    everything = np.concatenate([a, b, *mixed], axis=1)
    f = np.asarray(function(everything), dtype=np.float64).reshape(s, d + 2, n)
    varies = np.ptp(f, axis=(1, 2)) > 0.0
    estimate = _indices(f, varies)
    resampled = np.array([_indices(f[..., rng.integers(0, n, n)], varies) for _ in range(resamples)])
    tail = (1.0 - confidence) / 2.0
    low, high = np.full((2, *estimate.shape), np.nan)
    low[:, varies], high[:, varies] = np.nanquantile(resampled[:, :, varies], [tail, 1.0 - tail], axis=0)
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


def _indices(f: Floats, varies: NDArray[np.bool_]) -> Floats:
    """First-order and total indices, shape (2, s, d); NaN where a quantity does not vary."""
    from scipy.stats import sobol_indices

    found = np.full((2, len(f), f.shape[1] - 2), np.nan)
    good = varies & (np.ptp(f[:, :2], axis=(1, 2)) > 0.0)  # a resample may miss the few points that differ
    if good.any():
        parts = {"f_A": f[good, 0], "f_B": f[good, 1], "f_AB": np.moveaxis(f[good, 2:], 1, 0)}
        indices = sobol_indices(func=parts, n=f.shape[-1])
        shape = (int(good.sum()), f.shape[1] - 2)
        found[0, good], found[1, good] = indices.first_order.reshape(shape), indices.total_order.reshape(shape)
    return found
