"""Printing for people: lines that fold to the width of the terminal, errors on standard error."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console


def say(text: str, *, indent: int = 0) -> None:
    """Print to standard output; folded to the width of a terminal, untouched in a pipe."""
    _print(_console(stderr=False), text, indent)


def complain(text: str) -> None:
    """Print an error to standard error."""
    _print(_console(stderr=True), f"error: {text}", 0)


def _console(*, stderr: bool) -> Console:
    from rich.console import Console

    return Console(stderr=stderr, highlight=False, markup=False, emoji=False)


def _print(console: Console, text: str, indent: int) -> None:
    from rich.text import Text

    for line in text.split("\n"):
        room = max(console.width - indent, 10)
        for part in Text(line).wrap(console, room) if console.is_terminal else [Text(line)]:
            part.rstrip()
            console.print(Text(" " * indent) + part, soft_wrap=True)
