"""What a number of a scenario must be: one rule for each kind, of one number and of arrays alike, with its words."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

LIGHTEST, HEAVIEST, FARTHEST = 1e-30, 1e30, 1e100
"""Bounds of weights and of coordinates, far beyond any game: within them the numbers of a game stay finite."""

MOST_DEFENDERS = 1000
"""Far beyond what can be played; P of so many players fits into memory on the shortest grids only."""


@dataclass(frozen=True)
class Rule:
    """What a number must be: in words, and as a test of one number or of each in an array."""

    words: str
    holds: Callable[[Any], Any]


FINITE = Rule("a finite number", lambda v: abs(v) < math.inf)
COORDINATE = Rule("a coordinate between -1e100 and 1e100", lambda v: abs(v) <= FARTHEST)
POSITIVE = Rule("a positive finite number", lambda v: (v > 0.0) & (v < math.inf))
RADIUS = Rule("a positive number, or inf for unlimited sight", lambda v: v > 0.0)
WEIGHT = Rule("a weight between 1e-30 and 1e30", lambda v: (v >= LIGHTEST) & (v <= HEAVIEST))
FRACTION = Rule("a number in [0, 1]", lambda v: (v >= 0.0) & (v <= 1.0))

OF_FIELD = {"position": (FINITE, COORDINATE), "visibility_radius": (RADIUS,), "capture_radius": (POSITIVE,)}
"""The rules of what may vary within one game."""


def sees_whom_it_intercepts(capture: Any, sight: Any) -> Any:
    """Whether a defender sees whom it intercepts: σ < ζ."""
    return capture < sight
