"""A comparison with the paper as a terminal table, as Markdown and as JSON."""

from __future__ import annotations

import textwrap
from dataclasses import asdict, dataclass, field
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .published import I2_NOTE

if TYPE_CHECKING:
    from rich.console import Console


_WIDE = 96  # columns of a terminal from which on the case stands in a column of its own


@dataclass(frozen=True, slots=True)
class Row:
    """One quantity of one run: what the paper prints and what was computed."""

    scenario: str
    case: str
    quantity: str
    paper: float | str | None
    computed: float | str | None
    required: bool
    """Whether a difference makes the reproduction fail."""
    agrees: bool
    source: str

    @property
    def difference(self) -> float | None:
        """Computed minus paper, for numbers on both sides."""
        if isinstance(self.paper, float) and isinstance(self.computed, float):
            return 0.0 if self.agrees else self.computed - self.paper
        return None

    @property
    def ok(self) -> bool:
        """Whether this row lets the reproduction pass."""
        return self.agrees or not self.required

    def cells(self) -> tuple[str, str, str, str]:
        """Return quantity, paper, computed and difference, as printed."""
        gap = self.difference
        words = "same" if self.agrees else "other"
        difference = words if gap is None else f"{gap:+.3f}" if gap else "0"
        mark = "" if self.ok else " ✗"
        return self.quantity, _cell(self.paper), _cell(self.computed), difference + mark


def _cell(value: float | str | None) -> str:
    if value is None:
        return "–"
    if isinstance(value, str):
        return value
    return f"{value:.0e}" if 0 < abs(value) < 1e-6 else f"{value:.6g}"


@dataclass(frozen=True, slots=True)
class Report:
    """What `tadcore.reproduce.reproduce` found.

    Attributes
    ----------
    rows : tuple of Row
        Every comparison, in the order of the paper's text.
    version : str
        The version of tadcore that computed.
    files : tuple of Path
        Every file written.
    note : str
        Why the times of interaction I2 differ.
    """

    rows: tuple[Row, ...]
    version: str
    files: tuple[Path, ...] = ()
    note: str = field(default=I2_NOTE)

    @property
    def ok(self) -> bool:
        """Whether every number that must be the paper's is."""
        return all(row.ok for row in self.rows)

    @property
    def failures(self) -> tuple[Row, ...]:
        """The rows that must agree and do not."""
        return tuple(row for row in self.rows if not row.ok)

    @property
    def verdict(self) -> str:
        """Whether the paper is reproduced, in one sentence."""
        required = [row for row in self.rows if row.required]
        if self.ok:
            return f"All {len(required)} numbers that must agree with the paper do."
        return f"{len(self.failures)} of the {len(required)} numbers that must agree with the paper do not."

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, ready for JSON."""
        return {
            "version": self.version,
            "ok": self.ok,
            "verdict": self.verdict,
            "note": self.note,
            "rows": [{**asdict(row), "difference": row.difference, "ok": row.ok} for row in self.rows],
        }

    def to_markdown(self) -> str:
        """Return the tables as a Markdown page."""
        lines = ["# The runs of the paper's section VI", "", f"Computed by tadcore {self.version}. {self.verdict}", ""]
        lines += ["| case | quantity | paper | computed | difference |", "|---|---|---|---|---|"]
        for case, rows in self._cases():
            for i, row in enumerate(rows):
                lines.append("| " + " | ".join([case if i == 0 else "", *row.cells()]) + " |")
        return "\n".join([*lines, "", textwrap.fill(self.note, 110), ""])

    def print(self, console: Console) -> None:
        """Print the tables, the note and the verdict, as wide as the console is."""
        from rich.padding import Padding
        from rich.text import Text

        wide = console.width >= _WIDE
        if wide:
            console.print(self._table(wide=True))
        else:
            for case, rows in self._cases():
                console.print(Text(case, style="bold"))
                console.print(self._table(wide=False, only=rows))
        console.print(Padding(Text(self.note, style="dim"), (1, 0)))
        console.print(Text(self.verdict, style="bold green" if self.ok else "bold red"))

    def __str__(self) -> str:
        return self.verdict

    def _cases(self) -> list[tuple[str, list[Row]]]:
        return [(case, list(rows)) for case, rows in groupby(self.rows, key=lambda row: row.case)]

    def _table(self, *, wide: bool, only: list[Row] | None = None) -> Any:
        from rich import box
        from rich.table import Table

        table = Table(box=box.SIMPLE_HEAD if wide else None, pad_edge=wide, padding=(0, 1) if wide else (0, 1, 0, 0))
        if wide:
            table.add_column("case", no_wrap=True)
        table.add_column("quantity", min_width=10)
        for name in ("paper", "computed"):
            table.add_column(name, justify="right", min_width=10)
        table.add_column("difference" if wide else "differ.", justify="right", min_width=7)
        for case, rows in self._cases() if only is None else [("", only)]:
            for i, row in enumerate(rows):
                style = "bold red" if not row.ok else ""
                table.add_row(*([case if i == 0 else ""] if wide else []), *row.cells(), style=style)
            table.add_section()
        return table
