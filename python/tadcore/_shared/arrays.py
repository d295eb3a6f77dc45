"""Arrays from outside: checked as a whole, refused with the index of the first bad entry of each kind."""

from __future__ import annotations

import sys
from typing import Any, TypeAlias

import numpy as np
from numpy import ma  # not when first used: a child of a fork would wait for its parent's thread that imports it
from numpy.typing import ArrayLike, NDArray

from tadcore.errors import ScenarioError

from .limits import COORDINATE, FINITE

Floats: TypeAlias = NDArray[np.float64]
Integers: TypeAlias = NDArray[np.int64]

_LISTED = 20


def as_real(field: str, values: ArrayLike, rule: str) -> Floats:
    """A C-contiguous float64 array from real numbers; strings, bools, ragged lists and masked entries are refused."""
    try:
        array = np.asarray(values)
    except (ValueError, TypeError) as error:
        raise ScenarioError(field, values, rule) from error
    if ma.is_masked(values):
        raise ScenarioError(field, "an array with masked entries", rule)
    if array.dtype.kind not in "iuf" and array.size > 0:
        raise ScenarioError(field, values, rule)
    return np.ascontiguousarray(array, dtype=np.float64)


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
        return np.shape(values)
    except ValueError:
        return ()


def as_adjacency(values: Any, shape: tuple[int, int]) -> NDArray[np.bool_]:
    """A fresh 0-1 matrix of `shape` as bools; a `VisibilityNetwork` stands for its 𝒜."""
    rule = f"a matrix of 0 and 1 of shape {shape}: row i whom player i sees, entry i the attacker"
    values = getattr(values, "adjacency", values)
    try:
        array = np.asarray(values)
    except (ValueError, TypeError) as error:
        raise ScenarioError("adjacency", values, rule) from error
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
