"""Results as notebooks show them: a title, tables, pictures; whatever comes from outside is escaped."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

_CELL = "padding:0.15em 0.7em;text-align:{};white-space:nowrap"


def as_html(title: str, head: Sequence[str], rows: Sequence[Sequence[str]], *more: str, words: bool = False) -> str:
    """A table under its title: first and last column flush left, numbers between them flush right; then ``more``.

    A table of ``words`` is flush left throughout.
    """
    last = len(head) - 1

    def cells(row: Sequence[str], tag: str) -> str:
        sides = ["left" if words or i in (0, last) else "right" for i in range(len(row))]
        return "".join(
            f'<{tag} style="{_CELL.format(side)}">{escape(cell)}</{tag}>' for cell, side in zip(row, sides, strict=True)
        )

    body = "".join(f"<tr>{cells(row, 'td')}</tr>" for row in rows)
    table = f"<table><thead><tr>{cells(head, 'th')}</tr></thead><tbody>{body}</tbody></table>"
    return block(title, table if rows else "", *more)


def block(title: str, *parts: str) -> str:
    """Parts, which are HTML, under a title, which is text."""
    return f"<div><div><b>{escape(title)}</b></div>{''.join(parts)}</div>"


def line(text: str) -> str:
    """A line of text."""
    return f"<div>{escape(text)}</div>"


def thinned(rows: Sequence[Sequence[str]], most: int = 24) -> list[Sequence[str]]:
    """The rows, or where they are many the first and the last with a row of dots between them."""
    if len(rows) <= most:
        return list(rows)
    half = most // 2
    return [*rows[:half], ["…"] * len(rows[0]), *rows[-half:]]
