"""What makes a game another game: weights, horizon and step, as one row of numbers for each game.

A row has `SINGLE`, then each of `TEAM` for all defenders, then the weights γ of Θ: the order in which the core takes
them. What does not belong to the interaction has a place in the row and is not read.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tadcore._shared.arrays import Floats

from .model import Scenario
from .quantities import Quantity

SINGLE = (
    "horizon",
    "step",
    "target.control_weight",
    "attacker.control_weight",
    "attacker.target_running_weight",
    "attacker.target_terminal_weight",
    "target.running_weight",
    "target.terminal_weight",
    "attacker.evasion",
)
TEAM = (
    "control_weight",
    "evasion_running_weight",
    "evasion_terminal_weight",
    "running_weight",
    "terminal_weight",
)
GAMMA = "synthesis_weights"

_FIELDS = {"horizon": "horizon", "step": "step", "attacker.evasion": "fraction", GAMMA: "synthesis_weights"}
_PURPOSES = 1 << 32  # streams of their own, apart from those of positions and radii, whatever the number of defenders


def numbers_of(sc: Scenario) -> Floats:
    """The row of a scenario."""
    values: list[Any] = [_at(sc, path) for path in SINGLE]
    values += [_at(defender, name) for name in TEAM for defender in sc.defenders]
    return np.array([*values, *sc.synthesis_weights], dtype=np.float64)


def game_quantities_of(sc: Scenario) -> dict[str, Quantity]:
    """Every number of a scenario that makes another game, by its path; its ``row`` is the place in the row."""
    known = set(sc.paths)
    team = [(f"defenders.{i}.{name}", k, i) for k, name in enumerate(TEAM) for i in range(sc.n)]
    places = [(path, place, place) for place, path in enumerate(SINGLE)]
    places += [(path, len(SINGLE) + k * sc.n + i, len(SINGLE) + 1 + len(TEAM) * i + k) for path, k, i in team]
    places.append((GAMMA, len(SINGLE) + len(TEAM) * sc.n, len(SINGLE)))
    return {
        path: Quantity(
            path,
            _FIELDS.get(path, "weight"),
            place,
            None,
            len(sc.synthesis_weights) if path == GAMMA else 1,
            _PURPOSES + purpose,
        )
        for path, place, purpose in places
        if path in known
    }


def games_of(sc: Scenario, varied: tuple[Quantity, ...], values: Floats) -> Floats:
    """A row for each trial, from one column for each varied component, those of positions and radii among them."""
    rows = np.repeat(numbers_of(sc)[np.newaxis], len(values), axis=0)
    column = 0
    for quantity in varied:
        if quantity.of_game:
            rows[:, quantity.row : quantity.row + quantity.components] = values[
                :, column : column + quantity.components
            ]
        column += quantity.components
    return rows


def _at(where: Any, path: str) -> float:
    for name in path.split("."):
        where = getattr(where, name)
    return 1.0 if where is None else float(where)
