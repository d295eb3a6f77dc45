"""The players' paths, in the plane or in space."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.ticker import MaxNLocator

from tadcore._shared.arrays import Floats
from tadcore._shared.calls import public
from tadcore.game.recorded import Recorded
from tadcore.game.sound import until_divergence
from tadcore.plotting.tools.axes import as_axes, as_run, new_axes
from tadcore.plotting.tools.ground import ink
from tadcore.plotting.tools.inset import crowd, magnify
from tadcore.plotting.tools.labels import Labels
from tadcore.plotting.tools.style import COLUMN, edge_text, look, note, outcome_text, world_text

from .paths import count_passes, disc, drops, name_runs, passes, paths

if TYPE_CHECKING:
    from matplotlib.axes import Axes


MAX_EDGE_LABELS = 12
"""A run with more network changes than this has only the first change of each edge labelled."""


@dataclass(frozen=True, slots=True)
class _Mark:
    """A place on an observer's path where some of its edges form or break."""

    observer: str
    text: str
    point: Floats


@public
def trajectories(
    run: Recorded,
    ax: Axes | None = None,
    *,
    full: Recorded | None = None,
    names: tuple[str, str] = ("limited observations", "full observation"),
    edge_markers: bool = True,
    capture_discs: bool = True,
    title: bool = True,
    zoom: bool = True,
) -> Axes:
    r"""Draw the paths of all players, in 3-D axes when the game is in space.

    A hollow marker is where a player starts, a filled one where it stands when the game ends. A crossed circle is where
    the attacker was within a capture radius between two instants, which ends nothing. In space, paths have a shadow on
    the floor of the box, and dotted lines lead down to it from where they start and end.

    Parameters
    ----------
    run : Run
        The run to draw, solid.
    ax : Axes, optional
        Where to draw; new axes of a one-column figure if not given. Must be 3-D axes for a game in space.
    full : Recorded, optional
        A second run to lay under the first, dashed: as a rule the same game under full observation.
    names : (str, str)
        What the legend calls ``run`` and ``full`` where both are drawn.
    edge_markers : bool
        Whether to mark, on the observer's path, each place where the network changes, with a label such as
        :math:`d_2\to a` for an edge that forms and a struck arrow for one that breaks. Past
        `MAX_EDGE_LABELS` marks only the first of each kind is labelled, and a note under the axes says so.
    capture_discs : bool
        Whether to draw the capture disc (sphere) of the player that ended the game, where it ended.
    title : bool
        Whether to write the outcome above the axes.
    zoom : bool
        Whether to magnify the end in a free part of the axes where markers would otherwise lie on top of one another.
        Games in the plane only.

    Returns
    -------
    Axes
        The axes drawn in.
    """
    as_run(run)
    run, full = until_divergence(run), None if full is None else until_divergence(full)
    dim = int(run.scenario.dim)
    shown = [run] if full is None else [run, full]
    points = np.concatenate([r.position.reshape(-1, dim) for r in shown])
    low, high = points.min(axis=0), points.max(axis=0)
    pad = 0.09 * max(float((high - low).max()), 1e-9)
    low, high = low - pad, high + pad
    ax = _axes(ax, dim, low, high)
    marks = _marks(run) if edge_markers else []
    spots = np.array([mark.point for mark in marks]).reshape(-1, dim)

    def draw(where: Axes, *, marked: bool) -> None:
        if full is not None:
            paths(where, full, dashed=True)
        paths(where, run, dashed=False, marks=spots if marked else None)
        if capture_discs:
            for r in shown:
                disc(where, r, dashed=r is full)
        passes(where, run)

    draw(ax, marked=True)
    if dim == 3:
        drops(ax, run, float(low[2]))
    _limits(ax, dim, low, high)
    ends = np.concatenate([r.position[-1] for r in shown])
    crowded = crowd(ax, ends, low, high) if zoom and dim == 2 else None
    inset = None
    if crowded is not None:
        occupied = np.concatenate([points, spots])
        pad = float(run.scenario.capture_radii.max())
        inset = magnify(ax, crowded, occupied, low, high, pad, lambda where: draw(where, marked=False))
    _labels(ax, shown, marks, inset)
    if inset is not None:
        _ends(inset, run)
    if full is not None:
        name_runs(ax, names)
    elif title:
        ax.set_title(outcome_text(run))
    lost = [r for r in shown if r.diverged is not None]
    said = [outcome_text(lost[0])] if lost and (full is not None or not title) else []
    said += [count_passes(run)] if run.passes else []
    if said := [*said, *filter(None, [world_text(run)])]:
        note(ax, "; ".join(said))
    return ax


