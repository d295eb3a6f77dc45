"""How the visibility network changes in the course of a game: the changes themselves, and the intervals between."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import Floats

from .network import Edge, edges_of


class NetworkChange(NamedTuple):
    """An instant at which the network is another than one step before."""

    time: float
    added: tuple[Edge, ...]
    removed: tuple[Edge, ...]


class Interval(NamedTuple):
    """A stretch of time with one and the same network."""

    start: float
    end: float
    edges: tuple[Edge, ...]


def changed_rows(adjacency: NDArray[np.bool_]) -> NDArray[np.intp]:
    """The rows, from 1 on, whose network is another than that of the row before."""
    return np.flatnonzero((adjacency[1:] != adjacency[:-1]).any(axis=(1, 2))) + 1


def changes_of(times: Floats, adjacency: NDArray[np.bool_], players: Sequence[str]) -> tuple[NetworkChange, ...]:
    """The initial network, then every instant at which it differs from the one before.

    ``adjacency`` has one row for each instant at which a network was in force; the terminal instant is not one.
    """
    if not len(times):
        return ()
    changes = [NetworkChange(float(times[0]), edges_of(adjacency[0], players), ())]
    for k in changed_rows(adjacency):
        before, after = adjacency[k - 1], adjacency[k]
        added, removed = edges_of(after & ~before, players), edges_of(before & ~after, players)
        changes.append(NetworkChange(float(times[k]), added, removed))
    return tuple(changes)


def intervals_of(changes: Sequence[NetworkChange], end: float) -> tuple[Interval, ...]:
    """The stretches between changes, the last up to ``end``."""
    if not changes:
        return ()
    stretches: list[Interval] = []
    edges: set[Edge] = set()
    for change, until in zip(changes, [*(c.time for c in changes[1:]), end], strict=True):
        edges = (edges - set(change.removed)) | set(change.added)
        stretches.append(Interval(change.time, until, tuple(sorted(edges, key=_order))))
    return tuple(stretches)


def _order(edge: Edge) -> tuple[tuple[int, int], tuple[int, int]]:
    def rank(label: str) -> tuple[int, int]:
        return (0, int(label[1:])) if label[1:].isdigit() else (1 if label == "target" else 2, 0)

    return rank(edge[0]), rank(edge[1])
