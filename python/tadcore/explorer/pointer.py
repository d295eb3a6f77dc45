"""The pointer during a drag: many movements, few pictures."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bokeh.document import Document

_GATHER = 8  # milliseconds in which movements are gathered into one
_PAUSE = 80  # milliseconds without a movement that count as a pause


class Pointer:
    """Calls ``drag`` with where the pointer is, not with all places where it has been, and ``pause`` when it pauses.

    A picture takes longer than a movement. Without this, movements would queue behind pictures, and the game would
    follow the pointer late.
    """

    def __init__(self, drag: Callable[[float, float], None], pause: Callable[[], None]) -> None:
        self._drag, self._pause = drag, pause
        self._at: tuple[float, float] | None = None
        self._waiting: Any = None
        self.document: Document | None = None

    def moved(self, x: float, y: float) -> None:
        """Note where the pointer is."""
        if self._at is None:
            self._after(_GATHER, self.follow)
        self._at = x, y

    def follow(self) -> None:
        """Go where the pointer is, if it has moved."""
        if self._at is not None:
            (x, y), self._at = self._at, None
            self._drag(x, y)
            self._after(_PAUSE, self._pause)

    def rest(self) -> None:
        """Something moved without the pointer: a pause follows, unless more moves before."""
        self._after(_PAUSE, self._pause)

    def _after(self, milliseconds: int, action: Callable[[], None]) -> None:
        """Do something later, instead of what was to be done later until now."""
        if self.document is None:
            return
        if self._waiting is not None:
            with contextlib.suppress(ValueError):  # it is done already
                self.document.remove_timeout_callback(self._waiting)
        self._waiting = self.document.add_timeout_callback(action, milliseconds)
