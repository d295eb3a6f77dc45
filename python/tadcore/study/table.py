"""The outcomes of a study as Arrow tables, and their bytes as Parquet.

The columns that every study has are `FIXED`, and `PASSED` where passes are looked for; behind them stands one for each
varied component, a float64 such as ``attacker.position.x``. What a column means and its unit are in the metadata of its
field; version, scenario, seed, design and the meanings again, as JSON for readers that see no fields' metadata, in the
metadata of the schema. So a part explains itself, to any reader of Parquet.

The bytes of a part depend on its rows and its study alone: the settings of the writer are fixed, and no date is in it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from tadcore import _core
from tadcore.game.outcome import UNPLAYED, OutcomeKind, ending_codes, ending_names
from tadcore.sampling.design import CHUNK
from tadcore.statistics.tally import Tally, steps_of

from .keeping import Keep
from .plan import Plan
from .task import Outcomes

_UNIT = "1"  # everything is dimensionless, as in the paper


@dataclass(frozen=True)
class Column:
    """A column that every study has: its type, what it means, and its values for the trials from a first one on."""

    type: pa.DataType
    meaning: str
    values: Callable[[int, Outcomes, Plan], Any]
    unit: str = ""


def _outcome(outcomes: Outcomes, plan: Plan) -> pa.DictionaryArray:
    n = plan.scenario.n
    codes = ending_codes(outcomes.kind, outcomes.defender, outcomes.diverged, n)
    return pa.DictionaryArray.from_arrays(codes, pa.array(ending_names(n, games=bool(plan.games))))


FIXED = {
    "trial": Column(
        pa.int64(), "number of the trial, from 0", lambda first, o, _: np.arange(first, first + len(o.kind))
    ),
    "outcome": Column(
        pa.dictionary(pa.int32(), pa.string()),
        "how the game ended: timeout, captured (the attacker reached the target), the defender that intercepted, or "
        "diverged, however it then ended; no_equilibrium where a trial has a game of its own, without one",
        lambda _, o, plan: _outcome(o, plan),
    ),
    "kind": Column(
        pa.int8(),
        "code of tadcore.OutcomeKind: 0 timeout, 1 captured, 2 intercepted; 3 no equilibrium, so not played",
        lambda _, o, __: o.kind,
    ),
    "defender": Column(
        pa.int32(),
        "the intercepting defender from 0, d1 being 0; -1 where none intercepted",
        lambda _, o, __: o.defender,
    ),
    "time": Column(pa.float64(), "the instant of the end, as the horizon T", lambda _, o, __: o.time, _UNIT),
    "diverged": Column(
        pa.bool_(),
        "whether the game diverged before its end or at it: somebody was more than 1000 times as far from the attacker "
        "as any two players at the start; kind, defender and time then say nothing of a pursuit",
        lambda _, o, __: o.diverged,
    ),
}
PASSED = {
    "passed": Column(
        pa.bool_(),
        "whether a capture radius was entered between two instants, before the one that ended the game: with "
        "continuous termination the game would end there",
        lambda _, o, __: o.passed,
    )
}
# What is compressed: drawn numbers hardly become smaller, and that takes half the time of encoding.
_OWN = FIXED.keys() | PASSED.keys()
_INPUTS = {
    "position": "where the player starts, one coordinate",
    "visibility_radius": "how far the player sees; inf without limit",
    "capture_radius": "how near the player must come to intercept or capture",
    "weight": "a weight of a player's cost",
    "fraction": "how much the attacker evades: 0 suicidal, 1 evading",
    "synthesis_weights": "a weight of a term of Theta",
    "horizon": "the horizon T of the trial",
    "step": "the step of the trial's grid",
}


def _own(plan: Plan) -> dict[str, Column]:
    """The columns of a study beside those of its inputs."""
    return FIXED | PASSED if plan.passes else FIXED


def schema_of(plan: Plan, keep: Keep) -> pa.Schema:
    """The schema of a study's table; no entry is ever missing."""
    inputs = {name: (pa.float64(), _INPUTS[q.field], _UNIT) for q in plan.quantities for name in q.columns}
    inputs = inputs if keep == "all" else {}
    columns = {name: (column.type, column.meaning, column.unit) for name, column in _own(plan).items()} | inputs
    about = {
        name: {"meaning": meaning} | ({"unit": unit} if unit else {}) for name, (_, meaning, unit) in columns.items()
    }
    fields = [pa.field(name, columns[name][0], nullable=False, metadata=about[name]) for name in columns]
    said = {
        "version": _core.__version__,
        "scenario": plan.scenario.to_toml(),
        "seed": str(plan.seed),
        "design": plan.design,
        "columns": json.dumps(about),
    }
    return pa.schema(fields, {f"tadcore_{key}": value for key, value in said.items()})


