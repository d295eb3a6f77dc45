"""The counts of a study as a file: how many trials ended in each way at each step, and nothing else of them.

``counts-0000000000-0001000000.parquet`` counts the trials from the first number on, up to and without the second. A
larger file takes the place of a smaller one as the study goes on.
"""

from __future__ import annotations

import hashlib
import re
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from tadcore._shared.files import MOST
from tadcore.errors import StoreError
from tadcore.game.outcome import UNPLAYED, OutcomeKind, ending_names
from tadcore.statistics.tally import Tally

from .place import Place
from .plan import Plan

_NAME = re.compile(r"counts-(\d{10})-(\d{10})\.parquet")
_LARGEST = 16 * MOST
_AGAIN = "put back a copy of this file, or delete it and run the study again"


class Counted(NamedTuple):
    """Consecutive trials, counted."""

    first: int
    end: int
    tally: Tally

    @property
    def name(self) -> str:
        """The name of its file."""
        return _name_of(self.first, self.end)


def _name_of(first: int, end: int) -> str:
    return f"counts-{first:010d}-{end:010d}.parquet"


def ranges_in(place: Place) -> list[tuple[int, int, str]]:
    """The files of counts of a place: first trial, end and name, by the first and then the largest first."""
    found = []
    for name in place.names():
        if not (name.startswith("counts-") and name.endswith(".parquet")):
            continue
        match = _NAME.fullmatch(name)
        if match is None or int(match[1]) >= int(match[2]):
            raise StoreError(place.at(name), "its name is not that of a file of counts", "move it out of this folder")
        found.append((int(match[1]), int(match[2]), name))
    return sorted(found, key=lambda entry: (entry[0], -entry[1]))


def content_of(counted: Counted, plan: Plan, study: str) -> memoryview:
    """The bytes of the file: a function of the counts and of the study alone."""
    tally, sc = counted.tally, plan.scenario
    names = ending_names(sc.n, games=bool(plan.games))
    lost = OutcomeKind.INTERCEPTED + sc.n
    code = np.where(tally.diverged, lost, np.where(tally.unplayed, lost + 1, tally.outcome))
    words = pa.DictionaryArray.from_arrays(pa.array(code.astype(np.int32)), pa.array(names))
    by = (tally.outcome >= OutcomeKind.INTERCEPTED) & ~tally.unplayed
    columns = {
        "outcome": words,
        "kind": pa.array(tally.kind.astype(np.int8)),
        "defender": pa.array(np.where(by, tally.outcome - OutcomeKind.INTERCEPTED, -1).astype(np.int32)),
        "diverged": pa.array(tally.diverged),
        "step": pa.array(tally.step),
        "trials": pa.array(tally.count),
    }
    said = {"study": study, "first": str(counted.first), "end": str(counted.end), "sha256": _digest(tally)}
    table = pa.table(columns).replace_schema_metadata({f"tadcore_{key}": value for key, value in said.items()})
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, version="2.6", compression="zstd", write_page_checksum=True)
    return memoryview(sink.getvalue())


def read_counts(place: Place, first: int, end: int, plan: Plan, study: str) -> Counted:
    """The counts of the trials from ``first`` to before ``end``, verified; raises `StoreError`."""
    sc = plan.scenario
    name = _name_of(first, end)
    path = place.at(name)
    found = place.strange(name)
    if found is not None:
        raise StoreError(path, f"it is {found}, not a file", "move it out of this folder")
    try:
        with place.source(name) as source:
            if source.size() > _LARGEST:
                raise ValueError(f"it has more than {_LARGEST >> 20} MiB")
            opened = pq.ParquetFile(source, page_checksum_verification=True)
            about = opened.metadata.metadata or {}
            table = opened.read()
        keys = ("study", "first", "end", "sha256")
        said = {key: about.get(f"tadcore_{key}".encode(), b"").decode() for key in keys}
        kind, defender, step, trials = (
            table[name].to_numpy().astype(np.int64) for name in ("kind", "defender", "step", "trials")
        )
        code = np.where(kind == OutcomeKind.INTERCEPTED, OutcomeKind.INTERCEPTED + defender, kind)
        code = np.where(kind == UNPLAYED, OutcomeKind.INTERCEPTED + sc.n, code)
        cells = (2 * code + table["diverged"].to_numpy()) * (sc.steps + 1) + step
    except (OSError, ValueError, KeyError, pa.ArrowException) as error:
        raise StoreError(path, f"it is damaged ({error})", _AGAIN) from None
    if said["study"] != study:
        raise StoreError(path, "it belongs to another study", "move it out of this folder, or name another store")
    tally = Tally(sc.n, sc.steps, cells, trials)
    last = 2 * (len(OutcomeKind) + sc.n) * (sc.steps + 1)
    whole = cells.size and cells[0] >= 0 and cells[-1] < last and (np.diff(cells) > 0).all() and (trials > 0).all()
    if not whole or (said["first"], said["end"], said["sha256"]) != (str(first), str(end), _digest(tally)):
        raise StoreError(path, "it is damaged (its counts are not those that were written)", _AGAIN)
    if tally.trials != end - first:
        raise StoreError(path, f"it counts {tally.trials:,} trials, and its name says {end - first:,}", _AGAIN)
    return Counted(first, end, tally)


def _digest(tally: Tally) -> str:
    return hashlib.sha256(tally.cells.astype("<i8").tobytes() + tally.count.astype("<i8").tobytes()).hexdigest()
