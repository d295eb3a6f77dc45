"""What becomes of the chunks of a study: rows, in memory or in a store, or counts."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, Protocol

import pyarrow as pa

from tadcore.errors import StoreError
from tadcore.sampling.design import CHUNK
from tadcore.statistics.tally import Tally

from .counted import Counted, content_of, ranges_in, read_counts
from .keeping import Keep
from .parts import Join, Joined
from .plan import Plan
from .rows import EAGER, Counts, InMemory, InStore, Rows
from .store import Store
from .table import schema_of, table_of, tally_of
from .task import Played, Task
from .writing import Writer

_PATIENCE = 1.0  # seconds between two files of counts
_TOGETHER = 256  # tallies that are added up at once


class Keeper(Protocol):
    """What takes the chunks of a study."""

    keep: Keep

    @property
    def place(self) -> str | None:
        """The folder that keeps what is finished, if there is one."""

    def begin(self, chunks: range, rule: dict[str, Any] | None) -> list[int]:
        """Which of the chunks are still to be played, when this rule is asked after each."""

    def stored(self, *, apart: bool) -> Iterator[tuple[int, int, Tally]]:
        """What is there already: first chunk, number of chunks and counts; with ``apart`` chunk by chunk."""

    def add(self, played: Played | Joined) -> None:
        """Take a group, or note that parts were joined."""

    @property
    def joins(self) -> deque[Join] | None:
        """What workers shall join."""

    def close(self) -> None:
        """Bring to the disk what has been taken."""

    def stop(self, trials: int | None, rule: dict[str, Any] | None) -> None:
        """Note which rule is asked, and after how many trials it held."""

    def rows(self, trials: int, tally: Tally) -> Rows:
        """The first trials, all of which have come, and their counts."""


class RowKeeper:
    """Keeps a row for every trial: in memory, in a store, or both."""

    def __init__(self, plan: Plan, trials: int, keep: Keep, store: Store | None, *, hold: bool, workers: bool) -> None:
        self.keep, self._workers = keep, workers
        self._plan, self._trials, self._store = plan, trials, store
        self._schema = schema_of(plan, keep)
        self._held: dict[int, pa.Table] | None = {} if store is None or (hold and trials <= EAGER) else None
        self._there: list[int] = []
        self._writer: Writer | None = None
        self._read = False  # whether the rows are to be in memory at the end, and workers have them

    @property
    def place(self) -> str | None:
        """The folder of the store."""
        return None if self._store is None else str(self._store.place)

    def begin(self, chunks: range, rule: dict[str, Any] | None) -> list[int]:
        """What no part has."""
        store = self._store
        if store is None:
            return list(chunks)
        self._there = [chunk for chunk in chunks if store.rows(chunk) >= self._rows(chunk)]
        there = set(self._there)
        left = [chunk for chunk in chunks if chunk not in there]
        self._writer = Writer(store, left, workers=self._workers)
        return left

    def stored(self, *, apart: bool) -> Iterator[tuple[int, int, Tally]]:
        """From the rows where they are wanted in memory or chunk by chunk, else from the footers of parts."""
        if self._store is None or not self._there:
            return
        if self._held is None and not apart:
            yield self._there[0], len(self._there), self._store.tally(self._there, self._trials)
            return
        for first, table in self._store.read(self._there):
            for chunk in range(first, first + -(-len(table) // CHUNK)):
                piece = table.slice((chunk - first) * CHUNK, self._rows(chunk))
                if self._held is not None:
                    self._held[chunk] = piece
                yield chunk, 1, tally_of(piece, self._plan)

    @property
    def joins(self) -> deque[Join] | None:
        """What the writer has for workers."""
        return None if self._writer is None else self._writer.joins

    def add(self, played: Played | Joined) -> None:
        """Hand the chunks to the writer, and hold them where all fit into memory, unless a worker has written them."""
        if isinstance(played, Joined):
            assert self._writer is not None  # which asked for it
            self._writer.joined(played)
            return
        if played.written:
            assert self._writer is not None  # into whose store they were written
            self._read = self._read or self._held is not None
            self._held = None
            self._writer.found(played.written)
            return
        for (chunk, _), outcomes in zip(played.task.chunks(), played.outcomes, strict=True):
            if self._held is not None:
                self._held[chunk] = table_of(chunk * CHUNK, [outcomes], self._plan, self._schema)
            if self._writer is not None:
                self._writer.add(chunk, outcomes)

    def close(self) -> None:
        """Write what is not written."""
        if self._writer is not None:
            self._writer.close()

    def stop(self, trials: int | None, rule: dict[str, Any] | None) -> None:
        """In the manifest."""
        if self._store is not None:
            self._store.stop(trials, rule)

    def rows(self, trials: int, tally: Tally) -> Rows:
        """In memory if they are held, else in the store."""
        if self._held is None:
            assert self._store is not None  # what is not held is stored
            rows = InStore(self._store, trials, tally)
            return InMemory(rows.table(), self._plan) if self._read else rows
        tables = [self._held[chunk] for chunk in sorted(self._held) if chunk * CHUNK < trials]
        return InMemory(pa.concat_tables([self._schema.empty_table(), *tables]).combine_chunks(), self._plan)

    def _rows(self, chunk: int) -> int:
        return min(CHUNK, self._trials - chunk * CHUNK)


class CountKeeper:
    """Keeps how many trials ended in each way at each step: of all chunks up to the first that is missing."""

    keep: Keep = "counts"

    def __init__(self, plan: Plan, trials: int, store: Store | None) -> None:
        self._plan, self._trials, self._store = plan, trials, store
        self._empty = Tally.empty(plan.scenario.n, plan.scenario.steps)
        self._first = self._next = 0
        self._tally = self._empty
        self._added: list[Tally] = []
        self._waiting: dict[int, Played] = {}
        self._written = time.monotonic()
        self._end = 0

    @property
    def place(self) -> str | None:
        """The folder of the store."""
        return None if self._store is None else str(self._store.place)

    def begin(self, chunks: range, rule: dict[str, Any] | None) -> list[int]:
        """What comes after the trials that are counted, unless the rule was not asked after every chunk of these."""
        self._first, last = chunks.start * CHUNK, min(self._trials, chunks.stop * CHUNK)
        self._end = self._first
        if self._store is not None and rule in (None, self._store.manifest.rule):
            self._read(last)
        self._next = -(-self._end // CHUNK)
        return list(range(max(self._next, chunks.start), chunks.stop))

    def _read(self, last: int) -> None:
        store = self._store
        assert store is not None
        there = [entry for entry in ranges_in(store.place) if entry[0] == self._first]
        if not there:
            return
        _, end, name = there[0]
        if end > last:
            found = f"it counts {end:,} trials, of which the first {last:,} cannot be told from the others"
            raise StoreError(store.place.at(name), found, "ask for as many trials, or name another folder")
        counted = read_counts(store.place, self._first, end, self._plan, store.manifest.study)
        self._tally, self._end = counted.tally, end
        rest = end % CHUNK
        if rest and end < last:  # the cut chunk is played whole this time
            again = self._plan.run(Task(end // CHUNK, rest, "counts", apart=False), None)
            self._tally -= again.tallies[0]
            self._end -= rest

    def stored(self, *, apart: bool) -> Iterator[tuple[int, int, Tally]]:
        """The counts at once: a rule that is asked was asked after every chunk of them."""
        chunks = -(-(self._end - self._first) // CHUNK)
        if chunks:
            yield self._first // CHUNK, chunks, self._tally

    @property
    def joins(self) -> None:
        """Nothing: there is one file alone."""

    def add(self, played: Played | Joined) -> None:
        """Count a group when all before it have come."""
        assert isinstance(played, Played)  # as there are no parts
        self._waiting[played.task.first] = played
        while self._next in self._waiting:
            ready = self._waiting.pop(self._next)
            self._added += ready.tallies
            self._next += ready.task.many
            self._end += ready.task.trials
        if len(self._added) > _TOGETHER or time.monotonic() - self._written > _PATIENCE:
            self.close()

    def close(self) -> None:
        """Write the counts so far, and remove those of fewer trials."""
        self._written = time.monotonic()
        self._tally, self._added = Tally.sum([self._tally, *self._added], self._tally.n, self._tally.steps), []
        if self._store is None or self._end <= self._first:
            return
        counted = Counted(self._first, self._end, self._tally)
        place = self._store.place
        if not place.exists(counted.name):
            place.write(counted.name, content_of(counted, self._plan, self._store.manifest.study))
        for first, end, older in ranges_in(place):
            if first == self._first and end < self._end:
                place.remove(older)

    def stop(self, trials: int | None, rule: dict[str, Any] | None) -> None:
        """In the manifest."""
        if self._store is not None:
            self._store.stop(trials, rule)

    def rows(self, trials: int, tally: Tally) -> Rows:
        """Counts alone."""
        if trials != self._end - self._first:  # where a rule stopped the study
            self._tally, self._added, self._end = tally, [], self._first + trials
            self.close()
        return Counts(tally)


def keeper_of(plan: Plan, trials: int, keep: Keep, store: Store | None, *, hold: bool, workers: bool = False) -> Keeper:
    """What keeps that much of every trial.

    With ``hold`` the rows are in memory, too, where they are not too many; with ``workers`` others write to the store.
    """
    if keep == "counts":
        return CountKeeper(plan, trials, store)
    return RowKeeper(plan, trials, keep, store, hold=hold, workers=workers)


def rows_there(store: Store, wanted: int) -> Rows:
    """The trials of a store before the first that is missing, and of these so many at most."""
    plan = store.plan
    if store.keep == "counts":
        there = [entry for entry in ranges_in(store.place) if entry[0] == 0 and entry[1] <= wanted]
        if not there:
            return Counts(Tally.empty(plan.scenario.n, plan.scenario.steps))
        first, end, _ = there[0]
        return Counts(read_counts(store.place, first, end, plan, store.manifest.study).tally)
    trials = chunk = 0
    while trials < wanted and trials == chunk * CHUNK and store.rows(chunk):
        trials = min(trials + store.rows(chunk), wanted)
        chunk += 1
    rows = InStore(store, trials)
    return rows if trials > EAGER else InMemory(rows.table(), plan)


def checks_of(store: Store) -> list[Callable[[], int]]:
    """What reads each file of a store, and says how many trials it has; raises `StoreError` for a damaged one."""
    if store.keep == "counts":
        return [partial(_counted, store, first, end) for first, end, _ in ranges_in(store.place)]
    return [partial(store.format.verify, part) for part in sorted(store.files)]


def _counted(store: Store, first: int, end: int) -> int:
    return read_counts(store.place, first, end, store.plan, store.manifest.study).tally.trials
