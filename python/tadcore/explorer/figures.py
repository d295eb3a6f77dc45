"""The figures of the page; they read from sources that the page fills."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from bokeh.models import ColumnDataSource, PointDrawTool, Range1d, Span
from bokeh.plotting import figure
from bokeh.transform import factor_cmap, factor_mark

from tadcore.plotting.tools.style import look, symbol
from tadcore.scenario.model import Scenario

from .model import Explorer

Sources = dict[str, ColumnDataSource]

_MARKERS = {"o": "circle", "s": "square", "^": "triangle", "D": "diamond", "v": "inverted_triangle", "P": "plus",
            "h": "hex", "*": "star", "X": "x"}  # fmt: skip
PLANE, HISTORY = 580, 430
"""The largest widths of the plane and of a history, in pixels."""
_TALL = 420  # pixels of the network, before its rows get lower
_IN_A_ROW = 6  # names in the legend of the controls
_LEAST = 1e-12  # that the axis of Θ ends at
_ROOM = 0.35  # of the extent, kept free around the game: room to drag to


def frame(explorer: Explorer) -> tuple[float, float, float, float]:
    """A square around the paths with room to drag to: left, right, bottom, top."""
    every = explorer.flat(explorer.run.position).reshape(-1, 2)
    low, high = every.min(axis=0), every.max(axis=0)
    half = (0.5 + _ROOM) * max(float((high - low).max()), 0.5)
    x, y = (low + high) / 2
    return float(x - half), float(x + half), float(y - half), float(y + half)


def arena(sources: Sources, across: Range1d, up: Range1d, maps: Iterable[ColumnDataSource]) -> Any:
    """The plane: maps behind everything, paths, discs, starts to drag, players at the instant shown."""
    players = list(sources["paths"].data["player"])
    plot = figure(
        name="arena", tools="wheel_zoom,reset,save", active_scroll=None, x_range=across, y_range=up,
        x_axis_label="x", y_axis_label="y", aspect_ratio=1, sizing_mode="scale_width", max_width=PLANE,
    )  # fmt: skip
    for picture in maps:
        plot.image_rgba("image", "x", "y", "dw", "dh", source=picture, level="image")
    colour = factor_cmap("player", [look(p).colour for p in players], players)
    marker = factor_mark("player", [_MARKERS[look(p).marker] for p in players], players)
    plot.circle("x", "y", radius="r", source=sources["discs"], fill_color=colour, line_color=colour, fill_alpha=0.06,
                line_dash="dashed", line_alpha=0.8)  # fmt: skip
    plot.segment("x0", "y0", "x1", "y1", source=sources["sight"], color=colour, line_alpha=0.5, line_dash="dotted")
    plot.multi_line("x", "y", source=sources["paths"], color="white", line_width=5, line_alpha=0.7)  # over a map
    plot.multi_line("x", "y", source=sources["paths"], color=colour, line_width=2)
    plot.circle("x", "y", radius="r", source=sources["capture"], fill_color=colour, fill_alpha=0.25, line_color=None)
    plot.scatter("x", "y", source=sources["now"], color=colour, marker=marker, size=11, line_width=2)
    plot.scatter("x", "y", source=sources["chosen"], marker="circle", size=26, fill_color=None, line_color="black",
                 line_width=1.5)  # fmt: skip
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
    row = max(7, min(13, _TALL // len(rows)))  # pixels
    plot = _history("network", now, height=70 + row * len(rows), y_range=rows[::-1])
    plot.yaxis.major_label_text_font_size = f"{min(row, 11)}px"
    colour = factor_cmap("observer", [look(p).colour for p in observers], observers)
    plot.hbar(y="edge", left="left", right="right", height=0.7, source=sources["bars"], color=colour, line_color=None)
    plot.ygrid.grid_line_color = None
    return plot


def theta(sources: Sources, now: Span) -> Any:
    """The synthesis objective over time."""
    plot = _history("Θ", now, height=150)
    plot.line("t", "theta", source=sources["theta"], color="black", line_width=2)
    plot.scatter([0.0], [_LEAST], alpha=0.0)  # in range, so that zero up to rounding is drawn as zero
    plot.y_range.start = 0
    return plot


def controls(sources: Sources, sc: Scenario, now: Span) -> Any:
    """The speed of every player over time, or one component of its control; a click on its name hides a player."""
    plot = _history("control u", now, height=190 + 24 * -(-len(sc.players) // _IN_A_ROW))
    for player in sc.players:
        it = look(player)
        dashes = [] if it.dashes == "-" else [max(1, round(2 * part)) for part in it.dashes[1]]
        plot.line("t", player, source=sources["controls"], color=it.colour, line_width=2, line_dash=dashes,
                  legend_label=plain(player))  # fmt: skip
    plot.xaxis.axis_label = "time t"
    legend = plot.legend[0]
    legend.update(orientation="horizontal", ncols=_IN_A_ROW, click_policy="hide", border_line_color=None, margin=0)
    plot.add_layout(legend, "above")
    return plot


def instant() -> Span:
    """A mark at the instant shown, for one history."""
    return Span(location=0.0, dimension="height", line_color="black", line_dash="dashed")


def _history(title: str, now: Span, **options: Any) -> Any:
    plot = figure(
        title=title, tools="", toolbar_location=None, sizing_mode="stretch_width", max_width=HISTORY, **options
    )
    plot.x_range.update(start=0, range_padding=0)
    plot.add_layout(now)
    return plot


def edge_name(observer: str, seen: str) -> str:
    """Return the label of an edge in the timeline."""
    return f"{plain(observer)} → {plain(seen)}"


def plain(player: str) -> str:
    """Return the symbol of a player without mathematics: d1, τ, a."""
    return symbol(player).replace(r"\tau", "τ").translate(str.maketrans("", "", "_{}"))
