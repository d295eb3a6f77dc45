"""The outcomes of a study as Arrow tables, and their bytes as Parquet.

=============  =======  ======================================================================
column         type     meaning
=============  =======  ======================================================================
``trial``      int64    number of the trial, from 0
``kind``       int8     code of `tadcore.OutcomeKind`
``defender``   int32    the intercepting defender, 0-based; -1 where none intercepted
``time``       float64  the instant of the end
an input       float64  one for each varied component, such as ``attacker.position.x``
=============  =======  ======================================================================

The bytes of a part depend on its rows and its study alone: the settings of the writer are fixed, and no date is in it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from tadcore.sampling.design import CHUNK

from .plan import Outcomes

FIXED = {"trial": pa.int64(), "kind": pa.int8(), "defender": pa.int32(), "time": pa.float64()}


def schema_of(columns: Sequence[str]) -> pa.Schema:
    """The schema of a study's table; no entry is ever missing."""
    inputs = {name: pa.float64() for name in columns}
    return pa.schema([pa.field(name, kind, nullable=False) for name, kind in {**FIXED, **inputs}.items()])


def table_of(chunk: int, outcomes: Outcomes, schema: pa.Schema) -> pa.Table:
    """One chunk as a table."""
    first = chunk * CHUNK
    trial = np.arange(first, first + len(outcomes.kind), dtype=np.int64)
    inputs = np.ascontiguousarray(outcomes.inputs.T)
    arrays = [trial, outcomes.kind, outcomes.defender, outcomes.time, *inputs]
    return pa.Table.from_arrays([pa.array(array) for array in arrays], schema=schema)


def digest(table: pa.Table) -> str:
    """SHA-256 of every number of a table, column after column.

    The checksums of Parquet cover its pages alone: a bit that flips in the footer can make whole pages read as others.
    """
    total = hashlib.sha256()
    for column in table.columns:
        total.update(column.to_numpy().tobytes())
    return total.hexdigest()


def encoded(table: pa.Table, metadata: dict[str, str]) -> bytes:
    """A table as the bytes of a Parquet file, with checksums on its pages."""
    sink = pa.BufferOutputStream()
    pq.write_table(
        table.replace_schema_metadata(metadata),
        sink,
        version="2.6",
        compression="zstd",
        use_dictionary=["kind", "defender", "time"],
        row_group_size=CHUNK,
        write_page_checksum=True,
    )
    return sink.getvalue().to_pybytes()  # type: ignore[no-any-return]
