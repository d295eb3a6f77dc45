"""Arrays and numbers from outside, checked; of an array the first bad entries are refused by their index."""

from __future__ import annotations

import sys
from typing import Any, TypeAlias

import numpy as np
from numpy import ma  # not when first used: a child of a fork would wait for its parent's thread that imports it
from numpy.typing import ArrayLike, NDArray

from tadcore.errors import ScenarioError

from .limits import COORDINATE, FINITE

Floats: TypeAlias = NDArray[np.float64]
Numbers: TypeAlias = NDArray[Any]
"""Real, or complex where gains turn."""
Integers: TypeAlias = NDArray[np.int64]

_LISTED = 20


def complex_of(real: Floats, imaginary: Floats) -> NDArray[np.complex128]:
    """The complex numbers of two arrays, bitwise."""
    out = np.empty(real.shape, dtype=np.complex128)
    out.real, out.imag = real, imaginary
    return out


def as_plain_array(field: str, values: Any, rule: str) -> NDArray[Any]:
    """An array of NumPy's own class, of any kind of entries; ragged lists and masked entries are refused."""
    try:
        hidden = _masked(values)
        array = np.asarray(None if hidden else values)
    except MemoryError:
        raise
    except Exception as error:  # ragged, or an object that says it is an array and is none
        raise ScenarioError(field, values, rule) from error
    if hidden:
        raise ScenarioError(field, "an array with masked entries", rule)
    return array


def _masked(values: Any) -> bool:
    """Whether an entry is masked, also of an array within lists, whose mask NumPy would pass over."""
    if isinstance(values, list | tuple):
        return any(_masked(entry) for entry in values if isinstance(entry, list | tuple | ma.MaskedArray))
    return isinstance(values, ma.MaskedArray) and ma.is_masked(values)


def as_real(field: str, values: ArrayLike, rule: str) -> Floats:
    """A C-contiguous, aligned float64 array from real numbers; strings, bools, ragged and masked ones are refused."""
    array = as_plain_array(field, values, rule)
    if array.size == 0:
        return np.empty(array.shape)
    if array.dtype.kind not in "iuf":
        raise ScenarioError(field, values, rule)
    return np.require(array, np.float64, ["C_CONTIGUOUS", "ALIGNED"])


def refuse_where(field: str, array: NDArray[Any], bad: NDArray[np.bool_], rule: str) -> None:
    """Raise `ScenarioError` for the entries marked bad: each of the first few by its index."""
    if not bad.any():
        return
    found = np.argwhere(bad)
    errors = [
        ScenarioError(f"{field}[{', '.join(map(str, where))}]" if where else field, array[tuple(where)].item(), rule)
        for where in found[:_LISTED].tolist()
    ]
    if len(found) > _LISTED:
        errors.append(ScenarioError(field, f"{len(found) - _LISTED:,} more such entries", rule))
    raise ScenarioError.collect(errors)


def as_positions(values: ArrayLike, shape: tuple[int, ...], *, rows: bool = False) -> Floats:
    """Finite positions of `shape`, or with `rows` any number of such arrays stacked."""
    wanted = f"({', '.join([*(['M'] if rows else []), *map(str, shape)])})"
    rule = f"an array of finite numbers of shape {wanted}, players ordered d1 … dn, target, attacker"
    array = as_real("positions", values, rule)
    if array.shape[rows:] != shape or array.ndim != len(shape) + rows:
        raise ScenarioError("positions", f"shape {array.shape}", rule)
    for must in (FINITE, COORDINATE):
        refuse_where("positions", array, ~must.holds(array), must.words)
    return array


def shape_of(values: Any) -> tuple[int, ...]:
    """The shape of anything array-like; empty for a ragged list."""
    try:
        shape = np.shape(values)
    except Exception:
        return ()
    return shape if isinstance(shape, tuple) else ()  # a class has something else there


def as_adjacency(values: Any, shape: tuple[int, int]) -> NDArray[np.bool_]:
    """A fresh 0-1 matrix of `shape` as bools; a `VisibilityNetwork` stands for its 𝒜."""
    rule = f"a matrix of 0 and 1 of shape {shape}: row i whom player i sees, entry i the attacker"
    values = getattr(values, "adjacency", values)
    array = as_plain_array("adjacency", values, rule)
    if array.shape != shape:
        raise ScenarioError("adjacency", f"shape {array.shape}", rule)
    if array.dtype.kind not in "biuf":
        raise ScenarioError("adjacency", values, rule)
    refuse_where("adjacency", array, (array != 0) & (array != 1), "0 or 1")
    return np.array(array, dtype=np.bool_, order="C")


def as_amount(field: str, value: Any) -> float:
    """A finite number of at least 0; bools are refused."""
    if (
        isinstance(value, int | float | np.integer | np.floating)
        and not isinstance(value, bool)
        and 0 <= value <= sys.float_info.max
    ):
        return float(value)
    raise ScenarioError(field, value, "a finite number of at least 0")


def as_index(field: str, value: Any, most: int, *, least: int = 0) -> int:
    """An int in [least, most]; bools and floats are refused."""
    if isinstance(value, int | np.integer) and not isinstance(value, bool) and least <= value <= most:
        return int(value)
    raise ScenarioError(field, value, f"a whole number in [{least}, {most}]")


def as_threads(threads: Any) -> int | None:
    """A number of threads; None for as many as there are cores."""
    return None if threads is None else as_index("threads", threads, 2**16, least=1)


def as_seed(seed: Any) -> int:
    """A seed of the generators: it is one word of their key."""
    return as_index("seed", seed, 2**64 - 1)


def as_trial(field: str, trial: Any) -> int:
    """The number of a trial: it shares a word of the counter with the purpose of a draw."""
    return as_index(field, trial, 2**56 - 1)


def as_flag(field: str, value: Any) -> bool:
    """True or False, NumPy's too; arrays and numbers are refused."""
    if isinstance(value, bool | np.bool_):
        return bool(value)
    raise ScenarioError(field, value, "True or False")
