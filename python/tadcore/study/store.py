"""A study on disk: a folder of Parquet parts, one for each finished chunk, and a manifest that says whose they are.

``_manifest.json`` holds the scenario, what varies, seed and design, a digest of these, the length and the versions, and
a digest of all its content; ``part-000000.parquet`` holds the rows of chunk 0 of `StudyResult.table`, with the digest
of the study, the chunk, the number of rows and a digest of the rows in its metadata. Every file appears whole. One run
at a time writes to a store, under ``_store.lock``; any number may read. Readers of Parquet take the folder for one
table: they pass over names that begin with an underscore or a dot.
"""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Self

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from tadcore._shared.files import PARTIAL, strange, write_whole
from tadcore.errors import ScenarioError, StoreError

from .lock import alone
from .manifest import MANIFEST, Manifest, environment, reason, refuse_old
from .plan import Plan
from .table import digest, encoded, flaw, schema_of

_PART = re.compile(r"part-(\d{6,})\.parquet")
_AGAIN = "delete this file and run the study again: only its chunk is computed anew"


class Store:
    """The parts of one study in one folder; made by `Store.writing` or `Store.reading`."""

    def __init__(self, folder: str | os.PathLike[str], manifest: Manifest, plan: Plan) -> None:
        self.folder = Path(folder)
        self.manifest = manifest
        self.plan = plan
        self.schema = schema_of(plan)
        self.rows = self._verified()

    @classmethod
    def reading(cls, folder: str | os.PathLike[str], manifest: Manifest, plan: Plan) -> Self:
        """The store as it is, its parts verified."""
        store = cls(folder, manifest, plan)
        if manifest.columns != plan.columns:
            found = f"its columns are {list(manifest.columns)}, and what varies has {list(plan.columns)}"
            raise StoreError(str(Path(folder) / MANIFEST), found, "put back a copy of this file")
        return store

    @classmethod
    @contextlib.contextmanager
    def writing(cls, folder: str | os.PathLike[str], wanted: Manifest, plan: Plan) -> Iterator[Self]:
        """Make or continue the store of a study, alone; raises `StoreError` where another run or study has it."""
        place = Path(folder)
        with contextlib.ExitStack() as until_the_end:
            with _faults(place):
                place.mkdir(parents=True, exist_ok=True)
                until_the_end.enter_context(alone(place))
            manifest = _agreed(place, wanted)
            for partial in [*place.glob(f"{PARTIAL}*.parquet"), *place.glob(f"{PARTIAL}*.json")]:
                with _faults(partial):
                    partial.unlink()  # left by a run that was killed
            if manifest.trials != wanted.trials or not (place / MANIFEST).exists():
                manifest = replace(manifest, trials=max(manifest.trials, wanted.trials))
                _write(place / MANIFEST, manifest.to_json())
            yield cls(place, manifest, plan)

    def read(self, chunk: int) -> pa.Table:
        """The outcomes of a chunk, its pages verified."""
        path = self._part(chunk)
        try:
            with pq.ParquetFile(path, page_checksum_verification=True) as part:
                table = part.read()
            said = (table.schema.metadata or {}).get(b"tadcore_sha256", b"").decode()
            table = table.cast(self.schema)
            whole = len(table) == self.rows[chunk] and digest(table) == said
        except (OSError, ValueError, pa.ArrowException) as error:
            raise StoreError(str(path), f"it is damaged ({error})", _AGAIN) from None
        if not whole:
            raise StoreError(str(path), "it is damaged (its rows are not those that were written)", _AGAIN)
        # A digest tells an accident, not an intention: what cannot be an outcome is none, whatever is said of it.
        found = flaw(table, chunk, self.plan.scenario, self.plan.termination)
        if found is None:
            try:
                self.plan.check(chunk, np.stack([table[name].to_numpy() for name in self.plan.columns], axis=1))
            except ScenarioError as error:
                found = str(error)
        if found is not None:
            raise StoreError(str(path), f"its rows are no outcomes of this study ({found})", _AGAIN)
        return table

    def write(self, chunk: int, table: pa.Table) -> None:
        """Keep the outcomes of a chunk; they are on the disk when this returns."""
        rows = len(table)
        said = {"study": self.manifest.study, "chunk": str(chunk), "rows": str(rows), "sha256": digest(table)}
        _write(self._part(chunk), encoded(table, {f"tadcore_{key}": value for key, value in said.items()}))
        self.rows[chunk] = rows

    def stop(self, trials: int | None, rule: dict[str, Any] | None) -> None:
        """Note which rule is asked, and after how many trials it held."""
        if (trials, rule) != (self.manifest.stopped, self.manifest.rule):
            self.manifest = replace(self.manifest, stopped=trials, rule=rule)
            _write(self.folder / MANIFEST, self.manifest.to_json())

    def _part(self, chunk: int) -> Path:
        return self.folder / f"part-{chunk:06d}.parquet"

    def _verified(self) -> dict[int, int]:
        """Rows of every part, by chunk; raises `StoreError` naming one that does not belong here."""
        rows: dict[int, int] = {}
        with _faults(self.folder):
            parts = sorted(self.folder.glob("part-*.parquet"))
        for path in parts:
            match = _PART.fullmatch(path.name)
            if match is None or path.name != self._part(int(match[1])).name:
                raise StoreError(str(path), "its name is not that of a part", "move it out of this folder")
            with _faults(path):
                found = strange(path)
            if found is not None:
                raise StoreError(str(path), f"it is {found}, not a file", "move it out of this folder")
            rows[int(match[1])] = self._rows_of(path, int(match[1]))
        return rows

    def _rows_of(self, path: Path, chunk: int) -> int:
        try:
            with pq.ParquetFile(path) as part:
                about = part.metadata.metadata or {}
                rows, schema = part.metadata.num_rows, part.schema_arrow
                said = {key: about.get(f"tadcore_{key}".encode(), b"").decode() for key in ("study", "chunk", "rows")}
                named = schema.names == self.schema.names
        except (OSError, ValueError, pa.ArrowException) as error:
            raise StoreError(str(path), f"it is truncated or no Parquet file ({error})", _AGAIN) from None
        if said["study"] != self.manifest.study:
            found = "another study" if said["study"] else "no study"
            raise StoreError(str(path), f"it belongs to {found}", "move it out of this folder, or name another store")
        if said["chunk"] != str(chunk):
            raise StoreError(str(path), f"it holds chunk {said['chunk']}, not {chunk}", "give it its name back")
        if said["rows"] != str(rows) or not 0 < rows <= self.manifest.chunk:
            raise StoreError(str(path), f"it has {rows} rows, and says {said['rows']}", _AGAIN)
        if not named or not schema.equals(self.schema):
            raise StoreError(str(path), f"its columns are {schema.names}, not {self.schema.names}", _AGAIN)
        return int(rows)


