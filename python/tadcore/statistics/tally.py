"""How many trials ended in each way at each step: all that probabilities, incidence and stopping rules need.

A tally of a billion trials has as many numbers as there are (outcome, step) that occurred, so tallies are what workers
send, what a study keeps that keeps nothing else, and what is added up in any order.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tadcore._shared.arrays import Floats, Integers, as_real, refuse_where
from tadcore.errors import ScenarioError
from tadcore.game.outcome import DIVERGED, NO_EQUILIBRIUM, UNPLAYED, OutcomeKind

from .outcomes import KINDS, outcome_names

_OFF_GRID = 1e-6  # steps
_DENSE = 2**16  # counters that are cheaper than sorting, whatever the number of trials


@dataclass(frozen=True, eq=False, repr=False)
class Tally:
    """Trials by outcome and step.

    Attributes
    ----------
    n : int
        Number of defenders.
    steps : int
        K; a trial ends at a step from 0 to K.
    cells : ndarray of int64
        The (outcome, diverged, step) that occurred, ascending: (2 outcome + diverged) (K + 1) + step, where the outcome
        is 0 for a timeout, 1 for a capture, 1 + i for an interception by the i-th defender, and 2 + n for a game
        without an equilibrium.
    count : ndarray of int64
        How many trials are in each, at least one.
    """

    n: int
    steps: int
    cells: Integers
    count: Integers

    @classmethod
    def empty(cls, n: int, steps: int) -> Tally:
        """No trial."""
        nothing = np.zeros(0, dtype=np.int64)
        return cls(n, steps, nothing, nothing)

    @classmethod
    def of(
        cls, kind: NDArray[Any], defender: NDArray[Any], diverged: NDArray[Any], step: NDArray[Any], n: int, steps: int
    ) -> Tally:
        """Count trials: codes of `OutcomeKind` (3: not played), defenders, whether they diverged, steps."""
        code = np.where(kind == OutcomeKind.INTERCEPTED, OutcomeKind.INTERCEPTED + defender, kind)
        code = np.where(kind == UNPLAYED, OutcomeKind.INTERCEPTED + n, code)
        cells = (2 * code.astype(np.int64) + diverged) * (steps + 1) + step
        size = 2 * (len(OutcomeKind) + n) * (steps + 1)
        if size <= max(_DENSE, len(cells)):
            dense = np.bincount(cells, minlength=size)
            found = np.flatnonzero(dense)
            return cls(n, steps, found.astype(np.int64), dense[found].astype(np.int64))
        found, count = np.unique(cells, return_counts=True)
        return cls(n, steps, found, count.astype(np.int64))

    @classmethod
    def sum(cls, tallies: Iterable[Tally], n: int, steps: int) -> Tally:
        """All trials of several tallies of one game."""
        parts = [cls.empty(n, steps), *tallies]
        size = 2 * (len(OutcomeKind) + n) * (steps + 1)
        if size <= max(_DENSE, sum(len(part.cells) for part in parts)):
            dense = np.zeros(size, dtype=np.int64)
            for part in parts:
                dense[part.cells] += part.count  # which has no cell twice
            found = np.flatnonzero(dense)
            return cls(n, steps, found.astype(np.int64), dense[found])
        cells, place = np.unique(np.concatenate([part.cells for part in parts]), return_inverse=True)
        count = np.zeros(len(cells), dtype=np.int64)
        np.add.at(count, place.reshape(-1), np.concatenate([part.count for part in parts]))
        left = count != 0
        return cls(n, steps, cells[left], count[left])

    def __add__(self, other: Tally) -> Tally:
        return Tally.sum([self, other], self.n, self.steps)

    def __sub__(self, other: Tally) -> Tally:
        """What is left without trials that are among these."""
        return self + Tally(self.n, self.steps, other.cells, -other.count)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Tally):
            return NotImplemented
        same = (self.n, self.steps) == (other.n, other.steps)
        return same and np.array_equal(self.cells, other.cells) and np.array_equal(self.count, other.count)

    __hash__ = None  # type: ignore[assignment]  # it has arrays in it

    @property
    def trials(self) -> int:
        """All of them."""
        return int(self.count.sum())

    @property
    def outcome(self) -> Integers:
        """The outcome of each cell: 0 timeout, 1 captured, 1 + i intercepted by the i-th defender, 2 + n not played."""
        return self.cells // (2 * (self.steps + 1))

    @property
    def unplayed(self) -> NDArray[np.bool_]:
        """Whether the games of each cell have no equilibrium."""
        return np.asarray(self.outcome == OutcomeKind.INTERCEPTED + self.n)

    @property
    def kind(self) -> Integers:
        """The code of `OutcomeKind` of each cell, 3 for no equilibrium."""
        return np.where(self.unplayed, UNPLAYED, np.minimum(self.outcome, OutcomeKind.INTERCEPTED))

    @property
    def diverged(self) -> NDArray[np.bool_]:
        """Whether the games of each cell diverged."""
        return np.asarray(self.cells // (self.steps + 1) % 2 == 1)

    @property
    def step(self) -> Integers:
        """The step of each cell."""
        return self.cells % (self.steps + 1)

    def kinds(self) -> Integers:
        """Trials by the kind of their end, then those that diverged, however they ended, then those not played."""
        code = np.where(self.diverged, len(OutcomeKind), np.where(self.unplayed, len(OutcomeKind) + 1, self.kind))
        return _summed(code, self.count, len(OutcomeKind) + 2)

    def outcomes(self) -> dict[str, int]:
        """How many trials ended in each outcome, by name, as `outcome_counts` has them.

        Raises
        ------
        ScenarioError
            There is no trial.
        """
        ended = self.ended().sum(axis=1)
        return dict(zip(self.names(), map(int, ended), strict=True))

    def names(self) -> tuple[str, ...]:
        """The rows of `ended`."""
        names = outcome_names(self.n, diverged=bool(self.diverged.any()))
        return (*names, NO_EQUILIBRIUM) if self.unplayed.any() else names

    def ended(self) -> Integers:
        """How many trials ended in each outcome at each step, shape (outcomes, K + 1).

        Raises
        ------
        ScenarioError
            There is no trial.
        """
        if not self.count.size:
            raise ScenarioError("kind", "no trials", "the outcomes of at least one trial")
        names = self.names()
        rows = np.zeros((len(names), self.steps + 1), dtype=np.int64)
        sound = ~self.diverged & ~self.unplayed
        np.add.at(rows, (self.kind[sound], self.step[sound]), self.count[sound])
        by = sound & (self.outcome >= OutcomeKind.INTERCEPTED)
        of_team: Integers = self.outcome[by] + (len(KINDS) - int(OutcomeKind.INTERCEPTED))
        rows[of_team, self.step[by]] = self.count[by]
        for name, apart in ((DIVERGED, self.diverged), (NO_EQUILIBRIUM, self.unplayed)):
            if name in names:
                rows[names.index(name)] = _summed(self.step[apart], self.count[apart], self.steps + 1)
        return rows

    def __repr__(self) -> str:
        return f"Tally({self.trials:,} trials in {len(self.cells):,} cells)"


def _summed(code: NDArray[Any], count: Integers, size: int) -> Integers:
    total = np.zeros(size, dtype=np.int64)
    np.add.at(total, code, count)
    return total


def instants(time: ArrayLike, trials: int, horizon: float, steps: int, *, between: bool) -> Integers:
    """The number k of each instant t_k, or with ``between`` of the first one at or after each time.

    Raises
    ------
    ScenarioError
        A time is off the grid, or beyond the horizon.
    """
    times = as_real("time", time, "an array of instants")
    if times.shape != (trials,):
        raise ScenarioError("time", f"shape {times.shape}", f"of shape ({trials},), one instant for each trial")
    whole, good = steps_of(times, horizon, steps, between=between)
    rule = f"a multiple of the step ({horizon / steps!r}) between 0 and the horizon ({horizon!r})"
    refuse_where("time", times, ~good, rule)
    return whole


def steps_of(time: Floats, horizon: float, steps: int, *, between: bool) -> tuple[Integers, NDArray[np.bool_]]:
    """As `instants`, with whether each time is one of the game's, up to rounding."""
    count = time / horizon * steps
    rounding = max(_OFF_GRID, 1e-15 * steps)
    with np.errstate(invalid="ignore"):
        if between:
            count = np.ceil(count - rounding)
        nearest = np.rint(count)
        good = np.abs(count - nearest) <= rounding
        good &= (nearest >= 0.0) & (nearest <= steps)
        return nearest.astype(np.int64), good
