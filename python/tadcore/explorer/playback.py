"""The button that plays the run: it moves the instant that is shown, as fast as a clock says."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from bokeh.models import Toggle

if TYPE_CHECKING:
    from bokeh.document import Document

SECONDS = 6.0
"""How long a whole run takes on the screen."""
_EVERY = 40  # milliseconds from picture to picture


class Playback:
    """A switch; while it is on, ``forward`` is called with the share of the run that has passed since the last call.

    ``forward`` returns whether there is more to come; ``rewind`` brings back the beginning, where there is not.
    """

    def __init__(self, forward: Callable[[float], bool], rewind: Callable[[], None]) -> None:
        self._forward, self._rewind = forward, rewind
        self.button = Toggle(label="▶ play", width=80, align="end", name="play")
        self.button.on_change("active", lambda attribute, old, new: self._switched(bool(new)))
        self.document: Document | None = None
        self._clock: Any = None
        self._last = 0.0

    def toggle(self) -> None:
        """Play, or pause."""
        self.button.active = not self.button.active

    def stop(self) -> None:
        """Pause."""
        self.button.active = False

    def tick(self) -> None:
        """Go on by the time that has passed."""
        now = time.monotonic()
        passed, self._last = now - self._last, now
        if not self._forward(passed / SECONDS):
            self.stop()

    def _switched(self, on: bool) -> None:
        self.button.label = "⏸ pause" if on else "▶ play"
        if on:
            if not self._forward(0.0):
                self._rewind()
            self._last = time.monotonic()
        if self.document is not None:
            if on:
                self._clock = self.document.add_periodic_callback(self.tick, _EVERY)
            elif self._clock is not None:
                self.document.remove_periodic_callback(self._clock)
                self._clock = None
