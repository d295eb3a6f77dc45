"""Printing for people: lines that fold to the width of the terminal, errors on standard error."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from tadcore._shared.console import console

if TYPE_CHECKING:
    from rich.console import Console


def say(text: str, *, indent: int = 0) -> None:
    """Print to standard output; folded to the width of a terminal, untouched in a pipe."""
    _print(console(stderr=False), text, indent)


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
    _print(console(stderr=True), f"error: {text}", 0)


def _print(to: Console, text: str, indent: int) -> None:
    from rich.text import Text

    for line in text.split("\n"):
        room = to.width - indent
        for part in Text(line).wrap(to, room) if to.is_terminal else [Text(line)]:
            part.rstrip()
            to.print(Text(" " * indent) + part, soft_wrap=True)
