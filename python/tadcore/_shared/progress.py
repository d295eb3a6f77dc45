"""The progress bar of everything that takes long."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TypeVar

Item = TypeVar("Item")


def bar(items: Iterable[Item], what: str, *, show: bool, total: int | None = None) -> Iterable[Item]:
    """The items one by one, with a progress bar where one is wanted and standard error is a terminal."""
    if not show:
        return items
    from tqdm.auto import tqdm

    progress: Iterable[Item] = tqdm(items, desc=what, total=total, disable=None)  # None: quiet in a pipe
    return progress


def pieces(rows: int, size: int, what: str, *, show: bool) -> Iterator[slice]:
    """Consecutive rows: all at once, or so many at a time with a progress bar over the rows."""
    if not show or rows <= size:
        yield slice(0, rows)
        return
    from tqdm.auto import tqdm

    with tqdm(desc=what, total=rows, unit="", unit_scale=True, disable=None) as progress:
        for first in range(0, rows, size):
            last = min(first + size, rows)
            yield slice(first, last)
            progress.update(last - first)
