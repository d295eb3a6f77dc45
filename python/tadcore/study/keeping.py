"""What a study keeps of every trial."""

from __future__ import annotations

from typing import Any, Literal, TypeAlias, get_args

from tadcore.errors import ScenarioError

Keep: TypeAlias = Literal["all", "outcomes", "counts"]
"""Outcomes with what was drawn; outcomes, the draws being drawn again when asked for; or how many ended how."""

KEEPS: tuple[Keep, ...] = get_args(Keep)


def as_keep(value: Any) -> Keep:
    """One of the three; raises `ScenarioError`."""
    for keep in KEEPS:
        if isinstance(value, str) and value == keep:
            return keep
    raise ScenarioError("keep", value, " or ".join(f'"{keep}"' for keep in KEEPS))
