# ruff: noqa: D301 (the help texts mark blocks that keep their lines with a backspace character)
"""The ``store`` commands: what is done with the folder of a study."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .terminal import say

store = typer.Typer(no_args_is_help=True, rich_markup_mode=None)
"""The group of commands."""

Folder = Annotated[Path, typer.Argument(metavar="DIR", help="The folder of a study.")]


@store.callback()
def _top() -> None:
    """Look after the folder of a study."""


@store.command(name="verify", short_help="Read everything that a store holds.")
def verify_store(
    folder: Folder,
    progress: Annotated[bool, typer.Option(help="Show a progress bar, where a terminal watches.")] = True,
) -> None:
    """Read every file of a store: digests, counts, and that games can end so.

    \b
      tadcore store verify out

    A file that is damaged, or of another study, is named; the exit code is 2.
    """
    from tadcore.study.reading import verify_store as verified

    found = verified(folder, progress=progress)
    say(f"{found:,} trials, all as they were written")
