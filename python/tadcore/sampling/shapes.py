"""How the varied quantities of a study are drawn.

Every sampler here maps points of the open unit cube to values, one value for each trial, so that the Sobol' and Latin
hypercube designs work with all of them:

==============  =============================================================  ==============
sampler         values                                                         for
==============  =============================================================  ==============
`Box`           uniform between two corners                                    both
`Disk`          uniform in a disk; in space, in a ball                         positions
`Annulus`       uniform between two circles; in space, between two spheres     positions
`Gaussian`      normal, by standard deviations or by a covariance              both
`Choice`        one of a list, each as likely, with replacement                both
`Cycle`         a list in its order, again and again: trial i takes i mod V    both
==============  =============================================================  ==============

"For both" means positions and single numbers: coordinates, radii, weights, the horizon and the step. A plain sequence
given to a study is a `Choice`. A frozen distribution of `scipy.stats` stands for itself: a scalar one is drawn for each
coordinate independently. A callable ``f(rng, size)`` returns ``size`` values (or ``size`` rows of coordinates) from a
`numpy.random.Generator`; it must be a function of its arguments alone, and serves the random design only. With a
wildcard path every player draws for itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import as_real
from tadcore.errors import ScenarioError

from .base import Block, Parameters, covariance, listed, numbers, positive


@dataclass(frozen=True)
class Box(Parameters):
    """Uniform between two corners.

    Parameters
    ----------
    low, high : float or sequence of float
        The corners, low ≤ high; a number stands for all coordinates.

    Examples
    --------
    >>> from tadcore.sampling import Box
    >>> Box([-3, -3], [3, 3])
    Box(low=(-3.0, -3.0), high=(3.0, 3.0))
    """

    low: Any
    high: Any

    def __post_init__(self) -> None:
        self.keep("low", numbers("Box.low", self.low))
        self.keep("high", numbers("Box.high", self.high))
        low, high = np.asarray(self.low), np.asarray(self.high)
        if low.ndim and high.ndim and low.shape != high.shape:
            raise ScenarioError("Box.high", self.high, f"{low.size} numbers, as Box.low is")
        if not np.all(low <= high):
            raise ScenarioError("Box.high", self.high, f"nowhere below Box.low ({self.low})")
        with np.errstate(over="ignore"):
            width = high - low
        if not np.isfinite(width).all():
            raise ScenarioError("Box.high", self.high, "so near to Box.low that the difference is a finite number")

    def check(self, field: str, components: int) -> None:
        """Refuse corners of another dimension."""
        self.fits(field, components, "low", "high")

    def draw(self, block: Block, components: int) -> NDArray[np.float64]:
        """Linear in the points."""
        low, high = (np.broadcast_to(corner, components) for corner in (self.low, self.high))
        values = np.empty_like(block.points)
        for j in range(components):  # a coordinate at a time: NumPy is slow where the last axis is short
            column = values[:, j]
            np.multiply(block.points[:, j], high[j] - low[j], out=column)
            column += low[j]
            np.clip(column, low[j], high[j], out=column)
        return values

    def bounds(self) -> tuple[float, float]:
        """The extremes of the corners."""
        return float(np.min(self.low)), float(np.max(self.high))


class _Round(Parameters):
    """Uniform between two radii around a centre."""

    center: Any

    def check(self, field: str, components: int) -> None:
        """Refuse a radius, and a centre of another dimension."""
        if components == 1:
            raise ScenarioError(field, self, "a sampler of numbers, such as Box: this quantity is a radius")
        self.fits(field, components, "center", scalar=False)

    def bounds(self) -> tuple[float, float]:
        """The extremes of the coordinates."""
        reach = float(getattr(self, "outer", 0.0) or getattr(self, "radius", 0.0))
        return float(np.min(self.center)) - reach, float(np.max(self.center)) + reach

    def _spread(self, points: NDArray[np.float64], inner: float, outer: float) -> NDArray[np.float64]:
        dim = points.shape[1]
        hole = (inner / outer) ** dim
        radius = outer * (hole + (1.0 - hole) * points[:, 0]) ** (1.0 / dim)
        angle = 2.0 * math.pi * points[:, 1]
        direction = [np.cos(angle), np.sin(angle)]
        if dim == 3:
            height = 2.0 * points[:, 2] - 1.0
            across = np.sqrt(1.0 - height * height)
            direction = [across * direction[0], across * direction[1], height]
        around: NDArray[np.float64] = np.asarray(self.center) + radius[:, None] * np.stack(direction, axis=1)
        return around


@dataclass(frozen=True)
class Disk(_Round):
    """Uniform in a disk; in space, in a ball.

    Parameters
    ----------
    center : sequence of float
        The centre, 2 or 3 numbers.
    radius : float
        Positive.
    """

    center: Any
    radius: float

    def __post_init__(self) -> None:
        self.keep("center", numbers("Disk.center", self.center))
        self.keep("radius", positive("Disk.radius", self.radius))

    def draw(self, block: Block, components: int) -> NDArray[np.float64]:
        """In polar coordinates."""
        return self._spread(block.points, 0.0, self.radius)


@dataclass(frozen=True)
class Annulus(_Round):
    """Uniform between two circles; in space, between two spheres.

    Parameters
    ----------
    center : sequence of float
        The centre, 2 or 3 numbers.
    inner, outer : float
        The radii, 0 ≤ inner ≤ outer, outer positive.
    """

    center: Any
    inner: float
    outer: float

    def __post_init__(self) -> None:
        self.keep("center", numbers("Annulus.center", self.center))
        self.keep("outer", positive("Annulus.outer", self.outer))
        inner = numbers("Annulus.inner", self.inner)
        if not isinstance(inner, float) or not 0.0 <= inner <= self.outer:
            raise ScenarioError("Annulus.inner", self.inner, f"a number in [0, {self.outer}], the outer radius")
        self.keep("inner", inner)

    def draw(self, block: Block, components: int) -> NDArray[np.float64]:
        """In polar coordinates."""
        return self._spread(block.points, self.inner, self.outer)


@dataclass(frozen=True)
class Gaussian(Parameters):
    """Normal, x = mean + L z with L Lᵀ the covariance and z the normal quantiles of the points.

    Parameters
    ----------
    mean : float or sequence of float
        The mean; a number stands for all coordinates.
    std : float or sequence of float, optional
        Standard deviations, positive; coordinates are independent.
    cov : array_like, shape (dim, dim), optional
        A symmetric positive definite covariance; either this or ``std``.

    Notes
    -----
    A radius must be positive: a truncated distribution such as `scipy.stats.truncnorm` says so, this one does not, and
    a study that draws a radius that is not positive is refused.
    """

    mean: Any
    std: Any = None
    cov: Any = None

    def __post_init__(self) -> None:
        self.keep("mean", numbers("Gaussian.mean", self.mean))
        if (self.std is None) == (self.cov is None):
            raise ScenarioError("Gaussian", self, "given either std or cov")
        if self.std is not None:
            std = numbers("Gaussian.std", self.std)
            if not np.all(np.asarray(std) > 0.0):
                raise ScenarioError("Gaussian.std", self.std, "positive")
            self.keep("std", std)
        else:
            self.keep("cov", covariance(self.cov))

    def check(self, field: str, components: int) -> None:
        """Refuse a mean, deviations or a covariance of another dimension."""
        self.fits(field, components, *(["mean"] if self.std is None else ["mean", "std"]))
        if self.cov is not None and len(self.cov) != components:
            raise ScenarioError(f"{field}, Gaussian.cov", self.cov, f"of shape ({components}, {components})")

    def draw(self, block: Block, components: int) -> NDArray[np.float64]:
        """By quantiles; sums are written out, since a library product may round by the number of rows."""
        from scipy.special import ndtri

        return self.from_normal(ndtri(block.points), components)

    def from_normal(self, normal: NDArray[np.float64], components: int) -> NDArray[np.float64]:
        """Linear in the numbers."""
        if self.std is not None:
            return np.asarray(self.mean) + np.asarray(self.std) * normal
        factor = np.linalg.cholesky(np.asarray(self.cov))
        rows = [sum(factor[i, j] * normal[:, j] for j in range(i + 1)) for i in range(components)]
        return np.asarray(self.mean) + np.stack(rows, axis=1)  # type: ignore[no-any-return]

    def bounds(self) -> tuple[float, float]:
        """All numbers."""
        return -math.inf, math.inf


class _Listed(Parameters):
    """A sampler that returns entries of a list."""

    values: Any

    def __post_init__(self) -> None:
        name = f"{type(self).__name__}.values"
        rule = "a list of numbers (for a radius) or of positions, at least one"
        array = as_real(name, self.values, rule)
        if array.ndim not in (1, 2) or not array.size or np.isnan(array).any():
            raise ScenarioError(name, self.values, rule)
        self.keep("values", tuple(map(tuple, array.tolist())) if array.ndim == 2 else tuple(array.tolist()))

    def check(self, field: str, components: int) -> None:
        """Refuse entries of another dimension."""
        shape = np.shape(self.values)[1:]
        if shape != (components,) and not (components == 1 and shape == ()):
            what = "numbers" if components == 1 else f"positions of {components} numbers"
            raise ScenarioError(f"{field}, {type(self).__name__}.values", self.values, f"a list of {what}")

    def bounds(self) -> tuple[float, float]:
        """The extremes of the list."""
        return float(np.min(self.values)), float(np.max(self.values))

    def _take(self, indices: NDArray[np.intp], components: int) -> NDArray[np.float64]:
        return np.asarray(self.values).reshape(-1, components)[indices]

    def table(self) -> dict[str, Any]:
        """The sampler as a TOML table, which identifies it."""
        return {type(self).__name__.lower(): listed(self.values)}


@dataclass(frozen=True)
class Choice(_Listed):
    """One entry of a list, each as likely, with replacement.

    Parameters
    ----------
    values : sequence of float or of positions
        What to choose from.
    """

    values: Any

    def coordinates(self, components: int) -> int:
        """One, for the index."""
        return 1

    def draw(self, block: Block, components: int) -> NDArray[np.float64]:
        """The entry whose share of [0, 1] holds the point."""
        many = len(self.values)
        indices = np.minimum((block.points[:, 0] * many).astype(np.intp), many - 1)
        return self._take(indices, components)


@dataclass(frozen=True)
class Cycle(_Listed):
    """A list in its order, again and again: trial i takes entry i modulo the length.

    Parameters
    ----------
    values : sequence of float or of positions
        What to go through.
    """

    values: Any

    def coordinates(self, components: int) -> int:
        """None: nothing is random."""
        return 0

    def draw(self, block: Block, components: int) -> NDArray[np.float64]:
        """By the number of the trial."""
        return self._take((block.first + np.arange(len(block.points))) % len(self.values), components)
