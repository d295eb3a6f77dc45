"""A study on disk: a folder of Parquet parts, or of counts, and a manifest that says whose they are.

``_manifest.json`` holds the scenario, what varies, seed and design, a digest of these, the length and the versions, and
a digest of all its content. Every file appears whole. One run at a time writes to a store, under ``_store.lock``; any
number may read. Readers of Parquet take the folder for one table: they pass over names that begin with an underscore
or a dot.

What a part holds is in its name, so opening a store of thousands of parts reads none of them. While a run is under way
smaller parts are written where one takes long; they are joined when all trials of a part are there. Where a run was
killed between the two, the larger part counts.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any, Self

import pyarrow as pa

from tadcore._shared.files import PARTIAL
from tadcore._shared.threads import cores
from tadcore.errors import StoreError
from tadcore.sampling.design import CHUNK
from tadcore.statistics.tally import Tally

from .keeping import Keep
from .manifest import MANIFEST, Manifest, environment, refuse_old
from .parts import Format, Part, parts_in
from .place import Place
from .plan import Plan
from .table import tally_of


class Store:
    """The parts of one study in one place; made by `Store.writing` or `Store.reading`."""

    def __init__(self, place: Place, manifest: Manifest, plan: Plan) -> None:
        self.place = place
        self.manifest = manifest
        self.plan = plan
        self.format = Format(place, plan, manifest.study, manifest.keep)
        self.files = self._found()
        self.parts = _by_chunk(self.files)

    @classmethod
    def reading(cls, place: Place, manifest: Manifest, plan: Plan) -> Self:
        """The store as it is."""
        store = cls(place, manifest, plan)
        if manifest.columns != plan.columns:
            found = f"its columns are {list(manifest.columns)}, and what varies has {list(plan.columns)}"
            raise StoreError(place.at(MANIFEST), found, "put back a copy of this file")
        return store

    @classmethod
    @contextlib.contextmanager
    def writing(cls, place: Place, wanted: Manifest, plan: Plan) -> Iterator[Self]:
        """Make or continue the store of a study, alone; raises `StoreError` where another run or study has it."""
        place.make()
        with place.alone():
            manifest = _agreed(place, wanted)
            for name in place.names():
                if name.startswith(PARTIAL) and name.endswith((".parquet", ".json")):
                    place.remove(name)  # left by a run that was killed
            if manifest.trials != wanted.trials or not place.exists(MANIFEST):
                manifest = replace(manifest, trials=max(manifest.trials, wanted.trials))
                place.write(MANIFEST, manifest.to_json())
            yield cls(place, manifest, plan)

    @property
    def keep(self) -> Keep:
        """What it keeps of every trial."""
        return self.manifest.keep

    def rows(self, chunk: int) -> int:
        """How many trials of a chunk are there."""
        part = self.parts.get(chunk)
        return 0 if part is None else min(part.end - chunk * CHUNK, CHUNK)

    def runs(self, chunks: Iterable[int]) -> Iterator[tuple[Part, range]]:
        """Consecutive chunks that are there, by the part that holds them."""
        part, start, stop = None, 0, 0
        for chunk in chunks:
            if part is not None and self.parts[chunk] is part and chunk == stop:
                stop += 1
                continue
            if part is not None:
                yield part, range(start, stop)
            part, start, stop = self.parts[chunk], chunk, chunk + 1
        if part is not None:
            yield part, range(start, stop)

    def read(self, chunks: Iterable[int]) -> Iterator[tuple[int, pa.Table]]:
        """The rows of chunks that are there, verified, with the first chunk of each piece."""
        for part, held in self.runs(chunks):
            yield held.start, self.format.read(part, held)

    def tally(self, chunks: Iterable[int], trials: int) -> Tally:
        """The counts of chunks that are there, of a study of so many trials: from footers where parts are whole."""
        sc = self.plan.scenario
        runs = list(self.runs(chunks))

        def counted(run: tuple[Part, range]) -> Tally:
            part, held = run
            if held == part.chunks and part.end <= trials:
                return self.format.tally(part)
            table = self.format.read(part, held)
            return tally_of(table.slice(0, trials - held.start * CHUNK), self.plan)

        with ThreadPoolExecutor(max(cores(), self.place.threads)) as pool:
            return Tally.sum(pool.map(counted, runs), sc.n, sc.steps)

    def stop(self, trials: int | None, rule: dict[str, Any] | None) -> None:
        """Note which rule is asked, and after how many trials it held."""
        if (trials, rule) != (self.manifest.stopped, self.manifest.rule):
            self.manifest = replace(self.manifest, stopped=trials, rule=rule)
            self.place.write(MANIFEST, self.manifest.to_json())

    def _found(self) -> set[Part]:
        return parts_in(self.place)


def _by_chunk(files: Iterable[Part]) -> dict[int, Part]:
    """The part of every chunk: the one with the most rows of it, the larger where a killed run left two."""
    parts: dict[int, Part] = {}
    rows: dict[int, int] = {}
    for part in sorted(files, key=lambda part: (part.end - part.first, part.first)):
        for chunk in part.chunks:
            held = min(part.end - chunk * CHUNK, CHUNK)
            if held >= rows.get(chunk, 0):
                parts[chunk], rows[chunk] = part, held
    return parts


def _agreed(place: Place, wanted: Manifest) -> Manifest:
    """The manifest that is there if it is this study's, or the one to write."""
    refuse_old(place)
    if not place.exists(MANIFEST):
        if any(name.startswith(("part-", "counts-")) and name.endswith(".parquet") for name in place.names()):
            raise StoreError(str(place), "it holds parts but no manifest", "name another folder for the store")
        return replace(wanted, created=datetime.now(UTC).isoformat(timespec="seconds"), environment=environment())
    there = Manifest.read(place)
    there.same(wanted, place)
    if there.version != wanted.version:
        found = f"it was written by tadcore {there.version}, and this is {wanted.version}"
        raise StoreError(str(place), found, "continue it with that version, read it with load_study, or start anew")
    return there
