"""One compiled game for all scenarios that share weights, horizon and grid.

Positions, visibility radii and capture radii are not part of a game, so every run and every batch with the same
weights shares one Riccati solution and one table of gains.
"""

from __future__ import annotations

import os
import threading
from collections import OrderedDict
from collections.abc import Hashable
from typing import Any

import numpy as np

from tadcore import _core
from tadcore.scenario.model import Scenario
from tadcore.scenario.worlds import DETECTIONS, SENSORS

_KEPT = 8
_games: OrderedDict[Hashable, _core.Game] = OrderedDict()
_lock = threading.Lock()


def _after_fork() -> None:
    """In a child no thread is left that could release the lock: it starts with a new one."""
    global _lock
    _lock = threading.Lock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)


def game_of(sc: Scenario) -> _core.Game:
    """The compiled game of a valid scenario, from a small cache keyed on its weights, horizon and grid."""
    arguments = _arguments(sc)
    key = tuple(arguments.items())
    with _lock:
        game = _games.get(key)
        if game is None:
            game = _games[key] = _core.Game(**{name: _array(value) for name, value in arguments.items()})
            while len(_games) > _KEPT:
                _games.popitem(last=False)
        _games.move_to_end(key)
        return game


def core_world(sc: Scenario) -> _core.World | None:
    """What surrounds the game of a scenario, as the core takes it; None for the paper's game."""
    world = sc.world
    if world is None:
        return None
    given = {name: getattr(world, name) for name in ("stationary", "disturbance", *SENSORS, *DETECTIONS)}
    if world.link_radius is not None:
        given["link_radius"] = [None if np.isnan(radius) else radius for radius in world.link_radius.tolist()]
        names = ("link_mean_time_up", "link_mean_time_down", "link_stationary", "relays", "common_frame")
        given |= {name: getattr(world, name) for name in names}
    return _core.World(**given)


def _arguments(sc: Scenario) -> dict[str, Any]:
    """What the compiled game is built from; hashable, and nothing else of the scenario."""
    team = sc.defenders
    arguments: dict[str, Any] = {
        "interaction": sc.interaction,
        "horizon": sc.horizon,
        "step": sc.step,
        "defender_control_weight": tuple(d.control_weight for d in team),
        "target_control_weight": sc.target.control_weight,
        "attacker_control_weight": sc.attacker.control_weight,
        "attacker_target_running_weight": sc.attacker.target_running_weight,
        "attacker_target_terminal_weight": sc.attacker.target_terminal_weight,
        "evasion_running_weight": tuple(d.evasion_running_weight for d in team),
        "evasion_terminal_weight": tuple(d.evasion_terminal_weight for d in team),
        "synthesis_weights": sc.synthesis_weights,
    }
    if sc.feedback == "receding":
        arguments["prediction_horizon"] = sc.prediction_horizon
    if sc.criterion == "component":
        arguments["criterion"] = sc.criterion
    if sc.interaction == "I1":
        arguments |= {
            "defender_running_weight": tuple(d.running_weight for d in team),
            "defender_terminal_weight": tuple(d.terminal_weight for d in team),
            "target_running_weight": sc.target.running_weight,
            "target_terminal_weight": sc.target.terminal_weight,
            "evasion": sc.attacker.evasion,
        }
    return arguments


def _array(value: Any) -> Any:
    return np.array(value, dtype=np.float64) if isinstance(value, tuple) else value
