"""What surrounds the game of a scenario, as arrays over its players, with the rules and the words of its tables.

A player's own table goes before the common one, field by field.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import Floats

from .fields import Problem
from .shape import Shape

SENSORS = ("mean_time_to_failure", "mean_time_to_repair")
DETECTIONS = ("mean_time_detected", "mean_time_missed")
LINKS = ("mean_time_up", "mean_time_down")
"""The two mean times of a chain: of a player's sensor, of a single edge, of a link."""


@dataclass(frozen=True, eq=False)
class World:
    """What may fail, who may be told and what is disturbed, of the m players with limited sight in their order.

    Attributes
    ----------
    mean_time_to_failure, mean_time_to_repair, mean_time_detected, mean_time_missed : ndarray, shape (m,)
        Of sensors and of single edges; inf for never, and for good.
    stationary : ndarray of bool, shape (m,)
        Whether a player's chains begin in the law of a long time.
    link_radius : ndarray, shape (m,), or None
        ρ of each speaker; NaN for one that nobody hears. None without any link.
    link_mean_time_up, link_mean_time_down : ndarray, shape (m,), or None
        Of each speaker's links.
    link_stationary : bool
        Whether links begin in the law of a long time.
    relays : int or None
        How many players may pass on a report; None for any number.
    common_frame : bool
        Whether members also report where they are.
    disturbance : ndarray, shape (n + 2,)
        ς of every player.
    """

    mean_time_to_failure: Floats
    mean_time_to_repair: Floats
    mean_time_detected: Floats
    mean_time_missed: Floats
    stationary: NDArray[np.bool_]
    link_radius: Floats | None
    link_mean_time_up: Floats | None
    link_mean_time_down: Floats | None
    link_stationary: bool
    relays: int | None
    common_frame: bool
    disturbance: Floats

    @property
    def fails(self) -> bool:
        """Whether a sensor or an edge may fail."""
        return bool(np.isfinite([self.mean_time_to_failure, self.mean_time_detected]).any())

    @property
    def talks(self) -> bool:
        """Whether anyone may be heard."""
        return self.link_radius is not None

    @property
    def shakes(self) -> bool:
        """Whether any player is disturbed."""
        return bool(self.disturbance.any())

    @property
    def is_random(self) -> bool:
        """Whether one start has many courses."""
        return self.fails or self.shakes or self.links_fail

    @property
    def links_fail(self) -> bool:
        """Whether a link that can be heard may fail."""
        if self.link_radius is None or self.link_mean_time_up is None:
            return False
        return bool(np.isfinite(self.link_mean_time_up[~np.isnan(self.link_radius)]).any())


def world_of(sc: Shape) -> World | None:
    """The world of a scenario; None where nothing can happen in it, which is the paper's game."""
    own = _Fields(sc)
    radius = own.over("communication", "radius", math.nan)
    links = None if np.isnan(radius).all() else radius
    talk = sc.communication
    world = World(
        **{name: own.over("sensing", name, math.inf) for name in (*SENSORS, *DETECTIONS)},
        stationary=np.array([own.of(i, "sensing", "begin") == "stationary" for i in range(own.m)]),
        link_radius=links,
        link_mean_time_up=None if links is None else own.over("communication", "mean_time_up", math.inf),
        link_mean_time_down=None if links is None else own.over("communication", "mean_time_down", math.inf),
        link_stationary=talk is not None and talk.begin == "stationary",
        relays=None if talk is None else talk.relays,
        common_frame=talk is not None and talk.frame == "common",
        disturbance=_disturbances(sc),
    )
    return world if world.fails or world.talks or world.shakes else None


class _Fields:
    """The fields of the players with limited sight: each one's own, or else the common one."""

    def __init__(self, sc: Shape) -> None:
        self.sc, self.m = sc, len(sc.constrained)
        self.players: list[Any] = [*sc.defenders, sc.target][: self.m]

    def where(self, i: int) -> tuple[str | int, ...]:
        return ("defenders", i) if i < self.sc.n else ("target",)

    def own(self, i: int, table: str, name: str) -> Any:
        return getattr(getattr(self.players[i], table), name, None)

    def common(self, table: str, name: str) -> Any:
        return getattr(getattr(self.sc, table), name, None)

    def of(self, i: int, table: str, name: str) -> Any:
        found = self.own(i, table, name)
        return self.common(table, name) if found is None else found

    def over(self, table: str, name: str, default: float) -> Floats:
        values = (self.of(i, table, name) for i in range(self.m))
        return np.array([default if value is None else value for value in values], dtype=np.float64)

    def given(self, table: str, name: str) -> Iterator[tuple[tuple[str | int, ...], Any, range]]:
        """Where a field is given, its value, and the players whom it may concern."""
        common = self.common(table, name)
        if common is not None:
            yield (table, name), common, range(self.m)
        for i in range(self.m):
            value = self.own(i, table, name)
            if value is not None:
                yield (*self.where(i), table, name), value, range(i, i + 1)


