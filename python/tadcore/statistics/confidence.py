"""The level of an answer and the intervals that hold at it, be the number of trials fixed or chosen by a rule."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from numpy.typing import NDArray

from tadcore._shared.arrays import Floats

from .intervals import Method, band, ends
from .stopping import Stopping, level_of, stopping_of


@dataclass(frozen=True)
class Confidence:
    """A level, and the rule, if any, that was asked when to stop the study."""

    level: float
    stopping: Stopping | None

    @classmethod
    def of(cls, source: Any, level: float | None) -> Confidence:
        """What holds for a study or its result; the level is the rule's where none is given, else 0.95."""
        stopping = stopping_of(source)
        return cls(level_of(stopping, level), stopping)

    @property
    def paired(self) -> Literal["score", "sequence"]:
        """The method of intervals of paired differences."""
        return "score" if self.stopping is None else "sequence"

    @property
    def rule(self) -> str:
        """The rule in words; empty where the number of trials was fixed beforehand."""
        return "" if self.stopping is None else str(self.stopping)

    def ends(self, count: NDArray[Any], trials: int, fixed: Method) -> tuple[Floats, Floats]:
        """Intervals that hold one by one, by the method for a fixed number of trials where it was fixed."""
        return ends(count, trials, 1.0 - self.level, fixed if self.stopping is None else "sequence")

    def band(self, count: NDArray[Any], trials: int, places: int) -> tuple[Floats, Floats]:
        """Intervals that hold at so many places at once."""
        return band(count, trials, 1.0 - self.level, places, "exact" if self.stopping is None else "sequence")

    def attrs(self) -> dict[str, Any]:
        """Level and rule as attributes of a dataset."""
        return {"level": self.level, **({"rule": self.rule} if self.rule else {})}
