"""A study, run: its options checked, its store opened, its chunks collected."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping
from concurrent.futures import Executor
from typing import Any, NamedTuple

from tadcore._shared.arrays import as_threads
from tadcore._shared.files import as_path
from tadcore.errors import ScenarioError
from tadcore.sampling.design import CHUNK
from tadcore.statistics.stopping import Stopping

from .collect import Collection, StoppingRule
from .definition import Definition
from .elsewhere import signed
from .keepers import keeper_of
from .keeping import Keep, as_keep
from .part import StudyPart, as_part, chunks_of, place_of
from .progress import Progress
from .rows import Rows
from .store import Store
from .warm_start import warm
from .where import as_place


class Options(NamedTuple):
    """The arguments of `tadcore.Study.run`."""

    progress: bool | str
    store: str | os.PathLike[str] | None
    threads: int | None
    executor: Executor | None
    until: StoppingRule | None
    table: str | os.PathLike[str] | None
    keep: Keep | None
    part: tuple[int, int] | None
    storage_options: Mapping[str, Any] | None


def gathered(study: Definition, options: Options) -> tuple[Rows, Stopping | None] | StudyPart:
    """Play what the store does not have; raises what `tadcore.Study.run` says."""
    executor, until, progress = options.executor, options.until, options.progress
    threads = as_threads(options.threads)
    if executor is not None and not isinstance(executor, Executor):
        hint = ": client.get_executor()" if hasattr(executor, "get_executor") else ""
        raise ScenarioError("executor", executor, f"a concurrent.futures.Executor{hint}")
    if until is not None and not isinstance(until, StoppingRule):
        raise ScenarioError("until", until, "a stopping rule such as tadcore.statistics.HalfWidth(0.002)")
    if until is not None and study.design != "random":
        rule = "left out: its interval needs independent draws, which only design='random' gives"
        raise ScenarioError("until", f"a rule for design={study.design!r}", rule)
    place = None if options.store is None else as_place("store", options.store, options.storage_options)
    table = None if options.table is None else as_path("table", options.table)
    keep = study.keep if options.keep is None else as_keep(options.keep)
    part = None if options.part is None else as_part(options.part)
    if part is not None and place is None:
        raise ScenarioError("part", part, "given with store=…, where the other parts are, too")
    if part is not None and until is not None:
        raise ScenarioError("until", until, "left out: a rule sees all trials in their order, a part has only its own")
    chunks = chunks_of(part, study.trials)
    plan = study.plan
    plan.check_ahead(study.trials, chunks, threads=threads, progress=bool(progress))
    if not plan.games:
        plan.game.equilibrium()
    elif table is not None:
        raise ScenarioError("table", str(table), f"left out: {plan.games[0]} varies, so trials share no table of gains")
    with contextlib.ExitStack() as running:
        running.enter_context(warm(study.scenario, table))
        store = None
        if place is not None:
            store = running.enter_context(Store.writing(place_of(part, place), study.manifest(keep), plan))
        trials = max(0, min(study.trials, chunks.stop * CHUNK) - chunks.start * CHUNK)
        bar = running.enter_context(Progress(trials, wanted=progress))
        reached = None
        if executor is not None and store is not None:
            reached = running.enter_context(signed(store))
        keeper = keeper_of(plan, study.trials, keep, store, hold=part is None, workers=reached is not None)
        collection = Collection(plan, study.trials, chunks, keeper, bar, until)
        collection.gather(executor, threads, table, reached)
        if part is not None:
            return StudyPart(part, chunks.start * CHUNK, trials, collection.tally)
        return keeper.rows(collection.trials, collection.tally), collection.stopping
