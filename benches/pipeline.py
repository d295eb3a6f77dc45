"""Trials per second of a study beside those of its engine, and of everything but the engine.

    python benches/pipeline.py               # the engine, a study, a study that is stored: one thread and two
    python benches/pipeline.py --stub        # the engine answers at once: drawing, counting, encoding and writing alone
    python benches/pipeline.py --head        # a thousand workers answer at once: what the head of a cluster can take
    python benches/pipeline.py --workers 2   # processes that write their rows beside processes that send them

Ratios are medians of rounds in one process, in which the columns take turns, so that other load meets all of them. The
processor time a trial takes is printed too: on a machine that is shared it says more than the clock does.
"""

from __future__ import annotations

import argparse
import concurrent.futures as futures
import contextlib
import multiprocessing
import statistics
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import tadcore
import tadcore.study.keepers
import tadcore.study.running
from tadcore import _core
from tadcore.sampling import Box
from tadcore.simulation.starts import rows_of
from tadcore.statistics.tally import Tally
from tadcore.study.elsewhere import signed
from tadcore.study.plan import Plan
from tadcore.study.task import Played

VARY = {"*.position": Box([-3, -3], [3, 3])}


def timed(work: Callable[[], Any], trials: int) -> tuple[float, float]:
    """Trials per second, and nanoseconds of processor time a trial."""
    began, used = time.perf_counter(), time.process_time()
    work()
    return trials / (time.perf_counter() - began), (time.process_time() - used) / trials * 1e9


def stored(study: tadcore.Study, folder: Path, **options: Any) -> None:
    """Run with a new store."""
    with tempfile.TemporaryDirectory(dir=folder) as place:
        study.run(store=place, **options)


def real(trials: int, rounds: int, folder: Path) -> None:
    """The engine beside studies around it."""
    sc = tadcore.scenarios.load("paper-i1")
    study = tadcore.Study(sc, VARY, trials=trials, seed=7)
    rows = rows_of(sc, study.inputs(), trials)
    study.run()  # fills the gain table
    for threads in (1, 2):
        columns = {
            "simulate_batch": partial(tadcore.simulate_batch, sc, rows.positions, threads=threads),
            "Study.run": partial(study.run, threads=threads),
            "stored, all": partial(stored, study, folder, threads=threads),
            "stored, outcomes": partial(stored, study, folder, threads=threads, keep="outcomes"),
            "stored, counts": partial(stored, study, folder, threads=threads, keep="counts"),
        }
        found: dict[str, list[tuple[float, float]]] = {name: [] for name in columns}
        for _ in range(rounds):
            for name, work in columns.items():
                found[name].append(timed(work, trials))
        print(f"{threads} thread{'s' if threads > 1 else ''}, {_core.simd()}, {trials:,} trials, {rounds} rounds")
        engine = found["simulate_batch"]
        for name, values in found.items():
            ratio = statistics.median(v[0] / e[0] for v, e in zip(values, engine, strict=True))
            used = statistics.median(v[1] / e[1] for v, e in zip(values, engine, strict=True))
            rate, best = statistics.median(v[0] for v in values), max(v[0] for v in values)
            print(
                f"  {name:<18} {rate:>12,.0f}/s  best {best:>12,.0f}/s  {ratio:5.2f} of it, {used:5.2f} times the CPU"
            )


