"""Text for people: tables for ``repr``, and what somebody may have meant."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence

from tadcore.errors import ScenarioError

_LONGEST = 200  # letters of a word that anything is looked up for


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


def one_of(field: str, value: object, known: Iterable[str]) -> str:
    """The value, if it is one of the known words; else raises `ScenarioError`, which lists them."""
    words = tuple(known)
    if isinstance(value, str) and value in words:
        return value
    hint = similar(value, words)
    raise ScenarioError(field, value, f"one of {', '.join(words)}{hint and f'; {hint}'}")


def similar(word: object, known: Iterable[str], *, most: int = 1, cutoff: float = 0.6) -> str:
    """``did you mean d1?`` where something known is near the word; empty where nothing is."""
    if not isinstance(word, str) or len(word) > _LONGEST:
        return ""
    close = difflib.get_close_matches(word, list(known), n=most, cutoff=cutoff)
    return f"did you mean {' or '.join(close)}?" if close else ""
