"""What a number of a scenario must be: one rule for each kind, of one number and of arrays alike, with its words."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

LIGHTEST, HEAVIEST, FARTHEST = 1e-30, 1e30, 1e100
"""Bounds of weights and of coordinates, far beyond any game: within them the numbers of a game stay finite."""

FINEST = 1e-12
"""The least visibility radius, relative to the largest distance from the attacker along an axis.

States are relative to the attacker and rounded by a 1e-16th of that distance: of players much farther from it than from
one another it could not be told who sees whom.
"""

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
LINK_RADIUS = Rule("a positive number, or inf for links at any distance", RADIUS.holds)
MEAN_TIME = Rule(
    "a mean time between 1e-100 and 1e100, or inf", lambda v: ((v >= 1 / FARTHEST) & (v <= FARTHEST)) | (v == math.inf)
)
DISTURBANCE = Rule("a number between 0 and 1e100", lambda v: (v >= 0.0) & (v <= FARTHEST))

OF_FIELD = {
    "position": (FINITE, COORDINATE),
    "visibility_radius": (RADIUS,),
    "capture_radius": (POSITIVE,),
    "weight": (WEIGHT,),
    "fraction": (FRACTION,),
    "synthesis_weights": (FRACTION,),
    "horizon": (POSITIVE,),
    "step": (POSITIVE,),
}
"""The rules of what may vary from trial to trial, within one game and between games."""

_DIVIDES = 1e-9


def divides(horizon: Any, step: Any) -> Any:
    """Whether δ goes into T a whole number of times, up to rounding."""
    ratio = horizon / step
    return (abs(ratio - ratio.round()) <= _DIVIDES * ratio) & (ratio > 0.5) & (ratio <= 1e9)


def can_be_told(sight: Any, extent: Any) -> Any:
    """Whether rounding does not decide who is seen; ``extent``: the largest distance from the attacker on an axis."""
    return sight >= FINEST * extent


def too_far(extent: float) -> str:
    """What a visibility radius must be for `can_be_told`."""
    return f"at least {FINEST:g} of the largest distance from the attacker along an axis ({extent:g}), or inf"


def sees_whom_it_intercepts(capture: Any, sight: Any) -> Any:
    """Whether a defender sees whom it intercepts: σ < ζ."""
    return capture < sight
