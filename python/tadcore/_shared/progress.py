"""The progress bar of everything that takes long."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

Item = TypeVar("Item")


def bar(items: Iterable[Item], what: str, *, show: bool, total: int | None = None) -> Iterable[Item]:
    """The items one by one, with a progress bar where one is wanted and standard error is a terminal."""
    if not show:
        return items
    from tqdm.auto import tqdm

    progress: Iterable[Item] = tqdm(items, desc=what, total=total, disable=None)  # None: quiet in a pipe
    return progress
