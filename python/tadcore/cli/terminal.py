"""Printing for people: lines that fold to the width of the terminal, errors on standard error."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console


_NARROWEST, _WIDEST = 20, 10_000


def say(text: str, *, indent: int = 0) -> None:
    """Print to standard output; folded to the width of a terminal, untouched in a pipe."""
    _print(_console(stderr=False), text, indent)


def spill(text: str) -> None:
    """Write a file to standard output: in UTF-8, whatever the locale says, since that is what reads it back."""
    stream = getattr(sys.stdout, "buffer", None)
    if stream is None:
        if sys.stdout is not None:  # somebody else's stream of text
            sys.stdout.write(text)
        return
    sys.stdout.flush()
    stream.write(text.encode("utf-8"))
    stream.flush()


def complain(text: str) -> None:
    """Print an error to standard error."""
    _print(_console(stderr=True), f"error: {text}", 0)


def _console(*, stderr: bool) -> Console:
    from rich.console import Console

    console = Console(stderr=stderr, highlight=False, markup=False, emoji=False)
    console.width = min(max(console.width, _NARROWEST), _WIDEST)  # COLUMNS=0 would leave no room for a letter
    return console


def _print(console: Console, text: str, indent: int) -> None:
    from rich.text import Text

    for line in text.split("\n"):
        room = console.width - indent
        for part in Text(line).wrap(console, room) if console.is_terminal else [Text(line)]:
            part.rstrip()
            console.print(Text(" " * indent) + part, soft_wrap=True)
