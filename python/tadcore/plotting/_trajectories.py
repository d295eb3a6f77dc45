"""The players' paths, in the plane or in space."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, FancyArrowPatch
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from ._labels import Labels
from ._style import COLUMN, edge_text, look, new_axes, note, outcome_text, players

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tadcore.simulation import Run

Floats = NDArray[np.float64]

MAX_EDGE_LABELS = 12
"""A run with more network changes than this has only the first change of each edge labelled."""


@dataclass(frozen=True, slots=True)
class _Mark:
    """A place on an observer's path where some of its edges form or break."""

    observer: str
    text: str
    point: Floats


def trajectories(
    run: Run,
    ax: Axes | None = None,
    *,
    full: Run | None = None,
    edge_markers: bool = True,
    capture_discs: bool = True,
    title: bool = True,
) -> Axes:
    r"""Draw the paths of all players, in 3-D axes when the game is in space.

    A hollow marker is where a player starts, a filled one where it stands when the game ends.

    Parameters
    ----------
    run : Run
        The run to draw, solid.
    ax : Axes, optional
        Where to draw; new axes of a one-column figure if not given. Must be 3-D axes for a game in space.
    full : Run, optional
        A second run to lay under the first, dashed: as a rule the same game under full observation.
    edge_markers : bool
        Whether to mark, on the observer's path, each place where the network changes, with a label such as
        :math:`d_2\to a` for an edge that forms and a struck arrow for one that breaks. Past
        `MAX_EDGE_LABELS` marks only the first of each kind is labelled, and a note under the axes says so.
    capture_discs : bool
        Whether to draw the capture disc (sphere) of the player that ended the game, where it ended.
    title : bool
        Whether to write the outcome above the axes.

    Returns
    -------
    Axes
        The axes drawn in.
    """
    dim = int(run.scenario.dim)
    shown = [run] if full is None else [run, full]
    points = np.concatenate([_positions(r).reshape(-1, dim) for r in shown])
    low, high = points.min(axis=0), points.max(axis=0)
    pad = 0.09 * max(float((high - low).max()), 1e-9)
    low, high = low - pad, high + pad
    ax = _axes(ax, dim, low, high)
    labels = Labels(ax)
    if full is not None:
        _paths(ax, full, labels, dashed=True)
    _paths(ax, run, labels, dashed=False)
    if capture_discs:
        for r in shown:
            _disc(ax, r, dashed=r is full)
    _limits(ax, dim, low, high)
    if edge_markers:
        _edges(ax, run, labels)
    if full is not None:
        handles = [
            Line2D([], [], color="0.2", linestyle="-", label="limited observations"),
            Line2D([], [], color="0.2", linestyle=(0, (4, 2)), label="full observation"),
        ]
        ax.legend(
            handles=handles,
            loc="lower center",
            bbox_to_anchor=(0.5, 1.0),
            ncols=2,
            frameon=False,
            borderaxespad=0.2,
        )
    elif title:
        ax.set_title(outcome_text(run))
    return ax


def _positions(run: Run) -> Floats:
    return np.asarray(run.dataset["position"].transpose("time", "player", "axis").values, dtype=float)


def _axes(ax: Axes | None, dim: int, low: Floats, high: Floats) -> Axes:
    if ax is not None and (ax.name == "3d") != (dim == 3):
        raise ValueError(f"a game in {dim} dimensions needs {dim}-D axes, got axes of kind {ax.name!r}")
    if dim == 3:
        return new_axes(ax, COLUMN, 0.78 * COLUMN, projection="3d")
    ratio = float((high[1] - low[1]) / (high[0] - low[0]))
    return new_axes(ax, COLUMN, float(np.clip((COLUMN - 0.5) * ratio + 0.7, 2.3, 4.6)))


