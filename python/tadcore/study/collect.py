"""Every chunk of a study from its store or computed, looked at in order, up to where a rule stops it."""

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

from .plan import Plan
from .progress import Progress
from .store import Store
from .table import table_of
from .workers import LostWorkerError, computed

__all__ = ["StoppingRule", "collect", "jobs_of"]


@runtime_checkable
class StoppingRule(Protocol):
    """When a study has seen enough, such as `tadcore.statistics.HalfWidth`."""

    def satisfied(self, counts: NDArray[np.int64], trials: int) -> bool:
        """Whether the counts of the outcomes, by `OutcomeKind`, after so many trials are enough."""
        ...


def collect(
    plan: Plan,
    trials: int,
    store: Store | None,
    bar: Progress,
    schema: pa.Schema,
    executor: Executor | None,
    threads: int | None,
    until: StoppingRule | None,
) -> pa.Table:
    """Every chunk from the store or computed, in order, up to where the rule holds."""
    jobs = jobs_of(trials)
    gathered = _Gathered(until)
    left = []
    for chunk, rows in jobs:
        if store is not None and store.rows.get(chunk, 0) >= rows:
            bar.add(gathered.add(chunk, store.read(chunk).slice(0, rows)), stored=True)
        else:
            left.append((chunk, rows))
    if store is not None:
        store.stop(gathered.stopped)
    if gathered.stopped is None and left:
        try:
            with contextlib.closing(computed(plan, left, executor, threads)) as results:
                for chunk, outcomes in results:
                    table = table_of(chunk, outcomes, schema)
                    if store is not None:
                        store.write(chunk, table)
                    bar.add(gathered.add(chunk, table))
                    if gathered.stopped is not None:
                        break
        except LostWorkerError as error:
            place = None if store is None else str(store.folder)
            raise WorkerError(str(error), len(gathered.tables), len(jobs), place) from error.__cause__
    if store is not None:
        store.stop(gathered.stopped)
    return gathered.table()


class _Gathered:
    """Chunks as they come, looked at in their order."""

    def __init__(self, until: StoppingRule | None) -> None:
        self.tables: dict[int, pa.Table] = {}
        self.stopped: int | None = None
        self._until = until
        self._looked = 0
        self._counts = np.zeros(len(OutcomeKind), dtype=np.int64)

    def add(self, chunk: int, table: pa.Table) -> NDArray[np.int64]:
        """Keep a chunk and return its counts; ask the rule after every chunk before which none is missing."""
        self.tables[chunk] = table
        if self._until is not None:
            while self.stopped is None and self._looked in self.tables:
                self._counts += _counts(self.tables[self._looked])
                self._looked += 1
                trials = int(self._counts.sum())
                if self._until.satisfied(self._counts.copy(), trials):
                    self.stopped = trials
        return _counts(table)

    def table(self) -> pa.Table:
        """All chunks in one table, or those up to where the rule held."""
        last = self._looked if self.stopped is not None else len(self.tables)
        return pa.concat_tables([self.tables[chunk] for chunk in range(last)]).combine_chunks()


def _counts(table: pa.Table) -> NDArray[np.int64]:
    return np.bincount(table["kind"].to_numpy(), minlength=len(OutcomeKind)).astype(np.int64)


def jobs_of(trials: int) -> list[tuple[int, int]]:
    """Every chunk with the number of its trials."""
    return [(chunk, min(CHUNK, trials - chunk * CHUNK)) for chunk in range(math.ceil(trials / CHUNK))]
