"""A game's table of transitions on disk, so that the next study of the game reuses it."""

from __future__ import annotations

import contextlib
import os
import warnings
from collections.abc import Iterator
from pathlib import Path

from tadcore._shared.files import strange, write_whole
from tadcore.game.compiled import game_of
from tadcore.scenario.model import Scenario

NAME = "transitions.bin"
"""The file beside a store's parts."""


@contextlib.contextmanager
def warm(sc: Scenario, path: str | os.PathLike[str] | None) -> Iterator[None]:
    """Read the table before, and write it after if it has grown; outcomes are the same with it and without.

    A file of another game or version, or a damaged one, costs time and nothing else: it is replaced, with a warning.
    """
    if path is None:
        yield
        return
    game, place = game_of(sc), Path(path)
    held = 0
    if place.exists():
        try:
            found = strange(place)
            if found is not None:
                raise ValueError(f"it is {found}, not a file")
            held = game.load_table(place.read_bytes())
        except (ValueError, OSError) as error:
            warnings.warn(f"{place}: {error}; the study starts with an empty table", RuntimeWarning, stacklevel=4)
    yield
    if game.table()["entries"] > held:
        try:
            write_whole(place, game.save_table())
        except OSError as error:
            warnings.warn(f"{place}: the table was not saved ({error.strerror})", RuntimeWarning, stacklevel=4)
