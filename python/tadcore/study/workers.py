"""Who computes the chunks of a study: this process, one after another, or the workers of an executor."""

from __future__ import annotations

import contextlib
import pickle
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from typing import TypeAlias

from tadcore.errors import ScenarioError, TadcoreError

from .plan import Outcomes, Plan, run_chunk

Job: TypeAlias = tuple[int, int]
"""A chunk and how many of its trials are wanted."""

_UNKNOWN_WORKERS = 64


class LostWorkerError(Exception):
    """A worker died; the study that knows what is kept says so to the user."""


def computed(
    plan: Plan, jobs: Sequence[Job], executor: Executor | None, threads: int | None
) -> Generator[tuple[int, Outcomes]]:
    """Every job's chunk and outcomes as they are finished: in order in this process, in any order from an executor."""
    if executor is None:
        return ((chunk, plan.run(chunk, rows, threads)) for chunk, rows in jobs)
    return _submitted(plan, jobs, executor, 1 if threads is None else threads)


def _submitted(plan: Plan, jobs: Sequence[Job], executor: Executor, threads: int) -> Generator[tuple[int, Outcomes]]:
    """Keep a bounded number of chunks in flight, enough for every worker to have the next one at hand."""
    workers = getattr(executor, "_max_workers", None)
    bound = 2 * (workers if isinstance(workers, int) else _UNKNOWN_WORKERS)
    fixed = (plan.scenario.to_toml(), plan.vary, plan.seed, plan.design, plan.termination, plan.passes)
    waiting = iter(jobs)
    running: dict[Future[Outcomes], int] = {}

    def submit() -> None:
        for chunk, rows in waiting:
            running[executor.submit(run_chunk, *fixed, chunk, rows, threads)] = chunk
            if len(running) >= bound:
                return

    try:
        try:
            with _told(plan):
                submit()
        except RuntimeError as error:
            if "shutdown" not in str(error):
                raise
            raise ScenarioError("executor", executor, "open: this one has been shut down") from error
        while running:
            finished, _ = wait(running, return_when=FIRST_COMPLETED)
            # What is whole comes first, so that it is kept when a worker has died beside it.
            for future in sorted(finished, key=lambda f: (f.cancelled() or f.exception() is not None, running[f])):
                chunk = running.pop(future)
                with _told(plan, chunk):
                    outcomes = future.result()
                yield chunk, outcomes
            with _told(plan):
                submit()
    finally:
        for future in running:
            future.cancel()


@contextlib.contextmanager
def _told(plan: Plan, chunk: int | None = None) -> Iterator[None]:
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
        if chunk is not None:
            error.add_note(f"(while computing chunk {chunk} of the study)")
        raise


def _of_pickling(error: Exception) -> bool:
    return isinstance(error, pickle.PicklingError) or any(w in str(error) for w in ("pickle", "get local object"))


def _travels(thing: object) -> bool:
    try:
        pickle.dumps(thing)
    except Exception:  # pickling runs code of any kind
        return False
    return True
