"""What else a study takes for a sampler: frozen SciPy distributions, callables, plain sequences, TOML tables."""

from __future__ import annotations

import contextlib
import hashlib
import inspect
import math
from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import as_plain_array, as_real
from tadcore.errors import MISSING, ScenarioError

from .base import Block, Sampler
from .design import generator
from .shapes import Annulus, Box, Choice, Cycle, Disk, Gaussian

_BUILT_IN: dict[str, type[Sampler]] = {
    kind.__name__.lower(): kind for kind in (Annulus, Box, Choice, Cycle, Disk, Gaussian)
}
_KINDS = (*_BUILT_IN, "values", "scipy")
_PROBE = 64  # draws that identify what has no parameters to be known by
_RULE = "a sampler: one of tadcore.sampling, a frozen scipy.stats distribution, a sequence, or a callable f(rng, size)"


class Quantiles(Sampler):
    """A frozen univariate distribution, for each coordinate, by its quantile function."""

    def __init__(self, distribution: Any) -> None:
        self.distribution = distribution

    def __repr__(self) -> str:
        return f"<{_name(getattr(self.distribution, 'dist', self.distribution))}>"

    def check(self, field: str, components: int) -> None:
        """Refuse parameters with another number of coordinates."""
        try:
            low = np.shape(self.distribution.support()[0])
            self.bounds()
        except (TypeError, ValueError, LookupError) as error:
            raise ScenarioError(field, self.distribution, "a distribution whose support() is two numbers") from error
        if low not in ((), (1,), (components,)):
            what = "numbers" if components == 1 else f"numbers, or lists of {components}"
            raise ScenarioError(field, self.distribution, f"a distribution whose parameters are {what}")

    def draw(self, block: Block, components: int) -> NDArray[np.float64]:
        """The quantiles of the points."""
        quantiles = getattr(self.distribution, "ppf", None) or self.distribution.icdf
        return _shaped(repr(self)[1:-1], quantiles(block.points), len(block.points), components, broadcast=True)

    def from_normal(self, normal: NDArray[np.float64], components: int) -> NDArray[np.float64]:
        """Quantiles from the nearer end, so that either tail is followed as far as doubles go."""
        upper = getattr(self.distribution, "isf", None) or getattr(self.distribution, "iccdf", None)
        if upper is None:
            return super().from_normal(normal, components)
        from scipy.special import ndtr

        right, name, size = normal > 0.0, repr(self)[1:-1], len(normal)
        values = self.draw(Block(ndtr(np.minimum(normal, 0.0)), np.random.default_rng(0), 0), components)
        tail = upper(ndtr(-np.maximum(normal, 0.0)))
        return np.where(right, _shaped(name, tail, size, components, broadcast=True), values)

    def bounds(self) -> tuple[float, float]:
        """The support."""
        low, high = self.distribution.support()
        return float(np.min(low)), float(np.max(high))

    def table(self) -> dict[str, Any]:
        """Name and parameters for a distribution of SciPy, a description for any other."""
        frozen = self.distribution
        if getattr(getattr(frozen, "dist", None), "name", None) not in _distributions():
            values = self.draw(Block(np.linspace(0.0, 1.0, 66)[1:-1, None], np.random.default_rng(0), 0), 1)
            return {"distribution": _name(getattr(frozen, "dist", frozen)), "draws": _digest(values)}
        names = _parameters(frozen.dist)
        given = {**dict(zip(names, frozen.args, strict=False)), **frozen.kwds}
        parameters = {name: np.asarray(value, dtype=np.float64).tolist() for name, value in sorted(given.items())}
        return {"scipy": frozen.dist.name, **parameters}


class Variates(Sampler):
    """A frozen multivariate distribution, by its own ``rvs``."""

    by_points = False

    def __init__(self, distribution: Any) -> None:
        self.distribution = distribution

    def __repr__(self) -> str:
        return f"<{_name(self.distribution)}>"

    def coordinates(self, components: int) -> int:
        """None: it draws from the stream."""
        return 0

    def draw(self, block: Block, components: int) -> NDArray[np.float64]:
        """Whole chunks of variates."""
        values = self.distribution.rvs(size=len(block.points), random_state=block.rng)
        return _shaped(_name(self.distribution), values, len(block.points), components)

    def table(self) -> dict[str, Any]:
        """The class, and a digest of what it draws."""
        values = self.distribution.rvs(size=_PROBE, random_state=generator(0, 0, 0))
        return {"distribution": _name(self.distribution), "draws": _digest(values)}


class Resampled(Sampler):
    """A density estimate, such as `scipy.stats.gaussian_kde`, by its own ``resample``."""

    by_points = False

    def __init__(self, estimate: Any) -> None:
        self.estimate = estimate

    def __repr__(self) -> str:
        return f"<{_name(self.estimate)}>"

    def coordinates(self, components: int) -> int:
        """None: it draws from the stream."""
        return 0

    def draw(self, block: Block, components: int) -> NDArray[np.float64]:
        """Whole chunks of variates."""
        size = len(block.points)
        return _shaped(_name(self.estimate), self.estimate.resample(size, seed=block.rng).T, size, components)

    def table(self) -> dict[str, Any]:
        """The class, and a digest of what it draws."""
        values = self.estimate.resample(_PROBE, seed=generator(0, 0, 0))
        return {"distribution": _name(self.estimate), "draws": _digest(values)}


