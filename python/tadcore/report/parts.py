"""What a page is made of, and the shape of the result that it shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from tadcore.statistics import TrialOutcomes


class Asked(Protocol):
    """What a study says of itself; `tadcore.Study` does."""

    @property
    def vary(self) -> Mapping[str, Any]:
        """The sampler of every path."""

    @property
    def trials(self) -> int:
        """How many trials were asked for."""

    @property
    def design(self) -> str:
        """How the trials are spread: ``"random"``, ``"sobol"`` or ``"latin"``."""


class Reported(TrialOutcomes, Protocol):
    """A result that knows its study; `tadcore.StudyResult` does."""

    @property
    def study(self) -> Asked:
        """What was asked for."""


MOST_SHOWN = 1 << 20
"""Trials of which single ones are looked at."""


def shown(result: Reported) -> Reported | None:
    """The trials whose single outcomes are looked at: all, the first of a long study, or none where none is kept."""
    rows = getattr(result, "rows", None)
    if rows is not None and not rows.names:
        return None
    head: Any = getattr(result, "head", None)
    few: Reported = result if head is None or result.trials <= MOST_SHOWN else head(MOST_SHOWN)
    return few


@dataclass(frozen=True)
class Row:
    """A row of a table; a part belongs to the row above it."""

    name: str
    cells: Sequence[str]
    part: bool = False


@dataclass(frozen=True)
class Table:
    """A table with its caption; ``text`` where its cells are words."""

    caption: str
    head: Sequence[str]
    rows: Sequence[Row]
    text: bool = False


@dataclass(frozen=True)
class Picture:
    """A figure as base64 of a PNG."""

    caption: str
    data: str
    wide: bool = False


@dataclass(frozen=True)
class Code:
    """A text to unfold."""

    title: str
    body: str


@dataclass(frozen=True)
class Section:
    """A part of the page."""

    title: str
    paragraphs: Sequence[str] = ()
    tables: Sequence[Table] = ()
    figures: Sequence[Picture] = ()
    code: Sequence[Code] = ()
