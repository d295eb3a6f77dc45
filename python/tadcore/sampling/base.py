"""What a sampler is: values for each trial from points of the unit cube, parameters that are checked and compared."""

from __future__ import annotations

import abc
import math
from dataclasses import fields
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tadcore._shared.arrays import as_plain_array, as_real
from tadcore.errors import ScenarioError

LOWEST, HIGHEST = 2.0**-54, 1.0 - 2.0**-53
"""The ends of the open unit interval."""


class Block(NamedTuple):
    """What a sampler draws from: one chunk of trials."""

    points: NDArray[np.float64]
    """Points of the open unit cube, shape (trials, coordinates)."""
    rng: np.random.Generator
    """The stream of this chunk and quantity, for samplers that cannot use points."""
    first: int
    """Number of the first trial."""


class Sampler(abc.ABC):
    """What `tadcore.Study` asks of a sampler; ``components`` is dim for a position and 1 for a number."""

    by_points: ClassVar[bool] = True
    """Whether values come from the points alone; otherwise only the random design can use it."""

    def coordinates(self, components: int) -> int:
        """How many coordinates of the unit cube one trial takes."""
        return components

    @abc.abstractmethod
    def draw(self, block: Block, components: int) -> NDArray[np.float64]:
        """Values of shape (trials, components)."""

    def from_normal(self, normal: NDArray[np.float64], components: int) -> NDArray[np.float64]:
        """Values of the same law from independent standard normal numbers, by quantiles.

        Parameters
        ----------
        normal : ndarray, shape (trials, coordinates)
            The numbers.
        components : int
            As of `draw`.
        """
        from scipy.special import ndtr

        points = np.clip(ndtr(normal), LOWEST, HIGHEST)
        return self.draw(Block(points, np.random.default_rng(0), 0), components)

    def check(self, field: str, components: int) -> None:  # noqa: B027 (what has no own shape fits everything)
        """Raise `ScenarioError` where the sampler does not fit the quantity that ``field`` names."""

    def bounds(self) -> tuple[float, float]:
        """A smallest and a largest value of any component; NaN where nothing is known."""
        return math.nan, math.nan

    @abc.abstractmethod
    def table(self) -> dict[str, Any]:
        """The sampler as a TOML table, which identifies it."""


class Parameters(Sampler):
    """A sampler that is its parameters: numbers and tuples of numbers, as frozen dataclass fields."""

    def table(self) -> dict[str, Any]:
        """The sampler as a TOML table, which identifies it."""
        values = {f.name: listed(getattr(self, f.name)) for f in fields(self)}  # type: ignore[arg-type]
        return {type(self).__name__.lower(): {name: value for name, value in values.items() if value is not None}}

    def keep(self, name: str, value: Any) -> None:
        """Set a field while the object is made."""
        object.__setattr__(self, name, value)  # the way into a frozen dataclass

    def fits(self, field: str, components: int, *names: str, scalar: bool = True) -> None:
        """Refuse a parameter that has another number of components than the quantity."""
        for name in names:
            shape = np.shape(getattr(self, name))
            if shape != (components,) and not (scalar and shape == ()):
                what = "a number" if components == 1 else f"{components} numbers"
                raise ScenarioError(f"{field}, {type(self).__name__}.{name}", getattr(self, name), what)


def numbers(field: str, value: ArrayLike | None) -> float | tuple[float, ...]:
    """A finite float, or 2 or 3 of them."""
    rule = "a finite number, or a list of 2 or 3"
    array = as_plain_array(field, value, rule)
    if array.dtype.kind not in "iuf" or array.shape not in ((), (2,), (3,)) or not np.isfinite(array).all():
        raise ScenarioError(field, value, rule)
    return float(array) if array.ndim == 0 else tuple(map(float, array))


def positive(field: str, value: object) -> float:
    """A positive finite float."""
    number = numbers(field, value)  # type: ignore[arg-type]
    if not isinstance(number, float) or number <= 0.0:
        raise ScenarioError(field, value, "a positive finite number")
    return number


def covariance(value: ArrayLike) -> tuple[tuple[float, ...], ...]:
    """A covariance as tuples."""
    rule = "a symmetric positive definite matrix"
    try:
        matrix = as_real("Gaussian.cov", value, rule)
        np.linalg.cholesky(matrix)
    except (ValueError, np.linalg.LinAlgError):
        raise ScenarioError("Gaussian.cov", value, rule) from None
    if matrix.shape not in ((1, 1), (2, 2), (3, 3)) or not (np.isfinite(matrix).all() and (matrix == matrix.T).all()):
        raise ScenarioError("Gaussian.cov", value, rule)
    return tuple(map(tuple, matrix.tolist()))


def listed(value: Any) -> Any:
    """Tuples as lists, as TOML and JSON have them."""
    return [listed(entry) for entry in value] if isinstance(value, tuple) else value