class Function(Sampler):
    """A callable ``f(rng, size)``."""

    by_points = False

    def __init__(self, function: Callable[[np.random.Generator, int], Any]) -> None:
        self.function = function

    def __repr__(self) -> str:
        return f"<{_name(self.function)}>"

    def coordinates(self, components: int) -> int:
        """None: it draws from the stream."""
        return 0

    def draw(self, block: Block, components: int) -> NDArray[np.float64]:
        """Always for a whole chunk, so that shorter studies are the beginning of longer ones."""
        size = len(block.points)
        return _shaped(_name(self.function), self.function(block.rng, size), size, components)

    def table(self) -> dict[str, Any]:
        """The qualified name, digests of the source, where there is one, and of what it draws.

        The source alone does not tell two closures apart.
        """
        table = {"callable": _name(self.function), "draws": _digest(self.function(generator(0, 0, 0), _PROBE))}
        with contextlib.suppress(OSError, TypeError):  # no source, or none that Python can find
            source = inspect.getsource(self.function)
            table["source"] = hashlib.sha256(source.encode()).hexdigest()[:16]
        return table


class Unavailable(Sampler):
    """A sampler of a store that only its description tells; it cannot draw again."""

    by_points = False

    def __init__(self, description: Mapping[str, Any]) -> None:
        self.description = dict(description)

    def draw(self, block: Block, components: int) -> NDArray[np.float64]:
        """Refuse."""
        raise ScenarioError("vary", self.table(), "given again as the object itself: a store keeps its name only")

    def table(self) -> dict[str, Any]:
        """What the store says."""
        return dict(self.description)


def as_sampler(field: str, value: Any) -> Sampler:
    """The sampler that a value of ``vary`` stands for."""
    if isinstance(value, Sampler):
        return value
    if isinstance(value, type) and issubclass(value, Sampler):
        raise ScenarioError(field, value, f"given its parameters: {value.__name__}(…)")
    if all(hasattr(value, name) for name in ("mean", "cov_object", "rvs")):  # a frozen multivariate normal
        return Gaussian(value.mean, cov=value.cov_object.covariance)
    if hasattr(value, "support") and (hasattr(value, "ppf") or hasattr(value, "icdf")):
        if callable(value) and not hasattr(value, "dist"):
            raise ScenarioError(field, value, f"frozen: {getattr(value, 'name', 'norm')}(…) with its parameters")
        return Quantiles(value)
    if hasattr(value, "rvs"):
        return Variates(value)
    if hasattr(value, "resample") and hasattr(type(value), "pdf"):  # a table resamples too, by time
        return Resampled(value)
    if callable(value) and not isinstance(value, type):
        if not _takes(value, 2):
            raise ScenarioError(field, value, "a callable f(rng, size), which returns one row for each trial")
        return Function(value)
    if isinstance(value, list | tuple | np.ndarray):
        if not np.shape(value) and not isinstance(value, list | tuple):
            raise ScenarioError(field, value, f"{_RULE}; a fixed value belongs in the scenario")
        if isinstance(value, tuple) and len(value) == 2 and all(isinstance(one, list | tuple) for one in value):
            rule = "a Box for all that lies between the two, or a list of the two for a choice between them"
            raise ScenarioError(field, value, rule)
        return _named(field, lambda: Choice(value))
    fixed = isinstance(value, int | float | np.number)
    raise ScenarioError(field, value, f"{_RULE}; a fixed value belongs in the scenario" if fixed else _RULE)


def from_table(field: str, table: Any, *, stored: bool = False) -> Sampler:
    """A sampler from TOML; one that only a program can give is `Unavailable` where ``stored``, else refused."""
    if isinstance(table, list):
        return _named(field, lambda: Choice(table))
    if not isinstance(table, dict) or not table:
        raise ScenarioError(field, table, 'a table such as { box = [[-3, -3], [3, 3]] } or { scipy = "norm" }')
    if stored and ("callable" in table or "distribution" in table):
        return Unavailable(table)
    if "scipy" in table:
        return _from_scipy(field, table)
    kind, *more = table
    if kind not in _KINDS or more:
        strange = next((key for key in table if key not in _KINDS), more[0] if more else kind)
        raise ScenarioError(f"{field}.{strange}", table[strange], f"one of the samplers {', '.join(_KINDS)}")
    return _named(field, lambda: _built_in(f"{field}.{kind}", kind, table[kind]))


