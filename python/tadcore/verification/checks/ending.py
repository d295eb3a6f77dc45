"""Where and when a record begins, how it ends and whether it diverges, from the scenario alone.

The rule of the end: at every instant, first the nearest defender within its own capture radius intercepts; else the
attacker captures a target within σ_a; else, at t = T, time runs out.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from tadcore._shared.arrays import Floats
from tadcore.game.divergence import SIZE
from tadcore.simulation.run import Run
from tadcore.verification.report import Check

from .claims import RECORD

_NONE = 1.0  # the end is of a kind that no rounding of a distance can make
TINY = 1e-300


def distances(one: Floats, other: Floats) -> Floats:
    """Distances over the last axis, without overflow."""
    away = one - other
    largest = np.maximum(np.abs(away).max(axis=-1, keepdims=True), TINY)
    found: Floats = np.linalg.norm(away / largest, axis=-1) * largest[..., 0]
    return found


def check_start(run: Run) -> Check:
    """How far the first row is from the scenario's positions, relative to what rounding allows."""
    expected = run.scenario.positions
    size = np.abs(expected) + np.abs(expected[-1])  # the core adds the attacker's position to a relative one
    off = np.abs(run.position[0] - expected) / np.maximum(size, TINY)
    worst = int(np.argmax(off.max(axis=1)))
    return RECORD["record.start"].judge(float(off.max()), run.scenario.players[worst])


def grid(run: Run) -> Floats:
    """The doubles nearest to t_k = kT/K, by exact fractions, for every row of the record."""
    K, T = run.scenario.steps, Fraction(run.scenario.horizon)
    return np.array([float(T * k / K) for k in range(len(run.times))])


def check_times(run: Run) -> Check:
    """How far an instant is from the double nearest to kT/K, relative to it, or to δ at t = 0."""
    expected = grid(run)
    size = np.maximum(expected, run.scenario.horizon / run.scenario.steps)
    off = np.abs(run.times - expected) / size
    k = int(np.argmax(off))
    return RECORD["record.times"].judge(float(off[k]), f"row {k}" if off[k] else "")


def check_outcome(run: Run) -> Check:
    """By how much the end contradicts distances and capture radii, relative to both; 1 where no distance could."""
    worst, why = max(_contradictions(run), key=lambda found: found[0])
    return RECORD["record.outcome"].judge(worst, why if worst > 0.0 else f"{run.outcome}")


def stops_early(run: Run) -> bool:
    """Whether the last row is before the end, as where a game leaves the range of double precision."""
    return bool(np.size(run.times) and run.times[-1] < run.outcome.time)


def check_divergence(run: Run) -> Check:
    """By how much the distances contradict the recorded instant and size of the divergence, relative to both.

    A record that stops before its end tells a lower bound on the size.
    """
    at = run.position
    scale = max(float(distances(at[0][:, np.newaxis], at[0][np.newaxis]).max()), TINY)
    size = distances(at[:, :-1], at[:, -1:]).max(axis=1) / scale
    claim = RECORD["record.divergence"]
    if run.diverged is None:
        return claim.judge(max(float(size.max()) / SIZE - 1.0, 0.0), f"the largest size is {size.max():.3g}")
    named = np.flatnonzero(run.times == run.diverged.time)
    if not named.size:
        return claim.judge(_NONE, f"t = {run.diverged.time!r} is no instant of the record")
    k = int(named[0])
    before, then = float(size[:k].max(initial=0.0)), float(size[k])
    off = float(size.max()) / max(run.diverged.size, TINY) - 1.0
    off = off if stops_early(run) else abs(off)
    return claim.judge(
        max(before / SIZE - 1.0, 1.0 - then / SIZE, off), f"size {then:.6g} at t = {run.diverged.time:g}"
    )


def _contradictions(run: Run) -> list[tuple[float, str]]:
    """What speaks against the recorded end, by how much."""
    sc, outcome, last = run.scenario, run.outcome, len(run.times) - 1
    at = run.position
    distance = distances(at[:, :-1], at[:, -1:])
    size = sc.capture_radii + np.abs(at[:, :-1]).max(axis=-1) + np.abs(at[:, -1:]).max(axis=-1)
    depth = (sc.capture_radii - distance) / size  # positive within the radius
    found = [(0.0, "")]
    label = [*(f"d{i + 1}" for i in range(sc.n)), "the target"]
    if last:
        k, i = np.unravel_index(int(np.argmax(depth[:-1])), depth[:-1].shape)
        found.append((float(depth[k, i]), f"{label[i]} is within the capture radius at t = {run.times[k]:.6g} already"))
    expected = grid(run)[last]
    if outcome.time != expected:
        found.append((_NONE, f"the end is said to be at t = {outcome.time!r}, the last row is t = {float(expected)!r}"))
    team, target = depth[last, :-1], float(depth[last, -1])
    named = outcome.defender
    if outcome.kind == "intercepted":
        if not isinstance(named, int) or not 0 <= named < sc.n:
            return [*found, (_NONE, f"an interception by defender {named!r}")]
        found.append((-float(team[named]), f"d{named + 1} is beyond its capture radius at the end"))
        nearer = (distance[last, named] - distance[last, :-1]) / size[last, :-1]
        first = np.minimum(nearer, team)
        j = int(np.argmax(first))
        found.append((float(first[j]), f"d{j + 1} is nearer than d{named + 1}, within its capture radius"))
        return found
    if named is not None:
        found.append((_NONE, f"{outcome.kind}, and yet by defender {named!r}"))
    j = int(np.argmax(team))
    found.append((float(team[j]), f"d{j + 1} is within its capture radius at the end"))
    if outcome.kind == "captured":
        found.append((-target, "the target is beyond the attacker's capture radius at the end"))
    elif outcome.kind == "timeout":
        found.append((target, "the target is within the attacker's capture radius at the end"))
        if last != sc.steps:
            found.append((_NONE, f"time is said to run out after {last} of {sc.steps} steps"))
    else:
        found.append((_NONE, f"an end of kind {outcome.kind!r}"))
    return found
