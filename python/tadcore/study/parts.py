"""One part of a store: a Parquet file with the rows of consecutive chunks, a group of rows for each.

Its name says which trials it holds: ``part-0000000000-0000524288.parquet`` has those from the first number on, up to
and without the second. Its footer says so again, with the digest of the study, a digest of the rows of every chunk, and
the counts of its outcomes.
"""

from __future__ import annotations

import base64
import contextlib
import re
import zlib
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from tadcore.errors import ScenarioError, StoreError
from tadcore.sampling.design import CHUNK
from tadcore.statistics.tally import Tally

from .keeping import Keep
from .place import Place
from .plan import Plan
from .table import digests, encoded, flaw, schema_of, table_of, tally_of
from .task import Outcomes, Written

GROUP = 64
"""Chunks in a part at most: a billion trials are 1,908 files. Parts begin at multiples of it."""

_NAME = re.compile(r"part-(\d{10})-(\d{10})\.parquet")
_AGAIN = "delete this file and run the study again: only its trials are computed anew"
_LARGEST_TALLY = 1 << 18  # bytes in a footer; what has more cells is counted from the rows


class Part(NamedTuple):
    """Some consecutive trials, which a file has."""

    first: int
    """The first trial, a multiple of `CHUNK`."""
    end: int
    """One past the last."""

    @property
    def name(self) -> str:
        """The name of its file."""
        return f"part-{self.first:010d}-{self.end:010d}.parquet"

    @property
    def chunks(self) -> range:
        """The chunks that it holds, the last perhaps cut."""
        return range(self.first // CHUNK, -(-self.end // CHUNK))


class Join(NamedTuple):
    """What is asked of a worker where smaller parts are to become one."""

    first: int
    """The first chunk."""
    pieces: tuple[tuple[Part, range], ...]
    """Consecutive parts, with the chunks that are taken of each."""

    @property
    def last(self) -> int:
        """The last chunk."""
        return self.pieces[-1][1][-1]


class Joined(NamedTuple):
    """What comes back."""

    task: Join
    written: tuple[Written, ...]


def parts_in(place: Place) -> set[Part]:
    """The parts that are there; raises `StoreError` for a name that is none's, and for what is no file."""
    found = set()
    for name in place.names():
        if not (name.startswith("part-") and name.endswith(".parquet")):
            continue
        match = _NAME.fullmatch(name)
        part = Part(int(match[1]), int(match[2])) if match is not None else None
        most = GROUP * CHUNK
        if part is None or part.first % CHUNK or not part.first < part.end <= part.first // most * most + most:
            raise StoreError(place.at(name), "its name is not that of a part", "move it out of this folder")
        strange = place.strange(name)
        if strange is not None:
            raise StoreError(place.at(name), f"it is {strange}, not a file", "move it out of this folder")
        found.add(part)
    return found


class Format:
    """How the parts of one study are written, read and verified."""

    def __init__(self, place: Place, plan: Plan, study: str, keep: Keep) -> None:
        self.place = place
        self.plan = plan
        self.study = study
        self.schema = schema_of(plan, keep)

    def table(self, first: int, chunks: Sequence[Outcomes]) -> pa.Table:
        """Outcomes of consecutive chunks as rows."""
        return table_of(first, chunks, self.plan, self.schema)

    def put(self, first: int, table: pa.Table, still: Callable[[], bool] = lambda: True) -> Written | None:
        """Write the rows from a trial on as a part, whose bytes are a function of them and of the study alone.

        None where ``still``, asked when all is ready to be written, says no.
        """
        part, found = Part(first, first + len(table)), digests(table)
        said = {
            "study": self.study,
            "first": str(first),
            "rows": str(len(table)),
            "sha256": " ".join(found),
            "tally": _packed(tally_of(table, self.plan)),
        }
        content = encoded(table, {f"tadcore_{key}": value for key, value in said.items()})
        if not still():
            return None
        self.place.write(part.name, content)
        return Written(part.first, part.end, tuple(found))

    def confirm(self, written: Written) -> Part:
        """The part that somebody says to have written; raises `StoreError` where it is not to be found here."""
        part = Part(written.first, written.end)
        if not self.place.exists(part.name):
            found = "a worker says that it has written it, and it is not there"
            raise StoreError(self.place.at(part.name), found, "let the workers and this process share one folder")
        with self._opened(part) as opened:
            said = self.footer(part, opened)["sha256"].split()
        if said != list(written.digests):
            raise StoreError(self.place.at(part.name), "it does not hold what a worker has written", _AGAIN)
        return part

    def join(self, task: Join, still: Callable[[], bool]) -> Joined:
        """Write the rows of several parts as one."""
        rows = pa.concat_tables([self.read(part, held) for part, held in task.pieces])
        written = self.put(task.first * CHUNK, rows, still)
        return Joined(task, () if written is None else (written,))

    def footer(self, part: Part, opened: pq.ParquetFile) -> dict[str, str]:
        """What a part says of itself; raises `StoreError` where that is not what its name says."""
        path = self.place.at(part.name)
        about = opened.metadata.metadata or {}
        keys = ("study", "first", "rows", "sha256", "tally")
        said = {key: about.get(f"tadcore_{key}".encode(), b"").decode() for key in keys}
        rows, groups, schema = opened.metadata.num_rows, opened.metadata.num_row_groups, opened.schema_arrow
        if said["study"] != self.study:
            found = "another study" if said["study"] else "no study"
            raise StoreError(path, f"it belongs to {found}", "move it out of this folder, or name another store")
        if said["first"] != str(part.first):
            found = f"it holds the trials from {said['first']} on, not from {part.first}"
            raise StoreError(path, found, "give it its name back")
        if not said["rows"] == str(rows) == str(part.end - part.first):
            raise StoreError(
                path, f"it has {rows} rows, says {said['rows']}, and is named for {part.end - part.first}", _AGAIN
            )
        if schema.names != self.schema.names or not schema.equals(self.schema):
            raise StoreError(path, f"its columns are {schema.names}, not {self.schema.names}", _AGAIN)
        if not groups == len(part.chunks) == len(said["sha256"].split()):
            raise StoreError(path, f"it has {groups} groups of rows, and its chunks are {len(part.chunks)}", _AGAIN)
        return said

    def tally(self, part: Part) -> Tally:
        """The counts of a part, from its footer if it has them."""
        with self._opened(part) as opened:
            packed = self.footer(part, opened)["tally"]
        if not packed:
            return tally_of(self.read(part), self.plan)
        found = _unpacked(packed, self.plan)
        if found is None or found.trials != part.end - part.first:
            raise StoreError(self.place.at(part.name), "its counts are none of its trials", _AGAIN)
        return found

    def read(self, part: Part, chunks: range | None = None) -> pa.Table:
        """The rows of a part, or of some of its chunks, verified: pages, digests, and that games can end so."""
        wanted = part.chunks if chunks is None else chunks
        places = [chunk - part.chunks.start for chunk in wanted]
        with self._opened(part) as opened:
            said = self.footer(part, opened)["sha256"].split()
            table = opened.read_row_groups(places).cast(self.schema)
            whole = digests(table) == [said[place] for place in places]
        if not whole:
            raise StoreError(
                self.place.at(part.name), "it is damaged (its rows are not those that were written)", _AGAIN
            )
        # A digest tells an accident, not an intention: what cannot be an outcome is none, whatever is said of it.
        found = flaw(table, wanted.start * CHUNK, self.plan)
        if found is None and len(self.plan.columns) and self.plan.columns[0] in table.column_names:
            try:
                inputs = np.stack([table[name].to_numpy() for name in self.plan.columns], axis=1)
                self.plan.check(wanted.start, inputs)
            except ScenarioError as error:
                found = str(error)
        if found is not None:
            raise StoreError(self.place.at(part.name), f"its rows are no outcomes of this study ({found})", _AGAIN)
        return table

    def verify(self, part: Part) -> int:
        """Read all of a part, its counts too; how many trials it has."""
        table, tally = self.read(part), self.tally(part)
        if tally != tally_of(table, self.plan):
            raise StoreError(self.place.at(part.name), "its counts are not those of its rows", _AGAIN)
        return len(table)

    @contextlib.contextmanager
    def _opened(self, part: Part) -> Iterator[pq.ParquetFile]:
        """A part, open; what is no Parquet file, and what is damaged, is named."""
        path = self.place.at(part.name)
        with contextlib.ExitStack() as until_the_end:
            try:
                source = until_the_end.enter_context(self.place.source(part.name))
                opened = pq.ParquetFile(source, page_checksum_verification=True, pre_buffer=True)
            except (OSError, ValueError, pa.ArrowException) as error:
                raise StoreError(path, f"it is truncated or no Parquet file ({error})", _AGAIN) from None
            try:
                yield opened
            except StoreError:
                raise
            except (OSError, ValueError, pa.ArrowException) as error:
                raise StoreError(path, f"it is damaged ({error})", _AGAIN) from None


def _packed(tally: Tally) -> str:
    """A tally as a short text; empty where it would be long."""
    if 16 * len(tally.cells) > 4 * _LARGEST_TALLY:
        return ""
    numbers = np.concatenate([np.diff(tally.cells, prepend=0), tally.count]).astype("<i8")
    text = base64.b85encode(zlib.compress(numbers.tobytes(), 6)).decode("ascii")
    return text if len(text) <= _LARGEST_TALLY else ""


def _unpacked(text: str, plan: Plan) -> Tally | None:
    """The inverse; None for what is no tally of this game."""
    steps, n = plan.scenario.steps, plan.scenario.n
    try:
        unpacker = zlib.decompressobj()
        data = unpacker.decompress(base64.b85decode(text), 4 * _LARGEST_TALLY)
        numbers = np.frombuffer(data, dtype="<i8").astype(np.int64)
    except (ValueError, zlib.error):
        return None
    if unpacker.unconsumed_tail or not unpacker.eof or not numbers.size or numbers.size % 2:
        return None
    apart, count = np.split(numbers, 2)
    cells = np.cumsum(apart)
    last = 2 * (3 + n) * (steps + 1)
    fits = apart[0] >= 0 and (apart[1:] > 0).all() and cells[-1] < last and (count > 0).all()
    return Tally(n, steps, cells, count) if fits else None
