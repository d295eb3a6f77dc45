"""What surrounds a game, recomputed from (seed, trial) and the positions: failures, sight, reports, disturbances.

The numbers are drawn by `tadcore.verification.oracle.worlds`, which shares nothing with the compiled core.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import Floats
from tadcore.game.course import Course
from tadcore.scenario.worlds import World
from tadcore.simulation.run import Run
from tadcore.verification.oracle.worlds import Draws, draws_of, told
from tadcore.verification.report import Check

from .claims import AROUND
from .ending import distances
from .strategies import network_errors

_WRONG = 1.0  # no rounding makes it


def check_around(run: Run) -> list[Check]:
    """The checks of `AROUND`, in the place of ``record.network``; of a run that has a course."""
    world, course = run.scenario.world, run.course
    if world is None or course is None:
        return [
            AROUND["record.failures"].judge(_WRONG, "a course and a scenario without failures, links, disturbances")
        ]
    rows = slice(max(len(run.times) - 1, 1))
    drawn = draws_of(run.scenario, world, course.seed, course.trial)
    return [
        _failures(run, course, drawn, rows),
        _seen(run, course, rows),
        _contacts(run, course, world, drawn, rows),
        _relay(run, course, world, rows),
        _displacement(run, course, world, drawn),
    ]


def seen_errors(run: Run, course: Course, rows: slice) -> Floats:
    """How far what is seen is from distances and failures, (rows, m, N); 0 where they agree."""
    works = course.sensor_up[rows, :, None] & course.edge_up[rows]
    off = network_errors(run.scenario, run.position[rows], course.seen[rows])
    return np.where(works, off, np.where(course.seen[rows], _WRONG, 0.0))


def relay_errors(run: Run, course: Course, world: World, rows: slice) -> NDArray[np.bool_]:
    """Where the network in use is not what is seen and told, (rows, m, N)."""
    seen = course.seen[rows]
    used = told(seen, course.heard[rows], relays=world.relays, common=world.common_frame) if world.talks else seen
    return np.asarray(used != run.adjacency[rows])


def _failures(run: Run, course: Course, drawn: Draws, rows: slice) -> Check:
    wrong_sensor = course.sensor_up[rows] != drawn.sensor_up[: len(run.times)][rows]
    wrong_edge = course.edge_up[rows] != drawn.edge_up[: len(run.times)][rows]
    wrong = np.asarray(wrong_sensor | wrong_edge.any(axis=2))
    return AROUND["record.failures"].judge(float(np.count_nonzero(wrong)), _first(run, wrong))


def _seen(run: Run, course: Course, rows: slice) -> Check:
    off = seen_errors(run, course, rows)
    k, i, j = np.unravel_index(int(np.argmax(off)), off.shape)
    players = run.scenario.players
    where = f"{players[i]}→{players[-1 if i == j else j]} at t = {run.times[k]:.6g}" if off[k, i, j] else ""
    return AROUND["record.seen"].judge(float(off[k, i, j]), where)


def _contacts(run: Run, course: Course, world: World, drawn: Draws, rows: slice) -> Check:
    """How far a pair is from its radius of communication where it contradicts the distance; 1 where the link does."""
    claim = AROUND["record.contacts"]
    heard = course.heard[rows]
    if world.link_radius is None or drawn.link_up is None:
        return claim.judge(float(heard.any()), "nobody is heard in this game")
    m = heard.shape[1]
    at = run.position[rows, :m]
    distance = distances(at[:, :, None], at[:, None])
    reach = np.abs(at).max(axis=-1)
    radius = np.nan_to_num(world.link_radius, nan=-1.0, posinf=np.inf)[None, None, :]
    apart = ~np.eye(m, dtype=bool)
    up = drawn.link_up[: len(run.times)][rows] & apart
    with np.errstate(invalid="ignore"):
        beyond = np.abs(distance - radius) / (radius + reach[:, :, None] + reach[:, None])
    beyond = np.where(np.isfinite(radius) & (radius > 0.0) & up, beyond, _WRONG)
    off = np.where(heard != (up & (distance <= radius)), beyond, 0.0)
    k, i, j = np.unravel_index(int(np.argmax(off)), off.shape)
    names = run.scenario.constrained
    where = f"{names[i]} hears {names[j]} at t = {run.times[k]:.6g}" if off[k, i, j] else ""
    return claim.judge(float(off[k, i, j]), where)


def _relay(run: Run, course: Course, world: World, rows: slice) -> Check:
    wrong = np.asarray(relay_errors(run, course, world, rows).any(axis=2))
    return AROUND["record.relay"].judge(float(np.count_nonzero(wrong)), _first(run, wrong))


def _displacement(run: Run, course: Course, world: World, drawn: Draws) -> Check:
    """How far displacements are from those drawn, relative to ς√δ."""
    size = world.disturbance * np.sqrt(run.scenario.horizon / run.scenario.steps)
    expected = drawn.displacement[: len(run.times)].copy()
    expected[-1] = 0.0
    off = np.abs(course.displacement - expected).max(axis=2)
    relative = np.where(size > 0.0, off / np.where(size > 0.0, size, 1.0), np.where(off > 0.0, _WRONG, 0.0))
    k, p = np.unravel_index(int(np.argmax(relative)), relative.shape)
    where = f"{run.scenario.players[p]} after t = {run.times[k]:.6g}" if relative[k, p] else ""
    return AROUND["record.displacement"].judge(float(relative[k, p]), where)


def _first(run: Run, wrong: NDArray[np.bool_]) -> str:
    """The player and the instant at which something is wrong first."""
    if not wrong.any():
        return ""
    k, i = np.argwhere(wrong)[0]
    return f"{run.scenario.constrained[i]} at t = {run.times[k]:.6g}"
