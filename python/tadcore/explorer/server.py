"""A server on the loopback address, for this machine alone."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from bokeh.application import Application
from bokeh.application.handlers.function import FunctionHandler
from bokeh.server.server import BaseServer
from bokeh.server.tornado import BokehTornado
from bokeh.server.util import bind_sockets
from tornado.httpserver import HTTPServer
from tornado.httputil import HTTPMessageDelegate, HTTPServerRequest
from tornado.ioloop import IOLoop
from tornado.web import ErrorHandler

from tadcore.scenarios.given import ScenarioLike, as_scenario

from .desk import Desk
from .model import Explorer
from .work import stop_all

if TYPE_CHECKING:
    from bokeh.document import Document


_ADDRESS = "127.0.0.1"


class _Guarded(BokehTornado):  # type: ignore[misc]  # Bokeh is not installed everywhere
    """Answers what this machine's own pages ask, and nobody else.

    A page of another site may have its name lead to the loopback address, and then read what it is answered: the name
    that it asks for is checked. A connection that stays open is one of a page of this server, which says so; a program
    that says nothing of where it comes from gets none.
    """

    def __init__(self, hosts: frozenset[str], *arguments: Any, **options: Any) -> None:
        self.hosts = hosts
        super().__init__(*arguments, extra_websocket_origins=sorted(hosts), **options)

    def find_handler(self, request: HTTPServerRequest, **options: Any) -> HTTPMessageDelegate:
        """The handler of a request, or of its refusal."""
        if self._ours(request):
            handler: HTTPMessageDelegate = super().find_handler(request, **options)
            return handler
        refusal: HTTPMessageDelegate = self.get_handler_delegate(request, ErrorHandler, {"status_code": 403})
        return refusal

    def _ours(self, request: HTTPServerRequest) -> bool:
        if request.headers.get("Host", "").lower() not in self.hosts:
            return False
        origin = request.headers.get("Origin")
        if origin is None:
            return request.headers.get("Upgrade", "").lower() != "websocket"
        return origin.lower() in {f"http://{host}" for host in self.hosts}


def server(sc: ScenarioLike, port: int = 0) -> BaseServer:
    """A server that shows a page of its own, starting from ``sc``, to each visitor; port 0 takes a free one."""
    start = as_scenario(sc)
    Explorer(start)  # refuse a bad scenario here and not in the first visitor's browser

    def visit(document: Document) -> None:
        Desk(Explorer(start)).add_to(document)

    sockets, port = bind_sockets(_ADDRESS, port)
    hosts = frozenset(f"{name}:{port}" for name in ("localhost", _ADDRESS))
    pages = HTTPServer(_Guarded(hosts, {"/": Application(FunctionHandler(visit))}))
    pages.add_sockets(sockets)
    return BaseServer(IOLoop.current(), pages.request_callback, pages)


def serve(sc: ScenarioLike, *, port: int = 0, browse: bool = True, ready: Callable[[str], None] = print) -> None:
    """Serve the explorer until interrupted.

    Parameters
    ----------
    sc : Scenario, path or name
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
        stop_all()
