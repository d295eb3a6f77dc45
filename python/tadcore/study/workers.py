"""Who plays the chunks of a study: threads of this process, or the workers of an executor.

Both get groups of consecutive chunks, as many as take a good while at the speed that was measured so far: fewer at the
beginning and at the end, so that nobody waits long for the last.
"""

from __future__ import annotations

import contextlib
import pickle
import queue
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from tadcore._core import Stop
from tadcore._shared.threads import cores
from tadcore.errors import ScenarioError, TadcoreError
from tadcore.sampling.design import CHUNK

from .elsewhere import Reached, Sent, run_task, sent
from .keeping import Keep
from .parts import Join, Joined
from .plan import Plan
from .task import Played, Task

_HERE, _ELSEWHERE = 0.25, 1.5  # seconds of work in a group
_MOST, _MOST_COUNTED = 64, 4096  # chunks in a group: of what comes back row by row, of what is counted where played
_UNKNOWN_WORKERS = 64  # of an executor that does not say how many it has
_NEARLY = 4  # a group becomes a whole part from a fourth of one on

_Submitted: TypeAlias = tuple[Future[Any], Task | Join]


class LostWorkerError(Exception):
    """A worker died; the study that knows what is kept says so to the user."""


class Wanted(NamedTuple):
    """What is to be played."""

    chunks: Sequence[int]
    """In ascending order."""
    trials: int
    """Of the whole study: the last of all chunks may be cut."""
    keep: Keep
    apart: bool
    """Whether every chunk is counted by itself."""
    joins: deque[Join] | None = None
    """What workers shall join meanwhile: others add to it."""