def table_of(first: int, chunks: Sequence[Outcomes], plan: Plan, schema: pa.Schema) -> pa.Table:
    """Consecutive chunks as a table, from the number of their first trial on."""
    outcomes = chunks[0] if len(chunks) == 1 else _joined(chunks)
    fixed = [column.values(first, outcomes, plan) for column in _own(plan).values()]
    inputs = () if outcomes.inputs is None else np.ascontiguousarray(outcomes.inputs.T)
    return pa.Table.from_arrays([pa.array(array) for array in (*fixed, *inputs)], schema=schema)


def _joined(chunks: Sequence[Outcomes]) -> Outcomes:
    kind, defender, time, diverged = (np.concatenate([chunk[i] for chunk in chunks]) for i in range(4))
    inputs, passed = (
        None if part[0] is None else np.concatenate(part) for part in zip(*(c[4:] for c in chunks), strict=True)
    )
    return Outcomes(kind, defender, time, diverged, inputs, passed)


def tally_of(table: pa.Table, plan: Plan) -> Tally:
    """How many rows of a table ended in each way at each step."""
    kind, defender, time, diverged = (table[name].to_numpy() for name in ("kind", "defender", "time", "diverged"))
    return plan.tally(Outcomes(kind, defender, time, diverged, None))


def flaw(table: pa.Table, first: int, plan: Plan) -> str | None:
    """What no study could have written, in words; None where every row can be how a game ended."""
    sc = plan.scenario
    kind, defender, time, diverged = (table[name].to_numpy() for name in ("kind", "defender", "time", "diverged"))
    own = "horizon" in plan.games  # each trial has a T of its own
    _, on_grid = steps_of(time, sc.horizon, sc.steps, between=plan.between)
    within = (time >= 0.0) & (time <= (np.inf if own else sc.horizon * (1.0 + 1e-9)))
    last = (kind != OutcomeKind.TIMEOUT) | (np.abs(time - sc.horizon) <= 1e-9 * sc.horizon) | own
    one = np.where(kind == OutcomeKind.INTERCEPTED, (defender >= 0) & (defender < sc.n), defender == -1)
    known = np.isin(kind, [*OutcomeKind, *([UNPLAYED] if plan.games else [])])
    names = ending_names(sc.n, games=bool(plan.games))
    same = _words(table, names) == ending_codes(kind * known, one * defender, diverged, sc.n)
    when = "a time" if plan.between else "an instant of the grid"
    rules = {
        "trial": (table["trial"].to_numpy() == np.arange(first, first + len(kind)), "the number of its row"),
        "kind": (known, "a code of tadcore.OutcomeKind"),
        "defender": (one, "a defender where one intercepted, and -1 elsewhere"),
        "time": ((on_grid | own) & within & last, f"{when} up to T = {sc.horizon:g}, for a timeout T itself"),
        "outcome": (same, "what kind, defender and diverged say"),
    }
    for name, (holds, rule) in rules.items():
        if not holds.all():
            row = int(np.argmin(holds))
            return f"trial {first + row:,} has the {name} {table[name][row].as_py()!r}, and it must be {rule}"
    return None


def _words(table: pa.Table, names: list[str]) -> NDArray[np.int32]:
    """The place of every outcome among the names; -1 for what is none of them."""
    found = []
    for chunk in table["outcome"].chunks:
        places = [names.index(word) if word in names else -1 for word in chunk.dictionary.to_pylist()]
        found.append(np.array([*places, -1], dtype=np.int32)[chunk.indices.to_numpy(zero_copy_only=False)])
    return np.concatenate(found) if found else np.zeros(0, dtype=np.int32)


def digests(table: pa.Table) -> list[str]:
    """SHA-256 of every number of each chunk, column after column; ``outcome`` says nothing that they do not.

    The checksums of Parquet cover its pages alone: a bit that flips in the footer can make whole pages read as others.
    """
    columns = [column.to_numpy() for column in table.drop_columns(["outcome"]).columns]
    return [_digest([column[start : start + CHUNK] for column in columns]) for start in range(0, len(table), CHUNK)]


def _digest(columns: Sequence[NDArray[Any]]) -> str:
    total = hashlib.sha256()
    for column in columns:
        total.update(column.data)
    return total.hexdigest()


def encoded(table: pa.Table, metadata: Mapping[str, str]) -> memoryview:
    """A table as the bytes of a Parquet file, a group of rows for each chunk, with checksums on its pages."""
    sink = pa.BufferOutputStream()
    pq.write_table(
        table.replace_schema_metadata({**table.schema.metadata, **metadata}),
        sink,
        version="2.6",
        compression=dict.fromkeys(set(table.column_names) & _OWN, "zstd"),
        use_dictionary=["outcome", "kind", "defender", "time"],
        column_encoding={"trial": "DELTA_BINARY_PACKED"},
        row_group_size=CHUNK,
        write_page_checksum=True,
    )
    return memoryview(sink.getvalue())
