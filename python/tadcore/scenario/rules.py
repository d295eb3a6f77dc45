"""The rules of a scenario that concern more than one field."""

from __future__ import annotations

import math

import numpy as np

from tadcore._shared.limits import can_be_told, sees_whom_it_intercepts, too_far
from tadcore.errors import MISSING

from . import worlds
from .fields import Problem
from .shape import Shape

TERMS = {"I1": 4, "I2": 3}
"""How many terms Θ has."""

_MOST_STEPS = 10_000_000
_DIVISION_TOLERANCE = 1e-9


def problems(sc: Shape) -> list[Problem]:
    """Everything that is wrong; ranges and worlds are looked at only where each part by itself is right."""
    found = _of_the_parts(sc) or [*_of_the_ranges(sc), *worlds.problems(sc)]
    return [*_of_the_grid(sc), *_of_the_feedback(sc), *found]


def _of_the_grid(sc: Shape) -> list[Problem]:
    ratio = sc.horizon / sc.step
    steps = round(ratio) if math.isfinite(ratio) else math.inf
    if steps > _MOST_STEPS:
        return [(("step",), sc.step, f"at least the horizon ({sc.horizon!r}) over {_MOST_STEPS:,}")]
    if steps < 1 or abs(ratio - steps) > _DIVISION_TOLERANCE * steps:
        return [(("step",), sc.step, f"a divisor of the horizon ({sc.horizon!r})")]
    return []


def _of_the_feedback(sc: Shape) -> list[Problem]:
    receding, ahead = sc.feedback == "receding", sc.prediction_horizon
    if receding and ahead is None:
        return [(("prediction_horizon",), MISSING, "given: T_h, the horizon over which P is solved")]
    if ahead is not None and not receding:
        return [(("prediction_horizon",), ahead, 'left out: feedback is not "receding"')]
    if sc.criterion == "component" and len(sc.constrained) == 1:
        rule = f'left out, or "paper": {sc.constrained[0]} is the only player with limited sight, and both say the same'
        return [(("criterion",), sc.criterion, rule)]
    return []


def _of_the_parts(sc: Shape) -> list[Problem]:
    found: list[Problem] = []
    terms = TERMS[sc.interaction]
    if len(sc.synthesis_weights) != terms:
        rule = f"a list of {terms} numbers in interaction {sc.interaction}"
        found.append((("synthesis_weights",), sc.synthesis_weights, rule))
    for where, part in sc.parts():
        for name, interaction in part.belongs.items():
            if name in part.model_fields_set and interaction != sc.interaction and getattr(part, name) is not None:
                rule = f"left out: it belongs to interaction {interaction}, and this is {sc.interaction}"
                found.append(((*where, name), getattr(part, name), rule))
        if len(part.position) != sc.dim:
            rule = f"a list of {sc.dim} numbers, as attacker.position is"
            found.append(((*where, "position"), part.position, rule))
    for i, d in enumerate(sc.defenders):
        if not sees_whom_it_intercepts(d.capture_radius, d.visibility_radius):
            rule = f"larger than the capture radius ({d.capture_radius!r})"
            found.append((("defenders", i, "visibility_radius"), d.visibility_radius, rule))
    return found


def _of_the_ranges(sc: Shape) -> list[Problem]:
    extent = float(np.abs(sc.positions - sc.positions[-1]).max())
    seers = sc.parts()[2:] + sc.parts()[1:2] * (sc.interaction == "I2")
    radii = zip(seers, sc.visibility_radii.tolist(), strict=True)
    found = [((*where, "visibility_radius"), radius) for (where, _), radius in radii]
    found += worlds.link_radii(sc)
    return [(where, radius, too_far(extent)) for where, radius in found if not can_be_told(radius, extent)]