def _agreed(place: Path, wanted: Manifest) -> Manifest:
    """The manifest that is there if it is this study's, or the one to write."""
    refuse_old(place)
    if not (place / MANIFEST).exists():
        if any(place.glob("part-*.parquet")):
            raise StoreError(str(place), "it holds parts but no manifest", "name another folder for the store")
        return replace(wanted, created=datetime.now(UTC).isoformat(timespec="seconds"), environment=environment())
    there = Manifest.read(place)
    if there.study != wanted.study:
        decides = ("scenario", "vary", "seed", "design", "chunk", "stream", "termination", "passes")
        differ = ", ".join(name for name in decides if getattr(there, name) != getattr(wanted, name))
        raise StoreError(str(place), f"it holds another study (its {differ} differ)", "name another folder")
    if there.version != wanted.version:
        found = f"it was written by tadcore {there.version}, and this is {wanted.version}"
        raise StoreError(str(place), found, "continue it with that version, read it with load_study, or start anew")
    return there


def _write(path: Path, content: str | bytes) -> None:
    if path.is_symlink():  # a store that came from elsewhere must not decide what else is written
        raise StoreError(str(path), "it is a link, and a store writes nothing outside its folder", "remove the link")
    with _faults(path):
        write_whole(path, content)


@contextlib.contextmanager
def _faults(path: Path) -> Iterator[None]:
    """What the operating system refuses, in the words of a store."""
    try:
        yield
    except OSError as error:
        found = f"it cannot be written or read ({reason(error)})"
        remedy = "nothing that was finished is lost: make room or name a folder that can be written, and run again"
        raise StoreError(str(path), found, remedy) from error
