"""The figures of the page; they read from sources that the page fills."""

from __future__ import annotations

from typing import Any

import numpy as np
from bokeh.models import ColumnDataSource, PointDrawTool, Range1d, Span
from bokeh.plotting import figure
from bokeh.transform import factor_cmap, factor_mark

from tadcore.plotting.tools.style import look, symbol
from tadcore.scenario.model import Scenario

Sources = dict[str, ColumnDataSource]

_MARKERS = {"o": "circle", "s": "square", "^": "triangle", "D": "diamond", "v": "inverted_triangle", "P": "plus",
            "h": "hex", "*": "star", "X": "x"}  # fmt: skip
_ROOM = 0.35  # of the extent, kept free around the game: room to drag to


def frame(sources: Sources) -> tuple[float, float, float, float]:
    """A square around the paths with room to drag to: left, right, bottom, top."""
    paths: Any = sources["paths"].data
    every = np.concatenate([np.concatenate([np.asarray(part) for part in paths[axis]])[None] for axis in "xy"])
    low, high = every.min(axis=1), every.max(axis=1)
    half = (0.5 + _ROOM) * max(float((high - low).max()), 0.5)
    x, y = (low + high) / 2
    return float(x - half), float(x + half), float(y - half), float(y + half)


def arena(sources: Sources) -> Any:
    """The plane: paths, discs, starts to drag, players at the instant shown."""
    left, right, bottom, top = frame(sources)
    players = list(sources["paths"].data["player"])
    plot = figure(
        name="arena", frame_width=520, frame_height=520, tools="wheel_zoom,reset,save", active_scroll=None,
        x_range=Range1d(left, right), y_range=Range1d(bottom, top), x_axis_label="x", y_axis_label="y",
    )  # fmt: skip
    colour = factor_cmap("player", [look(p).colour for p in players], players)
    marker = factor_mark("player", [_MARKERS[look(p).marker] for p in players], players)
    plot.circle("x", "y", radius="r", source=sources["discs"], fill_color=colour, line_color=colour, fill_alpha=0.06,
                line_dash="dashed", line_alpha=0.8)  # fmt: skip
    plot.segment("x0", "y0", "x1", "y1", source=sources["sight"], color=colour, line_alpha=0.5, line_dash="dotted")
    plot.multi_line("x", "y", source=sources["paths"], color=colour, line_width=2)
    plot.circle("x", "y", radius="r", source=sources["capture"], fill_color=colour, fill_alpha=0.25, line_color=None)
    plot.scatter("x", "y", source=sources["now"], color=colour, marker=marker, size=11, line_width=2)
    starts = plot.scatter("x", "y", source=sources["starts"], marker=marker, size=15, fill_color="white",
                          line_color=colour, line_width=2.5)  # fmt: skip
    handles = plot.scatter("x", "y", source=sources["handles"], marker="diamond", size=13, color=colour,
                           line_color="white")  # fmt: skip
    plot.text("x", "y", text="name", source=sources["starts"], x_offset=11, y_offset=-7, text_color=colour)
    tool = PointDrawTool(renderers=[starts, handles], add=False, drag=True)
    plot.add_tools(tool)
    plot.toolbar.active_tap = None
    plot.toolbar.active_drag = tool
    return plot


def timeline(sources: Sources, sc: Scenario, now: Span) -> Any:
    """Who sees whom, when: edge × time."""
    rows = [edge_name(p, q) for p in sc.constrained for q in sc.players if q != p]
    observers = list(sc.constrained)
    plot = _history("network", now, height=70 + 13 * len(rows), y_range=rows[::-1])
    colour = factor_cmap("observer", [look(p).colour for p in observers], observers)
    plot.hbar(y="edge", left="left", right="right", height=0.7, source=sources["bars"], color=colour, line_color=None)
    plot.ygrid.grid_line_color = None
    return plot


def theta(sources: Sources, now: Span) -> Any:
    """The synthesis objective over time."""
    plot = _history("Θ", now, height=150)
    plot.line("t", "theta", source=sources["theta"], color="black", line_width=2)
    plot.y_range.start = 0
    return plot


def controls(sources: Sources, sc: Scenario, now: Span) -> Any:
    """The speed of every player over time, or one component of its control."""
    plot = _history("control u", now, height=190)
    for player in sc.players:
        plot.line("t", player, source=sources["controls"], color=look(player).colour, line_width=2)
    plot.xaxis.axis_label = "time t"
    return plot


def instant() -> Span:
    """A mark at the instant shown, for one history."""
    return Span(location=0.0, dimension="height", line_color="black", line_dash="dashed")


def _history(title: str, now: Span, **options: Any) -> Any:
    plot = figure(width=430, title=title, tools="", toolbar_location=None, **options)
    plot.x_range.update(start=0, range_padding=0)
    plot.add_layout(now)
    return plot


def edge_name(observer: str, seen: str) -> str:
    """Return the label of an edge in the timeline."""
    return f"{plain(observer)} → {plain(seen)}"


def plain(player: str) -> str:
    """Return the symbol of a player without mathematics: d1, τ, a."""
    return symbol(player).replace(r"\tau", "τ").translate(str.maketrans("", "", "_{}"))
