"""A server on the loopback address, for this machine alone."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from bokeh.application import Application
from bokeh.application.handlers.function import FunctionHandler
from bokeh.server.server import Server

from tadcore.scenario.model import Scenario

from .model import Explorer
from .page import Page

if TYPE_CHECKING:
    from bokeh.document import Document


_ADDRESS = "127.0.0.1"


def server(sc: Scenario, port: int = 0) -> Server:
    """A server that shows a page of its own, starting from ``sc``, to each visitor; port 0 takes a free one."""
    Explorer(sc)  # refuse a bad scenario here and not in the first visitor's browser

    def visit(document: Document) -> None:
        Page(Explorer(sc)).add_to(document)

    return Server({"/": Application(FunctionHandler(visit))}, port=port, address=_ADDRESS)


def serve(sc: Scenario, *, port: int = 0, browse: bool = True, ready: Callable[[str], None] = print) -> None:
    """Serve the explorer until interrupted.

    Parameters
    ----------
    sc : Scenario
        Where to begin.
    port : int
        The port on the loopback address; 0 takes a free one.
    browse : bool
        Whether to open the page in the browser.
    ready : callable
        Called with the page's address once it is there.

    Raises
    ------
    NoEquilibriumError
        The game has no equilibrium on [0, T].
    OSError
        The port is taken.
    """
    running = server(sc, port)
    running.start()
    ready(f"http://localhost:{running.port}/")
    if browse:
        running.io_loop.add_callback(running.show, "/")
    try:
        running.io_loop.start()
    except KeyboardInterrupt:
        pass
    finally:
        running.stop()