def _axes(ax: Axes | None, dim: int, low: Floats, high: Floats) -> Axes:
    if ax is not None and (as_axes(ax).name == "3d") != (dim == 3):
        raise ValueError(f"a game in {dim} dimensions needs {dim}-D axes, got axes of kind {ax.name!r}")
    if dim == 3:
        return new_axes(ax, COLUMN, 0.78 * COLUMN, projection="3d")
    ratio = float((high[1] - low[1]) / (high[0] - low[0]))
    return new_axes(ax, COLUMN, float(np.clip((COLUMN - 0.5) * ratio + 0.7, 2.3, 4.6)))


def _limits(ax: Axes, dim: int, low: Floats, high: Floats) -> None:
    ax.set(xlabel="$x$", ylabel="$y$")
    if dim == 3:
        ax.set(zlabel="$z$", xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
        ax.set_box_aspect(tuple(high - low), zoom=1.08)  # type: ignore[arg-type, call-arg]
        for side in (ax.xaxis, ax.yaxis, ax.zaxis):  # type: ignore[attr-defined]
            side.set_tick_params(pad=-1)
            side.labelpad = -3
            side.set_major_locator(MaxNLocator(5))
        return
    ax.update_datalim([(low[0], low[1]), (high[0], high[1])])
    ax.margins(0)
    shared = len(ax.get_shared_x_axes().get_siblings(ax)) > 1 and len(ax.get_shared_y_axes().get_siblings(ax)) > 1
    ax.set_aspect("equal", adjustable="box" if shared else "datalim")


def _marks(run: Recorded) -> list[_Mark]:
    names = run.scenario.players
    marks = []
    for time, added, removed in run.network_changes[1:]:
        k = int(np.argmin(np.abs(run.times - time)))
        for edges, lost in ((added, False), (removed, True)):
            seen: dict[str, list[str]] = {}
            for observer, other in edges:
                seen.setdefault(observer, []).append(other)
            for observer, others in seen.items():
                point = run.position[k, names.index(observer)]
                marks.append(_Mark(observer, edge_text(observer, others, lost=lost), point))
    return marks


def _labels(ax: Axes, shown: list[Recorded], marks: list[_Mark], inset: Axes | None) -> None:
    """Name the players at their starts and the edges at their marks, clear of everything drawn."""
    labels = Labels(ax)
    if inset is not None:  # the frame around what it magnifies
        (left, right), (bottom, top) = inset.get_xlim(), inset.get_ylim()
        labels.avoid_curve([(left, bottom), (right, bottom), (right, top), (left, top), (left, bottom)])
    for run in reversed(shown):
        position = run.position
        for p in range(position.shape[1]):
            labels.avoid_curve(position[:, p])
            labels.avoid_spot(position[-1, p])
    for point, player in zip(shown[0].position[0], shown[0].scenario.players, strict=True):
        it = look(player)
        labels.avoid_spot(point)
        labels.add(point, it.symbol, color=it.colour, zorder=4.6, leader_from=14.0)
    _edges(ax, shown[0], marks, labels)


def _ends(inset: Axes, run: Recorded) -> None:
    """Name the players that are seen to end in the inset."""
    labels = Labels(inset)
    low, high = np.array([inset.get_xlim(), inset.get_ylim()]).T
    position = run.position
    for p, player in enumerate(run.scenario.players):
        labels.avoid_curve(position[((position[:, p] > low) & (position[:, p] < high)).all(axis=1), p][:, :])
        if ((position[-1, p] > low) & (position[-1, p] < high)).all():
            it = look(player)
            labels.avoid_spot(position[-1, p])
            labels.add(position[-1, p], it.symbol, color=it.colour, fontsize="small", leader_from=8.0)


def _edges(ax: Axes, run: Recorded, marks: list[_Mark], labels: Labels) -> None:
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
            markeredgecolor=ink() if named else it.colour,
            markeredgewidth=0.6,
            zorder=3.3 if named else 2.7,
        )
    for mark in labelled:
        labels.avoid_spot(mark.point, 3.0)
        labels.add(mark.point, mark.text, color=ink(), fontsize="small")
