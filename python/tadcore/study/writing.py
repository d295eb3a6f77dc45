"""Chunks on their way to the disk: held until a part is whole or some seconds have passed, written by other threads.

What workers of an executor have written is only noted, and where smaller parts of theirs are to be joined they do it.
"""

from __future__ import annotations

import itertools
import time
from collections import Counter, deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor

import pyarrow as pa

from tadcore.sampling.design import CHUNK

from . import parts
from .parts import Join, Joined, Part
from .store import Store
from .task import Outcomes, Written

_PATIENCE = 5.0  # seconds that a finished chunk waits for its part to be whole
_HELD = 4  # parts of which the chunks that are stored stay at hand until the rest comes, so that none is read again
_PENDING = 4  # parts that wait for two threads, at most: then the study waits, too


class Writer:
    """What writes the chunks of a store as they come, in any order.

    Parameters
    ----------
    store : Store
        Where they go.
    chunks : iterable of int
        Those that will come.
    workers : bool
        Whether others take what is appended to ``joins``, as long as it is open.
    """

    def __init__(self, store: Store, chunks: Iterable[int], *, workers: bool = False) -> None:
        self._store, self._workers = store, workers
        self.joins: deque[Join] = deque()
        self._asked: set[int] = set()
        self._most = _PENDING + store.place.threads - 2
        self._left = Counter(chunk // parts.GROUP for chunk in chunks)
        self._open: dict[int, dict[int, Outcomes]] = {}
        self._since: dict[int, float] = {}
        self._held: dict[int, dict[int, Outcomes]] = {}
        self._before: dict[int, list[Future[None]]] = {}
        self._joining: dict[int, list[Future[None]]] = {}
        self._pending: deque[Future[None]] = deque()
        self._pool = ThreadPoolExecutor(store.place.threads, thread_name_prefix="tadcore-store")

    def add(self, chunk: int, outcomes: Outcomes) -> None:
        """Take a chunk; raises what a write before it has met."""
        group, now = chunk // parts.GROUP, time.monotonic()
        self._open.setdefault(group, {})[chunk] = outcomes
        self._since.setdefault(group, now)
        self._left[group] -= 1
        if not self._left[group]:
            self._submit(group, join=True)
        for waiting in [g for g, since in self._since.items() if now - since > _PATIENCE]:
            self._submit(waiting, join=False)
        self._settle()

    def found(self, written: Iterable[Written]) -> None:
        """Take note of what a worker has written, once it is there."""
        for one in written:
            part = Part(one.first, one.end)
            group = self._group(part)
            self._left[group] -= len(part.chunks)
            future = self._pool.submit(self._find, one)
            self._before.setdefault(group, []).append(future)
            self._pending.append(future)
            if not self._left[group]:
                self._submit(group, join=True)
        self._settle()

    def joined(self, joined: Joined) -> None:
        """Take note of a part that a worker has joined, and remove what it was joined from."""
        group = joined.task.first // parts.GROUP
        future = self._pool.submit(self._swap, joined, self._joining.pop(group, []))
        self._joining[group] = [future]
        self._pending.append(future)
        self._settle()

    def close(self) -> None:
        """Bring everything to the disk, and join what lies side by side."""
        try:
            self._workers = False
            files = Counter(self._group(part) for part in self._files())
            for group in sorted(files.keys() | self._open.keys() | self._before.keys()):
                if group in self._open or group in self._before or files[group] > 1:
                    self._submit(group, join=True)
            for future in self._pending:
                future.result()
            files = Counter(self._group(part) for part in self._files())  # joins that no worker was there to take
            for group in [group for group, many in files.items() if many > 1 and group in self._asked]:
                self._put(group, {}, [], join=True)
            self._sweep_late()
        finally:
            self._pool.shutdown(wait=True)

    def _settle(self) -> None:
        """Wait where too much waits for the disk; raises what a write has met."""
        while self._pending and (self._pending[0].done() or len(self._pending) > self._most):
            self._pending.popleft().result()

    def _submit(self, group: int, *, join: bool) -> None:
        self._since.pop(group, None)
        chunks, before = self._open.pop(group, {}), self._before.pop(group, []) + self._joining.pop(group, [])
        if join:
            chunks = self._held.pop(group, {}) | chunks
        elif group in self._held or len(self._held) < _HELD:
            self._held.setdefault(group, {}).update(chunks)
        future = self._pool.submit(self._put, group, chunks, before, join)
        self._pending.append(future)
        (self._joining if join else self._before)[group] = [future]  # what comes next waits for it

    def _put(self, group: int, chunks: dict[int, Outcomes], before: list[Future[None]], join: bool) -> None:
        """Write chunks, with ``join`` in one part with those of their group that are stored."""
        for future in before:
            future.result()  # begun before this one, since the pool takes them in their order
        store = self._store
        rows = {chunk: store.rows(chunk) for chunk in self._stored(group)} if join else {}
        rows |= {chunk: len(outcomes.kind) for chunk, outcomes in chunks.items()}
        asked = False
        for run in _runs(rows):
            first, end = run.start * CHUNK, run[-1] * CHUNK + rows[run[-1]]
            part = Part(first, end)
            if part not in store.files:  # its name says what is in it
                if join and not chunks and self._workers:
                    self.joins.append(Join(run.start, tuple(store.runs(run))))
                    self._asked.add(group)
                    asked = True
                    continue
                store.format.put(first, pa.concat_tables(self._tables(run, chunks)))
            self._register(part)
        if join and not asked:  # else when a worker has joined them
            self._sweep(group)

    def _find(self, written: Written) -> None:
        self._register(self._store.format.confirm(written))

    def _swap(self, joined: Joined, before: list[Future[None]]) -> None:
        for future in before:
            future.result()
        for one in joined.written:
            self._find(one)
            self._sweep(self._group(Part(one.first, one.end)))

    def _register(self, part: Part) -> None:
        self._store.files.add(part)
        for chunk in part.chunks:
            self._store.parts[chunk] = part

    def _stored(self, group: int) -> list[int]:
        return [chunk for chunk in range(group * parts.GROUP, (group + 1) * parts.GROUP) if chunk in self._store.parts]

    def _tables(self, run: range, chunks: dict[int, Outcomes]) -> Iterator[pa.Table]:
        """The rows of consecutive chunks: what is at hand, and between that what is stored."""
        for at_hand, among in itertools.groupby(run, lambda chunk: chunk in chunks):
            listed = list(among)
            if at_hand:
                yield self._store.format.table(listed[0] * CHUNK, [chunks[chunk] for chunk in listed])
            else:
                yield from (table for _, table in self._store.read(listed))

    def _files(self) -> set[Part]:
        """The parts that are there now: a copy, made at once, since other threads add theirs in the meantime."""
        return self._store.files.copy()

    @staticmethod
    def _group(part: Part) -> int:
        return part.first // (parts.GROUP * CHUNK)

    def _sweep(self, group: int) -> None:
        """Remove the parts of a group whose rows larger ones have."""
        in_use = {self._store.parts[chunk] for chunk in self._stored(group)}
        for part in self._files():
            if self._group(part) == group and part not in in_use:
                self._store.place.remove(part.name)
                self._store.files.discard(part)

    def _sweep_late(self) -> None:
        """Remove what workers of a run that was killed have still written, where larger parts have its rows."""
        store = self._store
        for part in parts.parts_in(store.place) - store.files:
            if all(store.rows(chunk) >= min(part.end - chunk * CHUNK, CHUNK) for chunk in part.chunks):
                store.place.remove(part.name)


def _runs(rows: dict[int, int]) -> Iterator[range]:
    """Consecutive chunks, of which only the last of each run may be cut."""
    start = last = None
    for chunk in sorted(rows):
        if start is None or last is None:
            start = chunk
        elif chunk != last + 1 or rows[last] < CHUNK:
            yield range(start, last + 1)
            start = chunk
        last = chunk
    if start is not None and last is not None:
        yield range(start, last + 1)