def stub(trials: int, rounds: int, folder: Path) -> None:
    """Everything but the engine: the outcomes are there at once, and vary as those of a study do."""
    sc = tadcore.scenarios.load("paper-i1")
    rng = np.random.default_rng(0)
    kind = rng.integers(0, 3, 8192).astype(np.int8)
    defender = np.where(kind == 2, rng.integers(0, sc.n, 8192), -1).astype(np.int32)
    time_ = np.where(kind == 0, sc.horizon, rng.integers(0, sc.steps, 8192) * (sc.horizon / sc.steps))
    diverged = np.zeros(8192, dtype=np.bool_)

    class Instant:
        """A game whose outcomes are there when they are asked for."""

        def equilibrium(self) -> None:
            """Nothing to solve."""

        def simulate_batch(self, starts: Any, *_: Any, **__: Any) -> tuple[Any, ...]:
            m = len(starts)
            return kind[:m], defender[:m], time_[:m], diverged[:m], diverged[:m]

    study = tadcore.Study(sc, VARY, trials=trials, seed=7)
    Plan.game = Instant()  # type: ignore[assignment,method-assign]
    for keep in ("all", "outcomes", "counts"):
        for threads in (1, 2):
            work = partial(stored, study, folder, keep=keep, threads=threads)
            found = [timed(work, trials) for _ in range(rounds)]
            rate, used = max(f[0] for f in found), min(f[1] for f in found)
            print(f"  {keep:<9} {threads} threads: best {rate:>12,.0f} trials/s, {used:6.0f} ns of CPU a trial")


class Crowd(futures.Executor):
    """A thousand workers, each as fast as a core, that have every count at once."""

    _max_workers = 1000

    def __init__(self, sc: tadcore.Scenario) -> None:
        self.groups = 0
        rng = np.random.default_rng(0)
        kind, step = rng.integers(0, 3, 10**5), rng.integers(0, sc.steps + 1, 10**5)
        by = np.where(kind == 2, rng.integers(0, sc.n, 10**5), -1)
        self._tally = Tally.of(kind, by, np.zeros(10**5, dtype=bool), step, sc.n, sc.steps)

    def submit(self, _: Any, /, *given: Any, **__: Any) -> futures.Future[Any]:
        """What a worker would send."""
        self.groups += 1
        count = np.zeros_like(self._tally.count)
        count[0] = given[1].trials
        future: futures.Future[Any] = futures.Future()
        tally = Tally(self._tally.n, self._tally.steps, self._tally.cells, count)
        future.set_result(Played(given[1], (tally,), (), given[1].trials / 2e5))
        return future


def head(trials: int, rounds: int) -> None:
    """What the head takes: trials for each second of its processor time."""
    sc = tadcore.scenarios.load("paper-i1")
    study = tadcore.Study(sc, VARY, trials=trials, seed=7, keep="counts")
    for _ in range(rounds):
        crowd = Crowd(sc)
        rate, used = timed(lambda crowd=crowd: study.run(executor=crowd), trials)
        print(f"  {crowd.groups:,} groups: {rate:,.0f} trials/s, {1e9 / used:,.0f} for a second of processor time")


def workers(many: int, trials: int, rounds: int, folder: Path) -> None:
    """Processes that write their rows, and the same that send them: what this process does meanwhile."""
    study = tadcore.Study(tadcore.scenarios.load("paper-i1"), VARY, trials=trials, seed=7)
    tadcore.study.keepers.EAGER = 0  # as of a longer study, whose rows do not come into memory at the end
    with futures.ProcessPoolExecutor(many, mp_context=multiprocessing.get_context("spawn")) as pool:
        study.run(executor=pool, keep="counts")  # fills the gain tables
        for keep in ("all", "outcomes"):
            for name, group in (("write", signed), ("send", lambda _: contextlib.nullcontext())):
                tadcore.study.running.signed = group
                found = [timed(partial(stored, study, folder, executor=pool, keep=keep), trials) for _ in range(rounds)]
                rate, used = max(f[0] for f in found), min(f[1] for f in found)
                print(
                    f"  {keep:<9} workers {name:<5} {rate:>12,.0f} trials/s, {used:5.0f} ns of the head's CPU a trial"
                )


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--stub", action="store_true")
    parser.add_argument("--head", action="store_true")
    parser.add_argument("--workers", type=int, default=0)
    parser.add_argument("--trials", type=int, default=0)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--folder", type=Path, default=Path())
    given = parser.parse_args()
    if given.head:
        head(given.trials or 4 * 10**9, given.rounds)
    elif given.workers:
        workers(given.workers, given.trials or 2**21, given.rounds, given.folder)
    elif given.stub:
        stub(given.trials or 2**23, given.rounds, given.folder)
    else:
        real(given.trials or 2**18, given.rounds, given.folder)
