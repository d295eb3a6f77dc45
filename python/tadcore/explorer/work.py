"""Work beside the page: a thread that hands over pictures as they come, and can be stopped."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, Generic, TypeVar
from weakref import WeakSet

from tadcore import _core
from tadcore.errors import TadcoreError

Piece = TypeVar("Piece")
_running: WeakSet[Work[Any]] = WeakSet()


class Work(Generic[Piece]):
    """Pieces of work, made in a thread of its own and shown on the page's.

    Parameters
    ----------
    make : callable
        Yields the pieces, and polls the stop that it is given.
    show, fail : callable
        Called on the page's thread with a piece, if no later one is there already, or with an error.
    post : callable
        Has something called on the page's thread.
    """

    def __init__(
        self,
        make: Callable[[_core.Stop], Iterator[Piece]],
        show: Callable[[Piece], None],
        fail: Callable[[TadcoreError], None],
        post: Callable[[Callable[[], None]], object],
    ) -> None:
        self._make, self._show, self._fail, self._post = make, show, fail, post
        self._stop, self._stopped = _core.Stop(), False
        self._waiting: list[Piece] = []
        self._thread = threading.Thread(target=self._run, name="tadcore-map")
        _running.add(self)
        self._thread.start()

    def stop(self) -> None:
        """Show nothing more, and end soon."""
        self._stopped = True
        self._stop.set()

    def join(self) -> None:
        """Wait for the end."""
        self._thread.join()

    def _run(self) -> None:
        try:
            for piece in self._make(self._stop):
                if self._stopped:
                    return
                self._waiting.append(piece)
                self._post(self._hand_over)
        except (TadcoreError, KeyboardInterrupt) as error:  # stopped, the core says that it was interrupted
            if not self._stopped and isinstance(error, TadcoreError):
                self._post(partial(self._give_up, error))

    def _give_up(self, error: TadcoreError) -> None:
        if not self._stopped:
            self._fail(error)

    def _hand_over(self) -> None:
        """Show the latest of what waits; the rest is old."""
        waiting, self._waiting = self._waiting, []
        if waiting and not self._stopped:
            self._show(waiting[-1])


def stop_all() -> None:
    """Stop everything that runs in this process, and wait for it."""
    for work in list(_running):
        work.stop()
    for work in list(_running):
        work.join()
