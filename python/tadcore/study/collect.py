"""Every chunk of a study, stored or played, counted in order, up to where a rule stops it."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable
from concurrent.futures import Executor
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from tadcore.errors import WorkerError
from tadcore.game.outcome import OutcomeKind
from tadcore.sampling.design import CHUNK
from tadcore.statistics.stopping import Stopping, kept, stopping_by
from tadcore.statistics.tally import Tally

from .elsewhere import Reached
from .keepers import Keeper
from .parts import Joined
from .plan import Plan
from .progress import Progress
from .workers import LostWorkerError, Wanted, played_by


@runtime_checkable
class StoppingRule(Protocol):
    """When a study has seen enough, such as `tadcore.statistics.HalfWidth`."""

    def satisfied(self, counts: NDArray[np.int64], trials: int) -> bool:
        """Whether the counts of the outcomes, by `OutcomeKind`, after so many trials are enough.

        Trials that diverged are in no count; the counts then sum to less than ``trials``.
        """
        ...


class Collection:
    """The chunks of a study, up to where a rule holds.

    Parameters
    ----------
    plan : Plan
        What the chunks are computed from.
    trials : int
        Trials of the whole study.
    chunks : range
        The chunks to collect: all, or those of one part of the study.
    keeper : Keeper
        What takes them, and knows which it has already.
    bar : Progress
        What is told of every chunk.
    until : StoppingRule or None
        Asked after every chunk before which none is missing.
    """

    def __init__(
        self, plan: Plan, trials: int, chunks: range, keeper: Keeper, bar: Progress, until: StoppingRule | None
    ) -> None:
        self._plan, self._trials, self._chunks = plan, trials, chunks
        self._keeper, self._bar, self._until = keeper, bar, until
        nothing = Tally.empty(plan.scenario.n, plan.scenario.steps)
        self._total, self._added = nothing, [nothing]
        self._waiting: dict[int, tuple[int, Tally]] = {}
        self._next = chunks.start
        self._stopped: int | None = None
        self._done = 0

    @property
    def stopping(self) -> Stopping | None:
        """The rule that is asked, and whether it has held."""
        return None if self._until is None else stopping_by(self._until, held=self._stopped is not None, chunk=CHUNK)

    @property
    def tally(self) -> Tally:
        """The counts of all that was collected, up to where the rule held."""
        return self._total if self._until is not None else self._sum()

    @property
    def trials(self) -> int:
        """The trials up to there."""
        return self._trials if self._stopped is None else self._stopped

    def gather(
        self, executor: Executor | None, threads: int | None, table: Path | None, store: Reached | None = None
    ) -> None:
        """Take what is stored, and play what is not."""
        stopping = self.stopping
        left = self._keeper.begin(self._chunks, None if stopping is None else kept(stopping))
        for chunk, chunks, tally in self._keeper.stored(apart=self._until is not None):
            self._add(chunk, chunks, [tally], stored=True)
        self._tell()
        with contextlib.closing(self._keeper):
            try:
                if self._stopped is None and left:
                    self._play(left, executor, threads, table, store)
            except LostWorkerError as error:
                place = self._keeper.place
                raise WorkerError(str(error), self._done, len(self._chunks), place) from error.__cause__
        self._tell()

    def _play(
        self,
        left: list[int],
        executor: Executor | None,
        threads: int | None,
        table: Path | None,
        store: Reached | None,
    ) -> None:
        wanted = Wanted(left, self._trials, self._keeper.keep, self._until is not None, self._keeper.joins)
        with contextlib.closing(played_by(self._plan, wanted, executor, threads, table, store)) as results:
            for played in results:
                if isinstance(played, Joined):
                    self._keeper.add(played)
                    continue
                self._add(played.task.first, played.task.many, played.tallies)
                if self._stopped is None or self._keeper.keep != "counts":
                    self._keeper.add(played)
                if self._stopped is not None:
                    return

    def _add(self, first: int, chunks: int, tallies: Iterable[Tally], *, stored: bool = False) -> None:
        """Count chunks, and ask the rule after every chunk before which none is missing."""
        listed = list(tallies)
        self._done += chunks
        if self._until is None:
            self._added += listed
            if len(self._added) > 64:
                self._sum()
        else:
            each = chunks // len(listed)
            self._waiting |= {first + i * each: (each, tally) for i, tally in enumerate(listed)}
            self._ask(self._until)
        for tally in listed:
            self._bar.add(tally.kinds(), stored=stored)

    def _ask(self, until: StoppingRule) -> None:
        while self._stopped is None and self._next in self._waiting:
            chunks, tally = self._waiting.pop(self._next)
            self._total += tally
            self._next += chunks
            trials = self._total.trials
            if until.satisfied(self._total.kinds()[: len(OutcomeKind)].copy(), trials):
                self._stopped = trials

    def _sum(self) -> Tally:
        total = Tally.sum(self._added, self._plan.scenario.n, self._plan.scenario.steps)
        self._added = [total]
        return total

    def _tell(self) -> None:
        stopping = self.stopping
        self._keeper.stop(self._stopped, None if stopping is None else kept(stopping))
