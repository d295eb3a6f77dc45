"""Every chunk of a study from its store or computed, examined in order, up to where a rule stops it."""

from __future__ import annotations

import contextlib
import math
from concurrent.futures import Executor
from typing import Protocol, runtime_checkable

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from tadcore.errors import WorkerError
from tadcore.game.outcome import OutcomeKind
from tadcore.sampling.design import CHUNK
from tadcore.statistics.stopping import Stopping, kept, stopping_by

from .plan import Plan
from .progress import Progress
from .store import Store
from .table import schema_of, table_of
from .workers import LostWorkerError, computed


@runtime_checkable
class StoppingRule(Protocol):
    """When a study has seen enough, such as `tadcore.statistics.HalfWidth`."""

    def satisfied(self, counts: NDArray[np.int64], trials: int) -> bool:
        """Whether the counts of the outcomes, by `OutcomeKind`, after so many trials are enough.

        Trials that diverged are in no count; the counts then sum to less than ``trials``.
        """
        ...


class Collection:
    """Every chunk of a study, from the store or computed, in their order, up to where a rule holds.

    Parameters
    ----------
    plan : Plan
        What the chunks are computed from.
    trials : int
        How many there are to be.
    store : Store or None
        Where finished chunks are read and kept.
    bar : Progress
        What is told of every chunk.
    until : StoppingRule or None
        Asked after every chunk before which none is missing.
    """

    def __init__(self, plan: Plan, trials: int, store: Store | None, bar: Progress, until: StoppingRule | None) -> None:
        self._plan, self._store, self._bar, self._until = plan, store, bar, until
        self._schema = schema_of(plan)
        self._jobs = jobs_of(trials)
        self._tables: dict[int, pa.Table] = {}
        self._stopped: int | None = None
        self._looked = 0
        self._counts = np.zeros(len(OutcomeKind) + 1, dtype=np.int64)

    @property
    def stopping(self) -> Stopping | None:
        """The rule that is asked, and whether it has held."""
        return None if self._until is None else stopping_by(self._until, held=self._stopped is not None, chunk=CHUNK)

    def gather(self, executor: Executor | None, threads: int | None) -> pa.Table:
        """The chunks in one table; what is not in the store is computed."""
        left = []
        for chunk, rows in self._jobs:
            if self._store is not None and self._store.rows.get(chunk, 0) >= rows:
                self._add(chunk, self._store.read(chunk).slice(0, rows), stored=True)
            else:
                left.append((chunk, rows))
        self._tell_store()
        if self._stopped is None and left:
            try:
                self._compute(left, executor, threads)
            except LostWorkerError as error:
                place = None if self._store is None else str(self._store.folder)
                raise WorkerError(str(error), len(self._tables), len(self._jobs), place) from error.__cause__
        self._tell_store()
        last = self._looked if self._stopped is not None else len(self._tables)
        return pa.concat_tables([self._tables[chunk] for chunk in range(last)]).combine_chunks()

    def _compute(self, left: list[tuple[int, int]], executor: Executor | None, threads: int | None) -> None:
        with contextlib.closing(computed(self._plan, left, executor, threads)) as results:
            for chunk, outcomes in results:
                table = table_of(chunk, outcomes, self._plan, self._schema)
                if self._store is not None:
                    self._store.write(chunk, table)
                self._add(chunk, table)
                if self._stopped is not None:
                    return

    def _add(self, chunk: int, table: pa.Table, *, stored: bool = False) -> None:
        """Keep a chunk, and ask the rule after every chunk before which none is missing."""
        self._tables[chunk] = table
        if self._until is not None:
            while self._stopped is None and self._looked in self._tables:
                self._counts += _counts(self._tables[self._looked])
                self._looked += 1
                trials = int(self._counts.sum())
                if self._until.satisfied(self._counts[: len(OutcomeKind)].copy(), trials):
                    self._stopped = trials
        self._bar.add(_counts(table), stored=stored)

    def _tell_store(self) -> None:
        if self._store is not None:
            stopping = self.stopping
            self._store.stop(self._stopped, None if stopping is None else kept(stopping))


def _counts(table: pa.Table) -> NDArray[np.int64]:
    """Trials by the kind of their end, then those that diverged, however they end."""
    codes = np.where(table["diverged"].to_numpy(), len(OutcomeKind), table["kind"].to_numpy())
    return np.bincount(codes, minlength=len(OutcomeKind) + 1).astype(np.int64)


def jobs_of(trials: int) -> list[tuple[int, int]]:
    """Every chunk with the number of its trials."""
    return [(chunk, min(CHUNK, trials - chunk * CHUNK)) for chunk in range(math.ceil(trials / CHUNK))]