class Groups:
    """Groups of consecutive chunks, sized by the speed of those that came back.

    Where workers write parts of ``whole`` chunks no group has chunks of two, and each has all of one where that does
    not take a few times as long as it should.
    """

    def __init__(self, wanted: Wanted, workers: int, seconds: float, whole: int = 0) -> None:
        self._wanted, self._workers, self._seconds, self._whole = wanted, workers, seconds, whole
        self._most = _MOST_COUNTED if wanted.keep == "counts" and not wanted.apart else _MOST
        self._next = 0
        self._speed = 0.0

    @property
    def left(self) -> int:
        """Chunks that are in no group yet."""
        return len(self._wanted.chunks) - self._next

    def note(self, played: Played) -> None:
        """Learn how fast one worker is."""
        found = played.task.trials / max(played.seconds, 1e-6)
        self._speed = found if not self._speed else 0.7 * self._speed + 0.3 * found

    def take(self) -> Task | None:
        """The next group; None where nothing is left."""
        if not self.left:
            return None
        chunks, wanted = self._wanted.chunks, self._wanted
        size = int(self._seconds * self._speed / CHUNK)
        if _NEARLY * size >= self._whole > 0:
            size = self._whole  # a part that is written at once need not be joined
        size = min(size, self._most, self.left // (2 * self._workers))
        first, last = self._next, self._next + 1
        while last < len(chunks) and last - first < size and chunks[last] == chunks[last - 1] + 1:
            if self._whole and chunks[last] % self._whole == 0:
                break
            last += 1
        self._next = last
        begin, end = chunks[first] * CHUNK, min((chunks[last - 1] + 1) * CHUNK, wanted.trials)
        return Task(chunks[first], end - begin, wanted.keep, wanted.apart)


def played_by(
    plan: Plan,
    wanted: Wanted,
    executor: Executor | None,
    threads: int | None,
    table: Path | None = None,
    store: Reached | None = None,
) -> Generator[Played | Joined]:
    """Every group as it is finished, in any order."""
    if executor is not None:
        return _elsewhere(plan, wanted, executor, 1 if threads is None else threads, sent(plan, table, store))
    return _here(plan, wanted, cores() if threads is None else threads)


def _here(plan: Plan, wanted: Wanted, threads: int) -> Generator[Played | Joined]:
    """In threads that each draw, play and count: nothing of that needs the interpreter for long."""
    workers = max(1, min(threads, 4 * cores(), len(wanted.chunks)))
    stop, groups = Stop(), Groups(wanted, workers, _HERE)
    pool = ThreadPoolExecutor(workers, thread_name_prefix="tadcore-play")

    def submit() -> _Submitted | None:
        share = max(1, threads // max(1, min(workers, groups.left)))  # the last chunks have all threads
        task = groups.take()
        return None if task is None else (pool.submit(plan.run, task, share, stop), task)

    try:
        yield from _in_flight(plan, groups, submit, workers + 1)
    finally:
        stop.set()
        pool.shutdown(wait=True, cancel_futures=True)


def _elsewhere(plan: Plan, wanted: Wanted, executor: Executor, threads: int, given: Sent) -> Generator[Played | Joined]:
    """Enough groups in flight for every worker to have the next one at hand."""
    known = getattr(executor, "_max_workers", None)
    workers = known if isinstance(known, int) else _UNKNOWN_WORKERS
    groups = Groups(wanted, workers, _ELSEWHERE, 0 if given.store is None else given.store.group)

    def submit() -> _Submitted | None:
        task = wanted.joins.popleft() if wanted.joins else groups.take()
        return None if task is None else (executor.submit(run_task, given, task, threads), task)

    return _in_flight(plan, groups, submit, 2 * workers)


def _in_flight(
    plan: Plan, groups: Groups, submit: Callable[[], _Submitted | None], most: int
) -> Generator[Played | Joined]:
    """What comes back while at most so many groups are under way."""
    running: dict[Future[Any], Task | Join] = {}
    finished: queue.SimpleQueue[Future[Any]] = queue.SimpleQueue()

    def fill() -> None:
        while len(running) < most:
            with _told(plan):
                submitted = submit()
            if submitted is None:
                return
            running[submitted[0]] = submitted[1]
            submitted[0].add_done_callback(finished.put)

    try:
        try:
            fill()
        except RuntimeError as error:
            if "shutdown" not in str(error):
                raise
            raise ScenarioError("executor", "an executor", "open: this one has been shut down") from error
        while running:
            # What is whole comes first, so that it is kept when a worker has died beside it.
            for future in sorted(_drained(finished), key=lambda f: (_failed(f), running[f].first)):
                task = running.pop(future)
                with _told(plan, task):
                    found = future.result()
                if isinstance(found, Played):
                    groups.note(found)
                yield found
            fill()
    finally:
        for future in running:
            future.cancel()


def _drained(finished: queue.SimpleQueue[Future[Any]]) -> Iterator[Future[Any]]:
    """All that is there, at least one."""
    yield finished.get()
    with contextlib.suppress(queue.Empty):
        while True:
            yield finished.get_nowait()


def _failed(future: Future[Any]) -> bool:
    return future.cancelled() or future.exception() is not None


@contextlib.contextmanager
def _told(plan: Plan, task: Task | Join | None = None) -> Iterator[None]:
    """Tell a dead worker and a sampler that cannot be pickled from an error of the user's own code."""
    try:
        yield
    except TadcoreError:
        raise
    except Exception as error:
        if isinstance(error, BrokenExecutor | CancelledError) or type(error).__name__ in (
            "KilledWorker",  # of Dask, which need not be installed
            "FutureCancelledError",
        ):
            raise LostWorkerError(f"{type(error).__name__}: {error}".removesuffix(": ")) from error
        for path, sampler in plan.vary.items():
            if _of_pickling(error) and not _travels(sampler):
                rule = "a sampler that can be sent to another process: a callable defined at the top of a module"
                raise ScenarioError(f'vary["{path}"]', sampler, rule) from error
        if task is not None:
            which = f"chunk {task.first}" if task.last == task.first else f"chunks {task.first} to {task.last}"
            error.add_note(f"(while computing {which} of the study)")
        raise


def _of_pickling(error: Exception) -> bool:
    return isinstance(error, pickle.PicklingError) or any(w in str(error) for w in ("pickle", "get local object"))


def _travels(thing: object) -> bool:
    try:
        pickle.dumps(thing)
    except Exception:  # pickling runs code of any kind
        return False
    return True