def _disturbances(sc: Shape) -> Floats:
    common = sc.disturbance
    sizes = [(d.disturbance, common and common.defenders) for d in sc.defenders]
    sizes += [(sc.target.disturbance, common and common.target), (sc.attacker.disturbance, common and common.attacker)]
    return np.array([own if own is not None else shared or 0.0 for own, shared in sizes])


def link_radii(sc: Shape) -> Iterator[tuple[tuple[str | int, ...], float]]:
    """Every ρ that is given, and where."""
    return ((where, radius) for where, radius, _ in _Fields(sc).given("communication", "radius"))


def problems(sc: Shape) -> list[Problem]:
    """What is given in the tables and does nothing in this game."""
    own = _Fields(sc)
    found = [*_empty_tables(sc, own), *_alone(sc, own)]
    if found:
        return found
    for table, first, then in (("sensing", *SENSORS), ("sensing", *DETECTIONS), ("communication", *LINKS)):
        found += _idle(own, table, then, (first,), f"{first} is not given")
    neither = f"neither {SENSORS[0]} nor {DETECTIONS[0]} is given"
    found += _idle(own, "sensing", "begin", (SENSORS[0], DETECTIONS[0]), neither)
    for name in ("mean_time_up", "relays", "frame"):
        found += _idle(own, "communication", name, ("radius",), "nobody is heard: radius is not given")
    return found + _idle(own, "communication", "begin", ("mean_time_up",), "mean_time_up is not given")


def _idle(own: _Fields, table: str, name: str, needs: tuple[str, ...], why: str) -> list[Problem]:
    """A field that says how something goes on which does not happen."""
    return [
        (where, value, f"left out: {why}")
        for where, value, players in own.given(table, name)
        if not any(own.of(i, table, need) is not None for i in players for need in needs)
    ]


def _empty_tables(sc: Shape, own: _Fields) -> Iterator[Problem]:
    tables: list[tuple[tuple[str | int, ...], Any]]
    tables = [((name,), getattr(sc, name)) for name in ("sensing", "communication", "disturbance")]
    for i, player in enumerate(own.players):
        tables += [((*own.where(i), name), getattr(player, name)) for name in ("sensing", "communication")]
    for where, table in tables:
        if table is not None and not table.model_dump():
            fields = ", ".join(type(table).model_fields)
            yield where, {}, f"left out, or a table with some of its fields: {fields}"


def _alone(sc: Shape, own: _Fields) -> Iterator[Problem]:
    """Links in a team of one."""
    if own.m > 1:
        return
    rule = f"left out: {sc.constrained[0]} is the only player with limited sight, and has nobody to hear"
    own_place = (*own.where(0), "communication")
    for where, table in ((("communication",), sc.communication), (own_place, own.players[0].communication)):
        if table is not None:
            yield where, table.model_dump(), rule


def describe(sc: Shape) -> list[str]:
    """The world in a few lines; none for the paper's game."""
    world = world_of(sc)
    if world is None:
        return []
    lines = _grouped(sc.constrained, [_senses(world, i) for i in range(len(sc.constrained))])
    if world.talks:
        lines += _grouped(sc.constrained, [_is_heard(world, i) for i in range(len(sc.constrained))])
        passed = "passed on by any number" if world.relays is None else f"passed on at most {world.relays} times"
        frame = "what is seen, and the own place in a common frame" if world.common_frame else "what is seen"
        begin = "; links stationary from the start" if world.links_fail and world.link_stationary else ""
        lines.append(f"reports: {frame}; {passed}{begin}")
    lines += _grouped(sc.players, [f"disturbed, ς = {s:g}" if s > 0.0 else "" for s in world.disturbance])
    return lines + (["random: a game depends on seed and trial too"] if world.is_random else [])


def _grouped(players: tuple[str, ...], words: list[str]) -> list[str]:
    """One line for all players of whom the same is said."""
    lines = dict.fromkeys(word for word in words if word)
    return [f"{', '.join(p for p, w in zip(players, words, strict=True) if w == word)}: {word}" for word in lines]


def _senses(world: World, i: int) -> str:
    sensor = _chain("sensor fails", "works again", world.mean_time_to_failure[i], world.mean_time_to_repair[i])
    edge = _chain("a player in range is lost", "detected again", world.mean_time_detected[i], world.mean_time_missed[i])
    words = [part for part in (sensor, edge) if part]
    return "; ".join([*words, *(["stationary from the start"] if words and world.stationary[i] else [])])


def _is_heard(world: World, i: int) -> str:
    if world.link_radius is None or world.link_mean_time_up is None or world.link_mean_time_down is None:
        return ""
    radius = world.link_radius[i]
    if math.isnan(radius):
        return "heard by nobody"
    chain = _chain("a link fails", "works again", world.link_mean_time_up[i], world.link_mean_time_down[i])
    reach = "heard at any distance" if math.isinf(radius) else f"heard within {radius:g}"
    return "; ".join([reach, *([chain] if chain else [])])


def _chain(fails: str, returns: str, up: float, down: float) -> str:
    if math.isinf(up):
        return ""
    after = "for good" if math.isinf(down) else f"{returns} after {down:g}"
    return f"{fails} after {up:g} on average, {after}"
