"""Who sees whom, when: one bar per directed edge over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.collections import LineCollection
from numpy.typing import NDArray

from tadcore._shared.calls import public
from tadcore.game.course import stretches
from tadcore.game.network import Edge
from tadcore.game.recorded import Recorded
from tadcore.game.sound import until_divergence
from tadcore.plotting.tools.axes import as_run, new_axes, root_figure
from tadcore.plotting.tools.ground import ink, paper
from tadcore.plotting.tools.style import COLUMN, edge_text, look, note, time_label, world_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes


MAX_ROWS = 24
"""Where more edges than this are possible, `visibility` leaves out those that never form."""

_ROW = 9.0  # points that one row with a name needs


@public
def visibility(run: Recorded, *, ax: Axes | None = None, changes: bool = True) -> Axes:
    r"""Draw a raster of the network: a row per edge, a bar wherever the edge is there.

    Rows are grouped by observer, d1 on top; bars are in the observer's colour. The row :math:`d_2\to a` says when
    :math:`d_2` sees the attacker. Players who see everything by assumption have no rows. Bars are hollow where a player
    is told by others what it does not see itself, and its rows are grey while its sensor does not work.

    Parameters
    ----------
    run : Run
        The run to draw.
    ax : Axes, optional
        Where to draw; new axes of a one-column figure, as high as its rows need, if not given. In axes too low for a
        name per row only the observers are named.
    changes : bool
        Whether to mark the network changes, as long as there are no more of them than rows have room for.

    Returns
    -------
    Axes
        The axes drawn in.
    """
    as_run(run)
    run = until_divergence(run)
    rows = _rows(run)
    ax = new_axes(ax, COLUMN, max(0.75 + _ROW * max(len(rows), 3) / 72.0, 1.3))
    seen, told = _bars(run, run.adjacency & run.seen), _bars(run, run.adjacency & ~run.seen)
    for row, edge in enumerate(rows):
        colour = look(edge[0]).colour
        solid, hollow = ([(a, b - a) for a, b in bars.get(edge, [])] for bars in (seen, told))
        ax.broken_barh(solid, (row - 0.36, 0.72), color=colour, linewidth=0, zorder=2.0)
        if hollow:
            ax.broken_barh(hollow, (row - 0.24, 0.48), facecolor=paper(), edgecolor=colour, linewidth=0.8, zorder=1.9)
        ax.axhline(row, color=colour, linewidth=0.4, alpha=0.5, zorder=1.0)
    failed = _shade_failures(ax, run, rows)
    for row in range(1, len(rows)):
        if rows[row][0] != rows[row - 1][0]:
            ax.axhline(row - 0.5, color=ink(0.4), linewidth=0.5, zorder=1.1)
    end = float(run.outcome.time) or 1.0
    ax.set(xlabel=time_label(run), xlim=(0.0, end), ylim=(max(len(rows), 1) - 0.4, -0.6))
    _name(ax, rows)
    ax.tick_params(axis="y", length=0)
    times = [change.time for change in run.network_changes[1:]]
    if changes and len(times) <= MAX_ROWS:
        segments = [[(t, 0.0), (t, 1.0)] for t in times]
        lines = LineCollection(segments, transform=ax.get_xaxis_transform(), colors=ink(0.45), linewidths=0.6)
        lines.set(linestyle=(0, (4, 2.5)), zorder=2.4)
        ax.add_collection(lines, autolim=False)
    absent = len(run.scenario.constrained) * (run.scenario.n + 1) - len(rows)
    remarks = [f"{absent} edges never form and are left out"] if absent else []
    remarks += ["hollow: told by others"] if told else []
    remarks += ["grey: the sensor has failed"] if failed else []
    if words := "\n".join(filter(None, ["; ".join(remarks), world_text(run)])):
        note(ax, words)
    return ax


def _shade_failures(ax: Axes, run: Recorded, rows: list[Edge]) -> bool:
    """Shade the rows of an observer while its sensor does not work; whether there is anything to shade."""
    if run.course is None:
        return False
    down = stretches(~run.course.sensor_up, run.times)
    for (i,), spans in down.items():
        own = [row for row, (observer, _) in enumerate(rows) if observer == run.scenario.constrained[i]]
        if own:
            band = (min(own) - 0.5, len(own))
            ax.broken_barh([(a, b - a) for a, b in spans], band, color=ink(0.82), linewidth=0, zorder=0.5)
    return bool(down)


def bars_of(run: Recorded) -> dict[Edge, list[tuple[float, float]]]:
    """Return, for each edge that ever forms, the stretches of time over which it is there."""
    return _bars(run, run.adjacency)


def _bars(run: Recorded, edges: NDArray[np.bool_]) -> dict[Edge, list[tuple[float, float]]]:
    players, attacker = run.scenario.players, run.scenario.n + 1
    return {
        (players[i], players[attacker if i == j else j]): spans for (i, j), spans in stretches(edges, run.times).items()
    }


def _rows(run: Recorded) -> list[Edge]:
    """Return the edges to draw, by observer: every possible one where they are few, else those that ever form."""
    names = run.scenario.players
    possible = [(p, q) for p in run.scenario.constrained for q in names if q != p]
    if len(possible) <= MAX_ROWS:
        return possible
    ever = {edge for interval in run.intervals() for edge in interval.edges}
    return [edge for edge in possible if edge in ever]


def _name(ax: Axes, rows: list[Edge]) -> None:
    """Name every row where there is room for it, every observer otherwise."""
    height = 72.0 * ax.get_window_extent().height / root_figure(ax).dpi
    if height >= 0.8 * _ROW * len(rows):
        ax.set_yticks(range(len(rows)), [edge_text(p, [q]) for p, q in rows], fontsize="small")
        return
    observers = list(dict.fromkeys(p for p, _ in rows))
    middles = [float(np.mean([i for i, (p, _) in enumerate(rows) if p == observer])) for observer in observers]
    ax.set_yticks(middles, [look(observer).symbol for observer in observers])
