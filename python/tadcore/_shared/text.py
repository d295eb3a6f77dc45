"""Tables as plain text, for ``repr``."""

from __future__ import annotations

from collections.abc import Sequence


def as_text(title: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A title, a head and rows in columns: the first and the last flush left, numbers between them flush right."""
    table = [list(head), *map(list, rows)]
    widths = [max(len(row[j]) for row in table) for j in range(len(head))]
    last = len(head) - 1
    lines = [
        "  ".join(cell.ljust(w) if j in (0, last) else cell.rjust(w) for j, (cell, w) in enumerate(zip(row, widths)))  # noqa: B905
        for row in table
    ]
    return "\n".join([title, *(line.rstrip() for line in lines)])