def _limits(ax: Axes, dim: int, low: Floats, high: Floats) -> None:
    ax.set(xlabel="$x$", ylabel="$y$")
    if dim == 3:
        ax.set(zlabel="$z$", xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
        ax.set_box_aspect(tuple(high - low), zoom=1.0)  # type: ignore[arg-type, call-arg]
        for side in (ax.xaxis, ax.yaxis, ax.zaxis):  # type: ignore[attr-defined]
            side.set_tick_params(pad=-1)
            side.labelpad = -3
            side.set_major_locator(MaxNLocator(5))
        return
    ax.update_datalim([(low[0], low[1]), (high[0], high[1])])
    ax.margins(0)
    shared = len(ax.get_shared_x_axes().get_siblings(ax)) > 1 and len(ax.get_shared_y_axes().get_siblings(ax)) > 1
    ax.set_aspect("equal", adjustable="box" if shared else "datalim")


def _paths(ax: Axes, run: Run, labels: Labels, *, dashed: bool) -> None:
    position = _positions(run)
    for p, player in enumerate(players(run)):
        path, it = position[:, p], look(player)
        ax.plot(
            *path.T,
            color=it.colour,
            linestyle=(0, (4, 2)) if dashed else "-",
            linewidth=1.0 if dashed else None,
            zorder=2.0 if dashed else 2.5,
        )
        labels.avoid_curve(path)
        end: dict[str, Any] = {"linestyle": "none", "marker": it.marker, "markeredgecolor": it.colour}
        size = {"*": 7.5, "X": 5.8}.get(it.marker, 4.6)
        ax.plot(
            *path[-1:].T,
            markerfacecolor=it.colour,
            markersize=size * (0.8 if dashed else 1),
            zorder=3.2,
            **end,
        )
        labels.avoid_spot(path[-1])
        if dashed:
            continue
        ax.plot(*path[:1].T, markerfacecolor="white", markersize=size, zorder=3.2, **end)
        labels.avoid_spot(path[0])
        labels.add(path[0], it.symbol, color=it.colour, zorder=4.6, leader_from=14.0)
        _heading(ax, path, it.colour)


def _heading(ax: Axes, path: Floats, colour: str) -> None:
    """Draw one arrow half way along a planar path, where the path is long enough to want one."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    if path.shape[1] != 2 or along[-1] < 1e-3 * max(float(np.ptp(path)), 1e-12) or len(path) < 3:
        return
    k = int(np.clip(np.searchsorted(along, 0.62 * along[-1]), 1, len(path) - 1))
    arrow = FancyArrowPatch(
        (path[k - 1, 0], path[k - 1, 1]),
        (path[k, 0], path[k, 1]),
        arrowstyle="-|>",
        mutation_scale=8,
        color=colour,
        linewidth=0,
        shrinkA=0,
        shrinkB=0,
        zorder=2.6,
    )
    arrow.set_in_layout(False)
    ax.add_patch(arrow)


def _disc(ax: Axes, run: Run, *, dashed: bool) -> None:
    """Draw the capture disc of whoever ended the game: the interceptor's, or the attacker's."""
    names, outcome = players(run), run.outcome
    if outcome.kind == "timeout":
        return
    winner = int(outcome.defender) if outcome.kind == "intercepted" and outcome.defender is not None else -1
    centre = _positions(run)[-1, winner]
    radius = float(run.scenario.capture_radii[winner])
    colour = look(names[winner]).colour
    if len(centre) == 3:
        u, v = np.mgrid[0 : 2 * np.pi : 19j, 0 : np.pi : 10j]
        ball = [np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)]
        ax.plot_wireframe(  # type: ignore[attr-defined]
            *(c + radius * b for c, b in zip(centre, ball, strict=True)),
            color=colour,
            linewidth=0.3,
            alpha=0.6,
        )
        return
    style = {"linestyle": (0, (3, 2))} if dashed else {}
    ax.add_patch(
        Circle(
            (centre[0], centre[1]),
            radius,
            facecolor=(*_rgb(colour), 0.15),
            edgecolor=colour,
            lw=0.8,
            zorder=2.2,
            **style,
        )
    )


def _rgb(colour: str) -> tuple[float, float, float]:
    from matplotlib.colors import to_rgb

    return to_rgb(colour)


def _marks(run: Run) -> list[_Mark]:
    times = np.asarray(run.dataset["time"].values, dtype=float)
    position, names = _positions(run), players(run)
    marks = []
    for time, added, removed in list(run.network_changes)[1:]:
        k = int(np.argmin(np.abs(times - time)))
        for edges, lost in ((added, False), (removed, True)):
            seen: dict[str, list[str]] = {}
            for observer, other in edges:
                seen.setdefault(str(observer), []).append(str(other))
            for observer, others in seen.items():
                point = position[k, names.index(observer)]
                marks.append(_Mark(observer, edge_text(observer, others, lost=lost), point))
    return marks


def _edges(ax: Axes, run: Run, labels: Labels) -> None:
    marks = _marks(run)
    labelled = marks
    if len(marks) > MAX_EDGE_LABELS:
        kinds = list({mark.text: mark for mark in reversed(marks)}.values())[::-1]
        labelled = kinds[:MAX_EDGE_LABELS]
        which = "each kind" if labelled == kinds else f"the first {len(labelled)} kinds"
        note(ax, f"{len(run.network_changes) - 1} network changes, {which} labelled once")
    keep = {id(mark) for mark in labelled}
    for mark in marks:
        named = id(mark) in keep
        it = look(mark.observer)
        ax.plot(
            *mark.point[:, None],
            linestyle="none",
            marker="D" if named else "|",
            markersize=3.6 if named else 4,
            markerfacecolor=it.colour,
            markeredgecolor="black" if named else it.colour,
            markeredgewidth=0.6,
            zorder=3.3 if named else 2.7,
        )
    for mark in labelled:
        labels.avoid_spot(mark.point, 3.0)
        labels.add(mark.point, mark.text, color="black", fontsize="small")
