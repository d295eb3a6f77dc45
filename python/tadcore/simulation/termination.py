"""When a game ends: at an instant of the grid, or between two, where a capture radius is crossed."""

from __future__ import annotations

from typing import Literal, TypeAlias

from tadcore.errors import ScenarioError

Termination: TypeAlias = Literal["sampled", "continuous"]
"""When a game ends: at an instant of the grid, or at the crossing of a capture radius itself."""

TERMINATIONS: tuple[Termination, ...] = ("sampled", "continuous")


def as_termination(value: object) -> Termination:
    """Return one of the two, or raise `ScenarioError`."""
    for known in TERMINATIONS:
        if isinstance(value, str) and value == known:
            return known
    raise ScenarioError("termination", value, " or ".join(f'"{known}"' for known in TERMINATIONS))