def _built_in(field: str, kind: str, parameters: Any) -> Sampler:
    if kind == "values":
        return Choice(parameters)
    sampler: Any = _BUILT_IN[kind]
    if sampler in (Choice, Cycle):
        return sampler(parameters)  # type: ignore[no-any-return]
    names = [f.name for f in fields(sampler)]
    optional = {"std", "cov"}
    if isinstance(parameters, list) and len(parameters) == len(names):
        parameters = dict(zip(names, parameters, strict=True))
    if not isinstance(parameters, dict):
        raise ScenarioError(field, parameters, f"a table of {', '.join(names)}")
    for name in parameters:
        if name not in names:
            raise ScenarioError(f"{field}.{name}", parameters[name], f"left out: it has {', '.join(names)}")
    for name in names:
        if name not in parameters and name not in optional:
            raise ScenarioError(f"{field}.{name}", MISSING, "given")
    return sampler(**parameters)  # type: ignore[no-any-return]


def _from_scipy(field: str, table: Mapping[str, Any]) -> Sampler:
    """A continuous distribution by its name in `scipy.stats`, from a list of names and never by evaluation."""
    from scipy import stats

    name = table["scipy"]
    if not isinstance(name, str) or name not in _distributions():
        raise ScenarioError(f"{field}.scipy", name, "the name of a continuous distribution of scipy.stats")
    distribution = getattr(stats, name)
    known = _parameters(distribution)
    parameters = {key: value for key, value in table.items() if key != "scipy"}
    for key, value in parameters.items():
        if key not in known:
            raise ScenarioError(f"{field}.{key}", value, f"left out: {name} has {', '.join(known)}")
        if as_real(f"{field}.{key}", value, "a number, or a list of them").ndim > 1:
            raise ScenarioError(f"{field}.{key}", value, "a number, or a list of them")
    for key in known[:-2]:
        if key not in parameters:
            raise ScenarioError(f"{field}.{key}", MISSING, f"given: {name} has {', '.join(known)}")
    return Quantiles(distribution(**parameters))


def _parameters(distribution: Any) -> list[str]:
    """Names of the parameters of a distribution, in the order of its arguments."""
    return [*(distribution.shapes or "").replace(",", " ").split(), "loc", "scale"]


def _distributions() -> frozenset[str]:
    from scipy import stats

    return frozenset(name for name in dir(stats) if isinstance(getattr(stats, name), stats.rv_continuous))


def _named(field: str, make: Callable[[], Sampler]) -> Sampler:
    """Make a sampler, with errors that name the path too."""
    try:
        return make()
    except ScenarioError as error:
        if error.field.startswith(field):
            raise
        raise ScenarioError(f"{field}, {error.field}", error.value, error.rule) from None


def _shaped(name: str, values: Any, size: int, components: int, *, broadcast: bool = False) -> NDArray[np.float64]:
    """Check what a callable returned; with ``broadcast`` one number may stand for a column, or for all."""
    rule = f"an array of numbers of shape {(size, components)}, one row for each trial"
    field = f"what {name} returns"
    try:
        array = as_plain_array(field, values, rule)
    except ScenarioError as error:
        found = error.value if isinstance(error.value, str) else f"a {type(values).__name__} that is no array"
        raise ScenarioError(field, found, rule) from None
    wanted = {(size, components), (size,)} if components == 1 else {(size, components)}
    if broadcast and array.shape in {(), (1,), (1, 1), (size, 1), (1, components), (components,)} - wanted:
        array = np.broadcast_to(array, (size, components))
    if array.dtype.kind not in "iuf" or array.shape not in wanted:
        raise ScenarioError(field, f"{array.dtype} of shape {array.shape}", rule)
    # A copy: the next draw may be written where this one was.
    return np.array(array.reshape(size, components), dtype=np.float64, order="C")


def _takes(function: Callable[..., Any], arguments: int) -> bool:
    """Whether a callable takes so many arguments, as far as it can be known."""
    try:
        inspect.signature(function).bind(*[None] * arguments)
    except TypeError:
        return False
    except ValueError:  # one that does not say
        return True
    return True


def _name(thing: Any) -> str:
    target = thing if hasattr(thing, "__qualname__") else type(thing)
    return f"{target.__module__}.{target.__qualname__}"


def _digest(values: Any) -> str:
    """A digest of values that the last bits, which differ between machines, do not change."""
    array = as_real("what a sampler returns", values, "an array of numbers")
    with np.errstate(over="ignore"):
        return hashlib.sha256(array.astype(np.float32).tobytes()).hexdigest()[:16]


def as_plain(value: Any) -> Any:
    """A table with infinities as words, which JSON can hold."""
    if isinstance(value, dict):
        return {key: as_plain(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [as_plain(entry) for entry in value]
    return repr(value) if isinstance(value, float) and math.isinf(value) else value


def from_plain(value: Any) -> Any:
    """The inverse of `as_plain`."""
    if isinstance(value, dict):
        return {key: from_plain(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [from_plain(entry) for entry in value]
    return float(value) if value in ("inf", "-inf") else value
