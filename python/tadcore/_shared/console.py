"""Where people read: a terminal, or what stands for one."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

_NARROWEST, _WIDEST = 20, 10_000


def console(*, stderr: bool = False) -> Console:
    """Standard output or standard error, never without room for a word: ``COLUMNS=0`` would leave none for a letter."""
    from rich.console import Console

    made = Console(stderr=stderr, highlight=False, markup=False, emoji=False)
    made.width = min(max(made.width, _NARROWEST), _WIDEST)
    return made
