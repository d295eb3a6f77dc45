"""Radii at which the outcome of single trials changes, by bisection of all of them at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import Floats, as_amount
from tadcore.errors import ScenarioError
from tadcore.game.outcome import OutcomeKind
from tadcore.simulation.batch import Batch
from tadcore.statistics.single_radii import Breakpoints

from .replays import Replays


def breakpoints(games: Replays, grid: Floats, played: list[Batch], tolerance: float) -> Breakpoints:
    """Bisect every change between neighbouring radii, all trials at once."""
    if not as_amount("tolerance", tolerance) > 0.0:
        raise ScenarioError("tolerance", tolerance, "a positive number")
    codes = np.array([_code(batch) for batch in played])
    cell, trial = np.nonzero(codes[1:] != codes[:-1])
    low, top = grid[cell], grid[cell + 1]
    if np.isinf(top).any():
        raise ScenarioError("radii", np.inf, "finite where refine is asked for: no bisection ends at infinity")
    before, goal = codes[cell, trial], codes[cell + 1, trial]
    found: list[tuple[NDArray[np.int64], Floats, NDArray[np.int64], NDArray[np.int64]]] = []
    while len(trial):
        high, after = top.copy(), goal.copy()
        open_ = np.ones(len(trial), dtype=bool)
        while True:
            middle = low + (high - low) / 2.0
            open_ &= (high - low > tolerance) & (middle > low) & (middle < high)
            if not open_.any():
                break
            now = _code(games.play(middle[open_], trial[open_]))
            same = now == before[open_]
            where = np.flatnonzero(open_)
            low[where[same]] = middle[where[same]]
            high[where[~same]] = middle[where[~same]]
            after[where[~same]] = now[~same]
        found.append((trial, high, before, after))
        on = after != goal  # another outcome lies between: continue from there
        trial, low, top, before, goal = trial[on], high[on], top[on], after[on], goal[on]
    trials, radius, first, second = (np.concatenate(part) for part in zip(*found, strict=True)) if found else _NONE
    order = np.lexsort((radius, trials))
    below, above = first[order], second[order]
    return Breakpoints(
        trial=trials[order],
        radius=radius[order],
        kind_before=_kind(below),
        kind_after=_kind(above),
        defender_before=_defender(below),
        defender_after=_defender(above),
        diverged_before=below == _LOST,
        diverged_after=above == _LOST,
        tolerance=float(tolerance),
    )


def _code(batch: Batch) -> NDArray[np.int64]:
    """Kind and defender in one number; all games that diverged are one outcome, as in every table."""
    sound = (batch.kind.astype(np.int64) << 32) + (batch.defender.astype(np.int64) + 1)
    return np.where(batch.diverged, _LOST, sound)


def _kind(code: NDArray[np.int64]) -> NDArray[np.int8]:
    return np.where(code == _LOST, OutcomeKind.TIMEOUT, code >> 32).astype(np.int8)


def _defender(code: NDArray[np.int64]) -> NDArray[np.int32]:
    return ((code & 0xFFFFFFFF) - 1).astype(np.int32)


_LOST = 1 << 62  # of games that diverged; has no defender in its lower half
_NONE = (np.empty(0, dtype=np.int64), np.empty(0), np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64))
