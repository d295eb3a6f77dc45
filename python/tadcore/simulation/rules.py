"""The radii that a batch takes, by the rules of `tadcore._shared.limits`; and which ends a disturbed game can have."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from tadcore._shared.arrays import Floats, as_real, refuse_where
from tadcore._shared.limits import OF_FIELD, can_be_told, sees_whom_it_intercepts, too_far
from tadcore.errors import ScenarioError
from tadcore.scenario.model import Scenario

from .termination import Termination


def visibility_rows(sc: Scenario, values: ArrayLike | None, games: int) -> Floats:
    """ζ of the m players with limited sight, one row for each game or one for all; the scenario's by default."""
    m = len(sc.constrained)
    shared = f"the radii of {', '.join(sc.constrained)}"
    given = as_real("visibility_radii", sc.visibility_radii if values is None else values, f"numbers: {shared}")
    if sc.interaction == "I1" and given.ndim in (1, 2) and given.shape[-1] == m + 1:
        target = given[..., m:]
        if not (np.isposinf(target)).all():
            rule = f"{m} columns, or inf in the target's: in I1 the target sees everything"
            raise ScenarioError("visibility_radii", f"shape {given.shape}", rule)
        given = given[..., :m]
    return _rows("visibility_radii", given, games, m, shared, "visibility_radius")


def capture_rows(sc: Scenario, values: ArrayLike | None, games: int) -> Floats:
    """σ of the defenders and the attacker, one row for each game or one for all; the scenario's by default."""
    shared = f"the radii of {', '.join(sc.players[: sc.n])}, attacker"
    given = as_real("capture_radii", sc.capture_radii if values is None else values, f"numbers: {shared}")
    return _rows("capture_radii", given, games, sc.n + 1, shared, "capture_radius")


def _rows(name: str, given: Floats, games: int, columns: int, meaning: str, field: str) -> Floats:
    """One row of positive radii for each game, or a single one for all."""
    if given.shape not in ((columns,), (games, columns)):
        shape = f"of shape ({columns},) or ({games}, {columns}): {meaning}"
        raise ScenarioError(name, f"shape {given.shape}", shape)
    for rule in OF_FIELD[field]:
        refuse_where(name, given, ~rule.holds(given), rule.words)
    return np.ascontiguousarray(np.atleast_2d(given))


def refuse_mismatched(sc: Scenario, starts: Floats, sight: Floats, capture: Floats) -> None:
    """Refuse defenders who do not see whom they intercept, σ ≥ ζ, and starts at which rounding decides who is seen."""
    n = sc.n
    bad = ~sees_whom_it_intercepts(capture[:, :n], sight[:, :n])
    shown = np.broadcast_to(sight[:, :n], bad.shape)
    refuse_where("visibility_radii", shown, bad, "larger than the defender's capture radius")
    extents = extents_of(starts)
    bad = ~can_be_told(sight, extents[:, None])
    if bad.any():
        farthest = float(extents[bad.any(axis=1)].max())
        refuse_where("visibility_radii", np.broadcast_to(sight, bad.shape), bad, too_far(farthest))
    world = sc.world
    if world is not None and world.link_radius is not None:
        lost = (~(np.isnan(world.link_radius) | can_be_told(world.link_radius, extents[:, None]))).any(axis=1)
        rule = f"such that the radius of communication is {too_far(float(extents[lost].max(initial=0.0)))}"
        refuse_where("positions", extents, lost, rule)


def refuse_between(sc: Scenario, termination: Termination, *, passes: bool = False) -> None:
    """Refuse what needs the path between two instants, where players are disturbed and it is not known."""
    world = sc.world
    if world is None or not world.shakes:
        return
    why = "players are disturbed, and where they are between two instants is not known"
    if termination == "continuous":
        raise ScenarioError("termination", termination, f'"sampled": {why}')
    if passes:
        raise ScenarioError("passes", passes, f"left out: {why}")


def extents_of(starts: Floats) -> Floats:
    """The largest distance from the attacker along an axis, of each game."""
    if not starts.size:
        return np.zeros(len(starts))
    low, high = starts.min(axis=1), starts.max(axis=1)
    attacker = starts[:, -1]
    return np.asarray(np.maximum(high - attacker, attacker - low).max(axis=1), dtype=np.float64)
