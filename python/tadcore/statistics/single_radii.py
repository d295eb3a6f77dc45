"""Single radii that matter: where the outcome of a trial changes, and the smallest at which one is probable enough."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import Floats, Integers
from tadcore._shared.shares import estimate, percent, share


@dataclass(frozen=True, eq=False, repr=False)
class Breakpoints:
    """Radii at which the outcome of a trial changes, ordered by trial, then by radius.

    Attributes
    ----------
    trial : ndarray of int, shape (B,)
        Which trial.
    radius : ndarray, shape (B,)
        The least radius at which the new outcome holds, to within ``tolerance`` from above.
    kind_before, kind_after : ndarray of int8, shape (B,)
        Codes of `OutcomeKind` below and at ``radius``; 0 where the game diverged.
    defender_before, defender_after : ndarray of int32, shape (B,)
        The intercepting defender, 0-based; -1 where none intercepts.
    diverged_before, diverged_after : ndarray of bool, shape (B,)
        Whether the game diverged below and at ``radius``: an outcome of its own, however the game then ended.
    tolerance : float
        How far above the true breakpoint ``radius`` may lie.
    """

    trial: Integers
    radius: Floats
    kind_before: NDArray[np.int8]
    kind_after: NDArray[np.int8]
    defender_before: NDArray[np.int32]
    defender_after: NDArray[np.int32]
    diverged_before: NDArray[np.bool_]
    diverged_after: NDArray[np.bool_]
    tolerance: float

    def __len__(self) -> int:
        return len(self.trial)

    def __repr__(self) -> str:
        lost = int(np.count_nonzero(self.diverged_before | self.diverged_after))
        of = f", {lost:,} of them into or out of a divergence" if lost else ""
        return f"Breakpoints({len(self):,} in {len(np.unique(self.trial)):,} trials{of})"


@dataclass(frozen=True, repr=False)
class SmallestRadius:
    """The smallest radius at which an outcome is probable enough with confidence, or that there is none.

    Attributes
    ----------
    outcome : str
        The event.
    at_least : float
        What its probability was to reach.
    radius : float or None
        The smallest of the radii played whose band begins at ``at_least`` or above; None where none does.
    best : float
        The radius where the event came most often.
    estimate, low, high : float
        P(outcome) at ``radius``, or at ``best`` where there is none, with the band that holds at all radii at once.
    level : float
        Confidence level of the band.
    """

    outcome: str
    at_least: float
    radius: float | None
    best: float
    estimate: float
    low: float
    high: float
    level: float

    def __repr__(self) -> str:
        shown = " ".join(estimate(self.estimate, self.low, self.high))
        found = f"P({self.outcome}) = {shown}, {percent(self.level)} at all radii at once"
        if self.radius is None:
            return f"none reaches {share(self.at_least, 2)}; the best is {self.best:g}: {found}"
        return f"{self.radius:g}: {found}"
