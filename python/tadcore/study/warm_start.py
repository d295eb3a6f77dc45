"""A game's table of transitions on disk, so that the next study of the game reuses it."""

from __future__ import annotations

import contextlib
import os
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from tadcore._shared.files import destination, strange, write_whole
from tadcore.errors import ScenarioError
from tadcore.game.compiled import game_of
from tadcore.scenario.model import Scenario

if TYPE_CHECKING:
    from tadcore._core import Game

_START = 40  # bytes in which a table says how long it is
_MAGIC = b"tadtable"  # how every saved table begins, whatever its format; a test compares it with the core's


@contextlib.contextmanager
def warm(sc: Scenario, path: Path | None) -> Iterator[None]:
    """Read the table before, and write it after if it has grown; outcomes are the same with it and without.

    A table of another game or version, or a damaged one, costs time and nothing else: it is replaced, with a warning.
    What is no table, a scenario or a part given by mistake, is not touched: raises `ScenarioError`.
    """
    if path is None:
        yield
        return
    game = game_of(sc)
    held = 0
    if _is_table(path):
        try:
            held = _load(game, path)
        except (ValueError, OSError) as error:
            warnings.warn(f"{path}: {error}; the study starts with an empty table", RuntimeWarning, stacklevel=4)
    yield
    if game.table()["entries"] > held:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_whole(path, game.save_table())
        except OSError as error:
            warnings.warn(f"{path}: the table was not saved ({error.strerror})", RuntimeWarning, stacklevel=4)


_read: set[tuple[int, Path]] = set()


def read_once(sc: Scenario, path: Path) -> None:
    """Read the table in a worker, before its first chunk; what cannot be read costs time and nothing else.

    Every process has a copy: of a table of 44 MB the reading takes 0.16 s, its entries then 113 MB, and mapping the
    file would save neither, since the entries lie otherwise in memory than in the file.
    """
    game = game_of(sc)
    if (id(game), path) not in _read:
        _read.add((id(game), path))
        try:
            _load(game, path)
        except (ValueError, OSError) as error:
            said = f"{path}: {error}; this worker begins with an empty table"
            warnings.warn(said, RuntimeWarning, stacklevel=2)


def _is_table(path: Path) -> bool:
    """Whether there is a table to read, whole or not; raises `ScenarioError` for what must not be replaced by one."""
    rule = "a table that a study has saved, or a new name"
    try:
        if destination(path) is None:
            return False
        found = strange(path)
        if found is not None:
            raise ScenarioError("table", os.fspath(path), f"{rule}: this is {found}")
        with path.open("rb") as stream:
            begins = stream.read(len(_MAGIC))
    except OSError as error:
        raise ScenarioError("table", os.fspath(path), f"{rule}: {error.strerror or error}") from None
    if begins not in (_MAGIC, b""):
        raise ScenarioError("table", os.fspath(path), f"{rule}: this is another file, which would be lost")
    return True


def _load(game: Game, path: Path) -> int:
    """Entries that the game holds with those of the file, whose size is checked before it is read."""
    with path.open("rb") as stream:
        size = os.fstat(stream.fileno()).st_size
        length = game.table_length(stream.read(_START))
        if size != length:
            raise ValueError(f"the table is damaged: it has {size:,} bytes, and says {length:,}")
        stream.seek(0)
        return game.load_table(stream.read(length))
