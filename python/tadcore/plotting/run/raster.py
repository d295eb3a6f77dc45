"""Who sees whom, when: one bar per directed edge over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.collections import LineCollection

from tadcore._shared.calls import public
from tadcore.game.network import Edge
from tadcore.game.recorded import Recorded
from tadcore.game.sound import until_divergence
from tadcore.plotting.tools.axes import as_run, new_axes, root_figure
from tadcore.plotting.tools.style import COLUMN, edge_text, look, note, time_label

if TYPE_CHECKING:
    from matplotlib.axes import Axes


MAX_ROWS = 24
"""Where more edges than this are possible, `visibility` leaves out those that never form."""

_ROW = 9.0  # points that one row with a name needs


@public
def visibility(run: Recorded, *, ax: Axes | None = None, changes: bool = True) -> Axes:
    r"""Draw a raster of the visibility network: a row per edge, a bar wherever the edge is there.

    Rows are grouped by observer, d1 on top; bars are in the observer's colour. The row :math:`d_2\to a` says when
    :math:`d_2` sees the attacker. Players who see everything by assumption have no rows.

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
    spans = bars_of(run)
    for row, edge in enumerate(rows):
        bars = spans.get(edge, [])
        colour = look(edge[0]).colour
        ax.broken_barh([(a, b - a) for a, b in bars], (row - 0.36, 0.72), color=colour, linewidth=0, zorder=2.0)
        ax.axhline(row, color=colour, linewidth=0.4, alpha=0.5, zorder=1.0)
    for row in range(1, len(rows)):
        if rows[row][0] != rows[row - 1][0]:
            ax.axhline(row - 0.5, color="0.4", linewidth=0.5, zorder=1.1)
    end = float(run.outcome.time) or 1.0
    ax.set(xlabel=time_label(run), xlim=(0.0, end), ylim=(max(len(rows), 1) - 0.4, -0.6))
    _name(ax, rows)
    ax.tick_params(axis="y", length=0)
    times = [change.time for change in run.network_changes[1:]]
    if changes and len(times) <= MAX_ROWS:
        segments = [[(t, 0.0), (t, 1.0)] for t in times]
        lines = LineCollection(segments, transform=ax.get_xaxis_transform(), colors="0.45", linewidths=0.6, zorder=2.4)
        lines.set_linestyle((0, (4, 2.5)))
        ax.add_collection(lines, autolim=False)
    absent = len(run.scenario.constrained) * (run.scenario.n + 1) - len(rows)
    if absent:
        note(ax, f"{absent} edges never form and are left out")
    return ax


def bars_of(run: Recorded) -> dict[Edge, list[tuple[float, float]]]:
    """Return, for each edge that ever forms, the stretches of time over which it is there."""
    players, attacker = run.scenario.players, run.scenario.n + 1
    in_force = run.adjacency[:-1].astype(np.int8)
    starts = np.diff(in_force, axis=0, prepend=0) > 0
    ends = np.diff(in_force, axis=0, append=0) < 0
    spans: dict[Edge, list[tuple[float, float]]] = {}
    for i, j in np.argwhere(starts.any(axis=0)).tolist():
        first, last = np.flatnonzero(starts[:, i, j]), np.flatnonzero(ends[:, i, j]) + 1
        edge = players[i], players[attacker if i == j else j]
        spans[edge] = list(zip(run.times[first].tolist(), run.times[last].tolist(), strict=True))
    return spans


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
