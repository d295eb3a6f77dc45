"""Where the trials of a result are: in memory, in a store, or nowhere but in its counts."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from tadcore.errors import OutOfMemoryError, ScenarioError
from tadcore.sampling.design import CHUNK
from tadcore.statistics.tally import Tally

from . import parts
from .plan import Plan
from .store import Store
from .table import tally_of

EAGER = 2**22
"""Trials up to which a result with a store has its rows in memory; of longer ones they are read when asked for."""

MOST_BYTES = 1 << 32
"""Bytes of rows that are read, or drawn again, into memory because one asked for all."""


class Rows(Protocol):
    """The trials of a result, one row for each."""

    @property
    def trials(self) -> int:
        """How many there are."""

    @property
    def tally(self) -> Tally:
        """How many ended in each way at each step."""

    @property
    def names(self) -> list[str]:
        """The columns."""

    def table(self) -> pa.Table:
        """All rows, in memory."""

    def column(self, name: str) -> NDArray[Any]:
        """One column, in memory."""

    def head(self, trials: int) -> Rows:
        """The first of them."""

    def at(self, row: int) -> pa.Table:
        """One row."""

    def pieces(self) -> Iterator[pa.Table]:
        """The rows in their order, a part at a time."""


class InMemory:
    """Rows in a table."""

    def __init__(self, table: pa.Table, plan: Plan) -> None:
        self._table, self._plan = table, plan

    @property
    def trials(self) -> int:
        """How many there are."""
        return int(self._table.num_rows)

    @cached_property
    def tally(self) -> Tally:
        """Counted when first asked for."""
        return tally_of(self._table, self._plan)

    @property
    def names(self) -> list[str]:
        """The columns."""
        return list(self._table.column_names)

    def table(self) -> pa.Table:
        """The table itself."""
        return self._table

    def column(self, name: str) -> NDArray[Any]:
        """One column."""
        array: NDArray[Any] = self._table[name].to_numpy()
        return array

    def head(self, trials: int) -> InMemory:
        """The first of them."""
        return InMemory(self._table.slice(0, trials), self._plan)

    def at(self, row: int) -> pa.Table:
        """One row."""
        return self._table.slice(row, 1)

    def pieces(self) -> Iterator[pa.Table]:
        """The table, as it would lie in parts."""
        return (self._table.slice(first, parts.GROUP * CHUNK) for first in range(0, self.trials, parts.GROUP * CHUNK))


class InStore:
    """Rows of the first trials of a store; a part is opened, and verified, when its rows are asked for."""

    def __init__(self, store: Store, trials: int, tally: Tally | None = None) -> None:
        self._store, self.trials, self._known = store, trials, tally

    @cached_property
    def tally(self) -> Tally:
        """From the footers of the parts, unless it is known."""
        return self._store.tally(self._chunks, self.trials) if self._known is None else self._known

    @property
    def names(self) -> list[str]:
        """The columns."""
        return list(self._store.format.schema.names)

    def table(self) -> pa.Table:
        """All rows; raises `OutOfMemoryError` where they are too many to be read by accident."""
        self._refuse("the table", self.names)
        return pa.concat_tables([self._store.format.schema.empty_table(), *self.pieces()]).combine_chunks()

    def column(self, name: str) -> NDArray[Any]:
        """One column."""
        self._refuse(f"the column {name}", [name])
        return np.concatenate([piece[name].to_numpy() for piece in self.pieces()])

    def head(self, trials: int) -> InStore:
        """The first of them."""
        return InStore(self._store, min(trials, self.trials))

    def at(self, row: int) -> pa.Table:
        """One row."""
        _, table = next(self._store.read([row // CHUNK]))
        return table.slice(row % CHUNK, 1)

    def pieces(self) -> Iterator[pa.Table]:
        """The rows, a part at a time."""
        for first, table in self._store.read(self._chunks):
            yield table.slice(0, self.trials - first * CHUNK)

    @property
    def _chunks(self) -> range:
        return range(-(-self.trials // CHUNK))

    def _refuse(self, what: str, names: list[str]) -> None:
        schema = self._store.format.schema
        wide = sum(getattr(schema.field(name).type, "bit_width", 32) for name in names)
        size = self.trials * max(wide // 8, 1)
        if size > MOST_BYTES:
            raise OutOfMemoryError(
                f"{what} of {self.trials:,} trials, which pieces() reads part by part", size, MOST_BYTES
            )


class Counts:
    """No rows."""

    def __init__(self, tally: Tally) -> None:
        self.tally = tally

    @property
    def trials(self) -> int:
        """How many were counted."""
        return self.tally.trials

    @property
    def names(self) -> list[str]:
        """No columns."""
        return []

    def table(self) -> pa.Table:
        """Refuse."""
        raise self._nothing("the table")

    def column(self, name: str) -> NDArray[Any]:
        """Refuse."""
        raise self._nothing(f"the column {name}")

    def head(self, trials: int) -> Counts:
        """Refuse."""
        raise self._nothing("the rows")

    def at(self, row: int) -> pa.Table:
        """Refuse."""
        raise self._nothing("the rows")

    def pieces(self) -> Iterator[pa.Table]:
        """Refuse."""
        raise self._nothing("the rows")

    def _nothing(self, what: str) -> ScenarioError:
        return ScenarioError("keep", "counts", f'"outcomes" or "all": {what} of single trials are not kept')
