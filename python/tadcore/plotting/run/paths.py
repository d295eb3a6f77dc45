"""Paths, the markers at their two ends and the disc that ended the game: what is drawn, and drawn again magnified."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, FancyArrowPatch

from tadcore._shared.arrays import Floats
from tadcore.game.passes import Pass
from tadcore.game.recorded import Recorded
from tadcore.plotting.tools.axes import above
from tadcore.plotting.tools.ground import ink, paper
from tadcore.plotting.tools.style import look

if TYPE_CHECKING:
    from matplotlib.axes import Axes


LAID_UNDER: Any = (0, (4, 2))
"""Dashes of a run laid under another."""
PASSED: Any = {"linestyle": "none", "marker": "$\u2295$", "markersize": 6.5, "markeredgewidth": 0.3, "zorder": 3.6}
"""How a pass within a capture radius is marked: a crossed circle."""
_AT_START = 0.015  # of the diagonal; a mark nearer than this would hide the marker of the start
_SIZES = {"*": 7.5, "X": 5.8}


def paths(ax: Axes, run: Recorded, *, dashed: bool, marks: Floats | None = None) -> None:
    """Draw every path: solid with a hollow marker where it starts and a filled one where it ends, or dashed and pale.

    ``marks`` are points that will be marked on top; a start under one gets a marker large enough to show around it.
    """
    position = run.position
    corners = position.reshape(-1, position.shape[-1])
    near = _AT_START * float(np.linalg.norm(np.ptp(corners, axis=0)))
    for p, player in enumerate(run.scenario.players):
        path, it = position[:, p], look(player)
        ax.plot(
            *path.T,
            color=it.colour,
            linestyle=LAID_UNDER if dashed else "-",
            linewidth=1.0 if dashed else None,
            zorder=2.0 if dashed else 2.5,
        )
        size = _SIZES.get(it.marker, 4.6)
        common: dict[str, Any] = {"linestyle": "none", "marker": it.marker}
        if dashed:
            pale = tuple(0.4 * c + 0.6 for c in to_rgb(it.colour))
            rim: dict[str, Any] = {"markeredgecolor": it.colour, "markeredgewidth": 0.6}
            ax.plot(*path[-1:].T, markerfacecolor=pale, markersize=0.85 * size, zorder=3.1, **common, **rim)
            continue
        # a white rim keeps markers apart where several paths end together
        rim = {"markeredgecolor": paper(), "markeredgewidth": 0.5}
        ax.plot(*path[-1:].T, markerfacecolor=it.colour, markersize=size + 1.4, zorder=3.2, **common, **rim)
        marked = marks is not None and len(marks) > 0 and bool((np.linalg.norm(marks - path[0], axis=1) < near).any())
        ax.plot(
            *path[:1].T,
            markerfacecolor=paper(),
            markeredgecolor=it.colour,
            markersize=size * (1.9 if marked else 1.0),
            zorder=3.2,
            **common,
        )
        _heading(ax, path, it.colour)


def drops(ax: Axes, run: Recorded, floor: float) -> None:
    """In space, the shadow of every path on the floor, and a line down from where it starts and from where it ends."""
    for p, player in enumerate(run.scenario.players):
        path, colour = run.position[:, p], look(player).colour
        shadow = path.copy()
        shadow[:, 2] = floor
        ax.plot(*shadow.T, color=colour, linewidth=0.7, alpha=0.35, zorder=1.0)
        for k in (0, -1):
            ax.plot(
                *np.array([path[k], shadow[k]]).T, color=colour, linewidth=0.5, linestyle=":", alpha=0.7, zorder=1.0
            )


def name_runs(ax: Axes, names: tuple[str, str]) -> None:
    """Say above the axes which run is solid and which is dashed, below one another where the names are long."""
    handles = [
        Line2D([], [], color=ink(0.2), linestyle="-", label=names[0]),
        Line2D([], [], color=ink(0.2), linestyle=LAID_UNDER, label=names[1]),
    ]
    above(ax, handles, fontsize="small", columnspacing=1.0, handlelength=1.8)


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


def passes(ax: Axes, run: Recorded) -> None:
    """Mark where the attacker was closest, each time it was within a capture radius between two instants only."""
    for each in run.passes:
        k = min(int(np.searchsorted(run.times, each.start)), len(run.times) - 2)
        share = (each.closest_time - each.start) / (each.end - each.start)
        whose = run.position[k : k + 2, -1]
        point = whose[0] + share * (whose[1] - whose[0])
        ax.plot(*point[:, None], color=colour_of(run, each), **PASSED)


def colour_of(run: Recorded, passed: Pass) -> str:
    """The colour of whose capture radius was passed."""
    return look("attacker" if passed.defender is None else run.scenario.players[passed.defender]).colour


def count_passes(run: Recorded) -> str:
    """The passes in words, for a note; empty where there are none."""
    many = len(run.passes)
    times = "once" if many == 1 else f"{many} times"
    return rf"$\oplus$ within $\sigma$ between two instants, {times}" if many else ""


def disc(ax: Axes, run: Recorded, *, dashed: bool) -> None:
    """Draw the capture disc of whoever ended the game: the interceptor's, or the attacker's."""
    names, outcome = run.scenario.players, run.outcome
    if outcome.kind == "timeout":
        return
    winner = int(outcome.defender) if outcome.kind == "intercepted" and outcome.defender is not None else -1
    centre = run.position[-1, winner]
    radius = float(run.scenario.capture_radii[winner])
    colour = look(names[winner]).colour
    if len(centre) == 3:
        u, v = np.mgrid[0 : 2 * np.pi : 37j, 0 : np.pi : 19j]
        ball = [np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)]
        ax.plot_surface(  # type: ignore[attr-defined]
            *(c + radius * b for c, b in zip(centre, ball, strict=True)), color=colour, linewidth=0.0, alpha=0.3
        )
        return
    style = {"linestyle": (0, (3, 2))} if dashed else {}
    ax.add_patch(
        Circle(
            (centre[0], centre[1]),
            radius,
            facecolor=(*to_rgb(colour), 0.15),
            edgecolor=colour,
            lw=0.8,
            zorder=2.2,
            **style,
        )
    )
