"""What is asked of one worker at a time, and what comes back: plain arrays, ready for another process."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import Floats
from tadcore.sampling.design import CHUNK
from tadcore.statistics.tally import Tally

from .keeping import Keep


class Outcomes(NamedTuple):
    """How the trials of a chunk ended: plain arrays of one length, ready for another process."""

    kind: NDArray[np.int8]
    defender: NDArray[np.int32]
    time: Floats
    diverged: NDArray[np.bool_]
    inputs: Floats | None
    """What was drawn, one column for each varied component; None where it is drawn again when asked for."""
    passed: NDArray[np.bool_] | None = None
    """Whether a capture radius was entered between two instants, where that is looked for."""


class Task(NamedTuple):
    """What is asked of one worker at a time: a group of consecutive chunks."""

    first: int
    """The first chunk."""
    trials: int
    """Trials from the beginning of the first chunk on; only the last chunk may be cut."""
    keep: Keep
    """What comes back: outcomes with their inputs, outcomes, or their counts alone."""
    apart: bool
    """Whether the chunks are counted one by one, for a rule that is asked after each."""

    @property
    def many(self) -> int:
        """How many chunks."""
        return -(-self.trials // CHUNK)

    @property
    def last(self) -> int:
        """The last chunk."""
        return self.first + self.many - 1

    def chunks(self) -> list[tuple[int, int]]:
        """Every chunk with the number of its trials."""
        return [(self.first + i, rows) for i, rows in enumerate(rows_of_chunks(self.trials))]


class Written(NamedTuple):
    """Rows that somebody has put into the store."""

    first: int
    """The first trial."""
    end: int
    """One past the last."""
    digests: tuple[str, ...]
    """SHA-256 of every chunk."""


class Played(NamedTuple):
    """What a worker returns."""

    task: Task
    tallies: tuple[Tally, ...]
    """The counts of the group, or of each of its chunks."""
    outcomes: tuple[Outcomes, ...]
    """Those of every chunk; empty where only counts are kept, and where the worker has written them itself."""
    seconds: float
    """How long it took."""
    written: tuple[Written, ...] = ()
    """What it has written, in place of the outcomes."""


def rows_of_chunks(trials: int) -> list[int]:
    """How many trials each chunk has."""
    whole, rest = divmod(trials, CHUNK)
    return [CHUNK] * whole + [rest] * (rest > 0)
