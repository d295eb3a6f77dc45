"""What may vary within one game: positions, coordinates and radii of the players, and where each value goes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tadcore._shared.arrays import Floats
from tadcore.errors import ScenarioError

from .model import Scenario
from .paths import AXES, beyond, normal

STATES = ("position", "visibility_radius", "capture_radius")
"""The fields that are no part of the game: a run has them, and the game does not."""

_PURPOSES = {"position": 0, "visibility_radius": 1, "capture_radius": 2, "x": 3, "y": 4, "z": 5}


@dataclass(frozen=True)
class Quantity:
    """One position, coordinate or radius of one player."""

    path: str
    field: str
    row: int
    """The player's place in the order of the arrays of a batch: positions, or radii."""
    axis: int | None
    """The coordinate, where only one of a position varies."""
    components: int
    purpose: int
    """Number of the stream: 8 times the player's (attacker 0, target 1, then the defenders) plus the field's."""

    @property
    def of_game(self) -> bool:
        """Whether another value makes another game: a weight, the horizon or the step."""
        return self.field not in STATES

    @property
    def owner(self) -> str:
        """Path of the scenario's field that holds it."""
        return self.path if self.axis is None else self.path.rpartition(".")[0]

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of its columns in the table of a study."""
        if self.of_game and self.components > 1:
            return tuple(f"{self.path}.{i}" for i in range(self.components))
        if self.field != "position" or self.axis is not None:
            return (self.path,)
        return tuple(f"{self.path}.{AXES[axis]}" for axis in range(self.components))


def quantities_of(sc: Scenario) -> dict[str, Quantity]:
    """Every quantity that can vary, by its path."""
    team = range(sc.n)
    players = [("attacker", sc.n + 1, sc.n), ("target", sc.n, None), *((f"defenders.{i}", i, i) for i in team)]
    known: dict[str, Quantity] = {}
    for number, (player, place, capture) in enumerate(players):
        parts: list[tuple[str, str, int, int | None, int]] = [("position", "position", place, None, sc.dim)]
        parts += [("position", AXES[axis], place, axis, 1) for axis in range(sc.dim)]
        if place < len(sc.constrained):
            parts.append(("visibility_radius", "visibility_radius", place, None, 1))
        if capture is not None:
            parts.append(("capture_radius", "capture_radius", capture, None, 1))
        for field, part, row, axis, components in parts:
            path = f"{player}.{field}" + ("" if axis is None else f".{part}")
            known[path] = Quantity(path, field, row, axis, components, 8 * number + _PURPOSES[part])
    return known


def component(sc: Scenario, path: Any) -> Quantity:
    """The single number that a path means, such as ``attacker.position.x`` or ``d1.visibility_radius``."""
    found = quantities_of(sc).get(normal(path, "input"))
    if found is None or found.components > 1 or found.path.endswith(".position"):
        rule = "a number that varies within one game, such as attacker.position.x or d1.visibility_radius"
        raise ScenarioError("input", path, beyond(sc.n, path) or f"{rule}, of a player of this game")
    return found


def setups(sc: Scenario, varied: tuple[Quantity, ...], values: Floats) -> tuple[Floats, Floats, Floats]:
    """Positions (M, n + 2, dim), visibility and capture radii from one column for each component.

    Radii have one row for each trial, (M, m) and (M, n + 1), or where none of their kind varies one for all.
    """
    games = len(values)
    arrays = {"visibility_radius": sc.visibility_radii, "capture_radius": sc.capture_radii}
    arrays |= {"position": sc.positions}
    whole = {(quantity.field, quantity.row) for quantity in varied if quantity.axis is None}
    for name in {"position"} | {quantity.field for quantity in varied if not quantity.of_game}:
        common = arrays[name]
        arrays[name] = np.empty((games, *common.shape))
        for row in range(len(common)):
            if (name, row) not in whole:
                arrays[name][:, row] = common[row]
    column = 0
    for quantity in varied:
        drawn = values[:, column : column + quantity.components]
        column += quantity.components
        if quantity.of_game:
            continue
        if quantity.field != "position":
            arrays[quantity.field][:, quantity.row] = drawn[:, 0]
        elif quantity.axis is None:
            for axis in range(quantity.components):
                arrays["position"][:, quantity.row, axis] = drawn[:, axis]
        else:
            arrays["position"][:, quantity.row, quantity.axis] = drawn[:, 0]
    return arrays["position"], arrays["visibility_radius"], arrays["capture_radius"]


def core_setups(sc: Scenario, varied: tuple[Quantity, ...], values: Floats) -> tuple[Floats, Floats, Floats]:
    """The same as the core takes them: contiguous, radii of one row for each game or of one for all."""
    starts, sight, capture = (np.ascontiguousarray(np.atleast_2d(array)) for array in setups(sc, varied, values))
    return starts, sight, capture


def with_values(sc: Scenario, varied: tuple[Quantity, ...], values: Floats) -> Scenario:
    """The scenario of one game, from one number for each varied component: shape (1, components of all)."""
    positions, sight, capture = setups(sc, varied, values)
    arrays = {"position": positions, "visibility_radius": sight, "capture_radius": capture}
    changes: dict[str, Any] = {}
    column = 0
    for quantity in varied:
        own = values[0, column : column + quantity.components]
        column += quantity.components
        value = own if quantity.of_game else np.atleast_1d(arrays[quantity.field][0, quantity.row])
        changes[quantity.owner] = float(value[0]) if len(value) == 1 else value.tolist()
    return sc.replace(changes)
