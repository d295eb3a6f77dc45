"""What a worker of an executor does: it plays groups of chunks, and writes their rows where it reaches the store.

A worker reaches the store where it finds the file that the run has put there as its sign: a folder of the same path on
another machine has none. What it has written it reports with the digest of every chunk; what it cannot write, it
returns.
"""

from __future__ import annotations

import contextlib
import secrets
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from tadcore._shared.files import PARTIAL
from tadcore.errors import StoreError
from tadcore.sampling.base import Sampler
from tadcore.sampling.design import CHUNK, Design
from tadcore.scenario.model import Scenario
from tadcore.simulation.termination import Termination

from . import parts
from .keeping import Keep
from .parts import Format, Join, Joined
from .place import Place
from .plan import Plan
from .store import Store
from .task import Played, Task, Written
from .warm_start import read_once


class Reached(NamedTuple):
    """A store as workers find it."""

    place: Place
    sign: str
    """The name of a file that is there while the run lasts."""
    study: str
    """The digest of the study."""
    keep: Keep
    group: int
    """Chunks in a part at most."""

    def holds(self) -> bool:
        """Whether this process reaches it, and the run lasts."""
        try:
            return self.place.exists(self.sign)
        except StoreError:
            return False


class Sent(NamedTuple):
    """What a worker makes the plan from."""

    scenario: str
    vary: dict[str, Sampler]
    seed: int
    design: Design
    termination: Termination
    passes: bool
    table: Path | None
    store: Reached | None

    @property
    def plan(self) -> Plan:
        """The plan of the study."""
        sc = Scenario.from_toml_string(self.scenario)
        return Plan(sc, self.vary, self.seed, self.design, self.termination, self.passes)


def sent(plan: Plan, table: Path | None, store: Reached | None) -> Sent:
    """A plan, ready for other processes, whose folder may be another."""
    there = table.absolute() if table is not None and table.is_file() else None
    return Sent(plan.scenario.to_toml(), plan.vary, plan.seed, plan.design, plan.termination, plan.passes, there, store)


@contextlib.contextmanager
def signed(store: Store) -> Iterator[Reached | None]:
    """Let workers write to a store meanwhile; of counts there is one file alone, which the head writes."""
    if store.keep == "counts":
        yield None
        return
    sign = f"{PARTIAL}{secrets.token_hex(8)}.json"
    store.place.write(sign, "{}\n")
    try:
        yield Reached(store.place.absolute(), sign, store.manifest.study, store.keep, parts.GROUP)
    finally:
        store.place.remove(sign)


def run_task(given: Sent, task: Task | Join, threads: int) -> Played | Joined:
    """Play a group of chunks, or join parts; the table of gains stays from group to group."""
    plan = given.plan
    if isinstance(task, Join):
        assert given.store is not None  # which has the parts
        return _format(plan, given.store).join(task, given.store.holds)
    if given.table is not None:
        read_once(plan.scenario, given.table)
    played = plan.run(task, threads)
    return played if given.store is None else _written(plan, given.store, played)


def _format(plan: Plan, store: Reached) -> Format:
    return Format(store.place, plan, store.study, store.keep)


def _written(plan: Plan, store: Reached, played: Played) -> Played:
    """The same with its rows in the store; as it was where this process cannot write there."""
    began = time.perf_counter()
    if not store.holds():
        return played
    form, chunks = _format(plan, store), played.task.chunks()
    written: list[Written] = []
    start = 0
    try:
        while start < len(chunks):
            first = chunks[start][0]
            stop = min(start + store.group - first % store.group, len(chunks))
            rows = form.table(first * CHUNK, played.outcomes[start:stop])
            one = form.put(first * CHUNK, rows, store.holds)
            if one is None:
                return played  # the run has ended, or was killed
            written.append(one)
            start = stop
    except StoreError:
        return played  # whoever asked for it writes the rows, or learns what is the matter
    seconds = played.seconds + time.perf_counter() - began
    return played._replace(outcomes=(), written=tuple(written), seconds=seconds)
