"""One of n parts of a study, each run by a job of its own, and merged when all are done."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from tadcore._shared.arrays import as_index
from tadcore.errors import ScenarioError
from tadcore.game.outcome import DIVERGED, NO_EQUILIBRIUM
from tadcore.sampling.design import CHUNK
from tadcore.statistics.outcomes import KINDS
from tadcore.statistics.tally import Tally

from .place import Place

_MOST = 99_999


@dataclass(frozen=True)
class StudyPart:
    """What one part of a study has played; made by `Study.run` with ``part``.

    Attributes
    ----------
    part : tuple of int
        Which part, from 1, of how many.
    first : int
        The first trial.
    trials : int
        How many trials.
    tally : Tally
        How many ended in each way at each step.
    """

    part: tuple[int, int]
    first: int
    trials: int
    tally: Tally

    def counts(self) -> dict[str, int]:
        """How many games ended in each way; those that diverged, if any, are counted as ``"diverged"`` alone."""
        return named(self.tally)

    def __repr__(self) -> str:
        i, n = self.part
        ends = ", ".join(f"{count:,} {name}" for name, count in self.counts().items())
        return f"StudyPart({i} of {n}: {self.trials:,} trials from {self.first:,} on: {ends})"


def named(tally: Tally) -> dict[str, int]:
    """Counts by the kind of the end; those that diverged and those without an equilibrium, if any, apart and last."""
    counts = dict(zip((*KINDS, DIVERGED, NO_EQUILIBRIUM), map(int, tally.kinds()), strict=True))
    return {name: count for name, count in counts.items() if count or name in KINDS}


def as_part(value: Any) -> tuple[int, int]:
    """Which part of how many, counted from 1; raises `ScenarioError`."""
    rule = "(i, n): part i, from 1, of n"
    if not isinstance(value, tuple | list) or len(value) != 2:
        raise ScenarioError("part", value, rule)
    n = as_index("part[1]", value[1], _MOST, least=1)
    return as_index("part[0]", value[0], n, least=1), n


def chunks_of(part: tuple[int, int] | None, trials: int) -> range:
    """The chunks of a part of a study, or of all of it: as many in each part, up to one."""
    chunks = -(-trials // CHUNK)
    if part is None:
        return range(chunks)
    i, n = part
    return range(chunks * (i - 1) // n, chunks * i // n)


def place_of(part: tuple[int, int] | None, store: Place) -> Place:
    """Where a part is stored: readers of Parquet pass over it until it is merged."""
    return store if part is None else store.inside(f"_part-{part[0]:05d}-of-{part[1]:05d}")
