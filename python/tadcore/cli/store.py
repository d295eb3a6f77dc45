# ruff: noqa: D301 (the help texts mark blocks that keep their lines with a backspace character)
"""The ``store`` commands: what is done with the folder of a study."""

from __future__ import annotations

from typing import Annotated

import typer

from .options import FAILED, Progress
from .terminal import say

store = typer.Typer(no_args_is_help=True, rich_markup_mode=None)
"""The group of commands."""

Folder = Annotated[str, typer.Argument(metavar="DIR", help="The folder of a study, or its URL.")]


@store.callback()
def _top() -> None:
    """Look after the folder of a study."""


@store.command(name="verify", short_help="Read everything that a store holds.")
def verify_store(
    folder: Folder,
    progress: Progress = True,
) -> None:
    """Read every file of a store: digests, counts, and that games can end so.

    \b
      tadcore store verify out

    A file that is damaged, or of another study, is named; the exit code is 2.
    """
    from tadcore.study.reading import verify_store as verified

    found = verified(folder, progress=progress)
    say(f"{found:,} trials, all as they were written")


@store.command(name="merge", short_help="Make one store of the parts of a study.")
def merge(folder: Folder) -> None:
    """Make one store of what the jobs of ``tadcore study --part I/N`` have left in DIR.

    \b
      tadcore store merge out

    Trials that no finished part has are left out: ``tadcore study`` with the same store plays these. The exit code is 1
    where there are such.
    """
    from tadcore.study.merging import merge_store

    found = merge_store(folder)
    say(f"{found.parts} part{'' if found.parts == 1 else 's'} merged: {found.trials:,} of {found.wanted:,} trials")
    if found.trials < found.wanted:
        raise typer.Exit(FAILED)
