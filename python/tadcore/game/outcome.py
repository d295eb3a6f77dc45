"""How a game ends: an interception, a capture, or neither before T."""

from __future__ import annotations

import enum
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray


class OutcomeKind(enum.IntEnum):
    """The codes of `tadcore.Batch.kind`."""

    TIMEOUT = 0
    """Time ran out at T."""
    CAPTURED = 1
    """The attacker came within its capture radius of the target."""
    INTERCEPTED = 2
    """A defender came within its capture radius of the attacker."""


@dataclass(frozen=True)
class Outcome:
    """How one game ended.

    Attributes
    ----------
    kind : {"timeout", "captured", "intercepted"}
        The lower-case name of the `OutcomeKind`.
    defender : int or None
        The intercepting defender, 0-based; None where none intercepted.
    time : float
        The instant, dimensionless as T.
    diverged : bool
        Whether the game had diverged by then, so that this end says nothing (`Divergence`); statistics count it apart.
        Two outcomes that differ in this alone are equal.
    """

    kind: Literal["timeout", "captured", "intercepted"]
    defender: int | None
    time: float
    diverged: bool = field(default=False, compare=False)

    @classmethod
    def of(cls, code: int, defender: int, time: float, *, diverged: bool = False) -> Outcome:
        """From the codes of a batch: an `OutcomeKind` and a 0-based index, -1 where no defender intercepted."""
        kinds: dict[OutcomeKind, Literal["timeout", "captured", "intercepted"]] = {
            OutcomeKind.TIMEOUT: "timeout",
            OutcomeKind.CAPTURED: "captured",
            OutcomeKind.INTERCEPTED: "intercepted",
        }
        return cls(kinds[OutcomeKind(code)], None if defender < 0 else int(defender), float(time), diverged)

    def __str__(self) -> str:
        when = f"t = {self.time:.10g}" + (", after the game diverged" if self.diverged else "")
        if self.kind == "timeout":
            return f"time runs out at {when}"
        if self.kind == "captured":
            return f"the attacker captures the target at {when}"
        return f"d{(self.defender or 0) + 1} intercepts the attacker at {when}"


DIVERGED = "diverged"
"""What tables call the games that diverged, beside the kinds of ends."""


NO_EQUILIBRIUM = "no_equilibrium"
"""What tables call the games that have no equilibrium on [0, T], which are not played."""

UNPLAYED = len(OutcomeKind)
"""Their code, after those of the kinds of ends, where games differ from trial to trial."""


def ending_names(n: int, *, games: bool = False) -> list[str]:
    """What tables call the ends of games of n defenders: those without an interception, who intercepted, diverged.

    Where every trial has a game of its own, ``games``, some may have no equilibrium.
    """
    team = (f"d{i + 1}" for i in range(n))
    return ["timeout", "captured", *team, DIVERGED, *([NO_EQUILIBRIUM] if games else [])]


def ending_codes(kind: NDArray[Any], defender: NDArray[Any], diverged: NDArray[np.bool_], n: int) -> NDArray[np.int32]:
    """The place of each end in `ending_names`; one that diverged is nothing else."""
    lost = OutcomeKind.INTERCEPTED + n
    code = np.where(kind == OutcomeKind.INTERCEPTED, OutcomeKind.INTERCEPTED + defender, kind)
    return np.where(diverged, lost, np.where(kind == UNPLAYED, lost + 1, code)).astype(np.int32)


def kind_counts(kind: NDArray[Any], diverged: NDArray[np.bool_]) -> dict[str, int]:
    """How many games ended in each way, by the name of the kind; those that diverged, if any, apart and last."""
    sound = kind[~diverged]
    counts = {code.name.lower(): int(np.count_nonzero(sound == code)) for code in OutcomeKind}
    lost = int(np.count_nonzero(diverged))
    return counts | {DIVERGED: lost} if lost else counts
