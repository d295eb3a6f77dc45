"""Who decided how many trials a study has: the user beforehand, or a rule that looked at the outcomes.

An interval for a fixed number of trials does not hold where the outcomes decided when to stop, nor where they decided
to go on to the end. Wherever a rule was asked, stopped or not, every statistic uses confidence sequences instead.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from tadcore.errors import ScenarioError, shorten

from .outcomes import as_level

_LEVEL = 0.95


@dataclass(frozen=True)
class Stopping:
    """The rule that was asked after every chunk of a study.

    Attributes
    ----------
    rule : str
        The rule, as it prints.
    level : float
        The confidence level of the rule's own intervals; 0.95 for a rule without one.
    held : bool
        Whether it stopped the study.
    chunk : int
        Trials between two looks at the outcomes.
    """

    rule: str
    level: float
    held: bool
    chunk: int

    def __str__(self) -> str:
        return f"stopped by {self.rule}" if self.held else f"not stopped by {self.rule}"

    def looks(self, trials: int) -> int:
        """How often the rule was asked in so many trials, the last time included."""
        return -(-trials // self.chunk)


def stopping_by(rule: Any, *, held: bool, chunk: int) -> Stopping:
    """What is kept of a rule: how it prints, and its level where it has one."""
    text = shorten(rule)
    named = " at 0x" not in text  # the default repr is an address, another in every process
    try:
        level = as_level(getattr(rule, "level", _LEVEL))
    except ScenarioError:
        level = _LEVEL
    return Stopping(text if named else type(rule).__name__, level, held, chunk)


def stopping_of(result: Any) -> Stopping | None:
    """The rule that was asked while the trials came in; None where their number was fixed beforehand."""
    found = getattr(result, "stopping", None)
    return found if isinstance(found, Stopping) else None


def level_of(stopping: Stopping | None, level: float | None) -> float:
    """The level that was asked for; else the rule's, else 0.95."""
    if level is None:
        return _LEVEL if stopping is None else stopping.level
    return as_level(level)


def kept(stopping: Stopping) -> dict[str, Any]:
    """A rule as an entry of a file; see `from_kept`."""
    return {"rule": stopping.rule, "level": stopping.level}


def from_kept(entry: Mapping[str, Any] | None, *, held: bool, chunk: int) -> Stopping | None:
    """The rule that a file names; a file that only says that one held does not know which."""
    if entry is None:
        return Stopping("a rule", _LEVEL, held, chunk) if held else None
    if not isinstance(entry.get("rule"), str):
        raise ValueError(f"its rule is {shorten(entry)}")
    return Stopping(entry["rule"], as_level(entry.get("level")), held, chunk)
