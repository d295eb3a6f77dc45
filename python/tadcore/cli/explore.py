"""The command ``tadcore explore``."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Annotated

import typer

from tadcore.errors import MISSING, ScenarioError

from .options import Changes, Source, read
from .terminal import say


def explore(
    scenario: Source = "paper-i1",
    changes: Changes = None,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port on this machine; 0 takes a free one.")] = 0,
    browser: Annotated[bool, typer.Option(help="Open the page in the browser.")] = True,
) -> None:
    """Open a page in the browser on which players and radii are dragged and the game is played at once.

    \b
      tadcore explore
      tadcore explore my.toml

    The page is served to this machine alone, until Ctrl-C. Needs the extra "explore".
    """  # noqa: D301
    if find_spec("bokeh") is None:
        raise ScenarioError("explore", MISSING, "run with Bokeh installed: pip install 'tadcore[explore]'")
    sc = read(scenario, changes)
    from tadcore.explorer import serve

    serve(sc, port=port, browse=browser, ready=lambda address: say(f"the explorer is at {address} until Ctrl-C"))
