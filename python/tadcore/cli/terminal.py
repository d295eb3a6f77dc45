"""Printing for people: lines that fold to the width of the terminal, errors on standard error."""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING, Any

from tadcore._shared.console import console

if TYPE_CHECKING:
    from rich.console import Console


_hushed = False


def hush(wanted: bool) -> bool:
    """Print nothing more with `say`, or, for the next command, print again; returns what is wanted."""
    global _hushed
    _hushed = wanted
    return wanted


def hushed() -> bool:
    """Whether nothing is to be printed but errors, and what was asked for as JSON."""
    return _hushed


def say(text: str, *, indent: int = 0) -> None:
    """Print to standard output, unless it is hushed; folded to the width of a terminal, untouched in a pipe."""
    if not _hushed:
        _print(console(stderr=False), text, indent)


def emit(found: dict[str, Any]) -> None:
    """Print a result as JSON, and nothing else on standard output."""
    spill(json.dumps(found, indent=2, ensure_ascii=False, allow_nan=False) + "\n")


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


def sign_of_life(what: str) -> None:
    """Say on standard error, where a terminal watches, what takes a while."""
    if not _hushed and sys.stderr is not None and sys.stderr.isatty():
        _print(console(stderr=True), f"{what} …", 0)


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
