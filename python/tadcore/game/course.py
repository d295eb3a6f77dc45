"""What surrounds a game in one trial of it: which sensors and edges worked, who heard whom, what displaced the players.

`docs/theory/worlds.md` has the laws, and the numbers from which a trial is drawn.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import Floats
from tadcore.scenario.model import Scenario

from .network import Edge


@dataclass(frozen=True, eq=False)
class Course:
    """One trial of the world of a scenario along its run; rows are the instants of the run.

    Attributes
    ----------
    seed, trial : int
        What it was drawn from.
    seen : ndarray of bool, shape (L + 1, m, N)
        What each player saw itself: in range, its sensor and the edge working. The last row repeats the one before.
    sensor_up : ndarray of bool, shape (L + 1, m)
        Whether a player's sensor works.
    edge_up : ndarray of bool, shape (L + 1, m, N)
        Whether a player would detect another, or in its own entry the attacker, in range.
    heard : ndarray of bool, shape (L + 1, m, m)
        Whether player i hears player j.
    displacement : ndarray, shape (L + 1, n + 2, dim)
        What was added to every position at the end of the step from each instant; zero in the last row.
    from_outside : bool
        Whether a function of the caller decided the network in use.
    """

    seed: int
    trial: int
    seen: NDArray[np.bool_]
    sensor_up: NDArray[np.bool_]
    edge_up: NDArray[np.bool_]
    heard: NDArray[np.bool_]
    displacement: Floats
    from_outside: bool = False

    def until(self, rows: slice) -> Course:
        """The same for some of the rows."""
        cut = {name: getattr(self, name)[rows] for name in ARRAYS}
        return Course(self.seed, self.trial, **cut, from_outside=self.from_outside)


ARRAYS = ("seen", "sensor_up", "edge_up", "heard", "displacement")
"""Its arrays, in order."""


def shapes(sc: Scenario, rows: int) -> Mapping[str, tuple[int, ...]]:
    """The shapes of the arrays of a course with so many rows."""
    m, team = len(sc.constrained), (rows, len(sc.constrained), sc.n + 1)
    grid = {"displacement": (rows, sc.n + 2, sc.dim)}
    return {"seen": team, "sensor_up": (rows, m), "edge_up": team, "heard": (rows, m, m)} | grid


class Outage(NamedTuple):
    """A stretch of time over which a player's sensor did not work."""

    player: str
    start: float
    end: float


class EdgeOutage(NamedTuple):
    """A stretch of time over which one player would not have detected another, in range or not."""

    edge: Edge
    start: float
    end: float


class Contact(NamedTuple):
    """A stretch of time over which one player heard another."""

    listener: str
    speaker: str
    start: float
    end: float


def stretches(states: NDArray[np.bool_], times: Floats) -> dict[tuple[int, ...], list[tuple[float, float]]]:
    """Where each entry of ``states`` is true over time.

    Parameters
    ----------
    states : ndarray of bool, shape (L + 1, …)
        One row for each instant; the last, terminal one is in force no more.
    times : ndarray, shape (L + 1,)
        The instants.

    Returns
    -------
    dict
        For each entry that is ever true the stretches (start, end), in order.
    """
    in_force = states[:-1].astype(np.int8)
    starts = np.moveaxis(np.diff(in_force, axis=0, prepend=0) > 0, 0, -1)
    ends = np.moveaxis(np.diff(in_force, axis=0, append=0) < 0, 0, -1)
    spans: dict[tuple[int, ...], list[tuple[float, float]]] = {}
    for entry in map(tuple, np.argwhere(starts.any(axis=-1)).tolist()):
        first, last = np.flatnonzero(starts[entry]), np.flatnonzero(ends[entry])
        spans[entry] = list(zip(times[first].tolist(), times[last + 1].tolist(), strict=True))
    return spans


def sensor_outages(course: Course, times: Floats, sc: Scenario) -> tuple[Outage, ...]:
    """Stretches over which a sensor did not work, by player."""
    found = stretches(~course.sensor_up, times)
    return tuple(Outage(sc.constrained[i], *span) for (i,), spans in found.items() for span in spans)


def edge_outages(course: Course, times: Floats, sc: Scenario) -> tuple[EdgeOutage, ...]:
    """Stretches over which an edge was lost, by observer."""
    found = stretches(~course.edge_up, times)
    return tuple(EdgeOutage(_edge(sc, i, j), *span) for (i, j), spans in found.items() for span in spans)


def contacts(course: Course, times: Floats, sc: Scenario) -> tuple[Contact, ...]:
    """Stretches over which a player heard another, by listener."""
    found = stretches(course.heard, times)
    names = sc.constrained
    return tuple(Contact(names[i], names[j], *span) for (i, j), spans in found.items() for span in spans)


def _edge(sc: Scenario, i: int, j: int) -> Edge:
    return sc.players[i], sc.players[sc.n + 1 if i == j else j]
