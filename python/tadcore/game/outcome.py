"""How a game ends: an interception, a capture, or neither before T."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import Literal


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
    """

    kind: Literal["timeout", "captured", "intercepted"]
    defender: int | None
    time: float

    @classmethod
    def of(cls, code: int, defender: int, time: float) -> Outcome:
        """From the codes of a batch: an `OutcomeKind` and a 0-based index, -1 where no defender intercepted."""
        kinds: dict[OutcomeKind, Literal["timeout", "captured", "intercepted"]] = {
            OutcomeKind.TIMEOUT: "timeout",
            OutcomeKind.CAPTURED: "captured",
            OutcomeKind.INTERCEPTED: "intercepted",
        }
        return cls(kinds[OutcomeKind(code)], None if defender < 0 else int(defender), float(time))

    def __str__(self) -> str:
        when = f"t = {self.time:.10g}"
        if self.kind == "timeout":
            return f"time runs out at {when}"
        if self.kind == "captured":
            return f"the attacker captures the target at {when}"
        return f"d{(self.defender or 0) + 1} intercepts the attacker at {when}"
