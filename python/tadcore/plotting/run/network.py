"""The visibility network, one small panel per interval."""

from __future__ import annotations

from collections.abc import Sequence, Set
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.patches import FancyArrowPatch
from numpy.typing import NDArray

from tadcore._shared.arrays import Floats, as_index
from tadcore._shared.calls import public
from tadcore.game.network import Edge, edges_of
from tadcore.game.recorded import Recorded
from tadcore.game.sound import until_divergence
from tadcore.plotting.tools.axes import as_panels, as_run, new_panels
from tadcore.plotting.tools.ground import ink, paper
from tadcore.plotting.tools.style import look, note, outcome_text, world_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes


_NARROW = 1.6  # inches; titles of narrower panels are set small, so that neighbours do not touch
_SMALL = 7.5  # points

_OLD: dict[str, Any] = {"linewidth": 0.9, "linestyle": "-", "mutation_scale": 7, "zorder": 2.0}
_NEW: dict[str, Any] = {"linewidth": 1.9, "linestyle": "-", "mutation_scale": 10, "zorder": 2.4}
_TOLD: dict[str, Any] = {"linestyle": (0, (4.0, 1.6))}
_LOST: dict[str, Any] = {"linewidth": 0.9, "linestyle": ":", "mutation_scale": 7, "zorder": 1.8}


@public
def network(
    run: Recorded, axes: Axes | NDArray[Any] | None = None, *, max_panels: int = 12, columns: int = 3
) -> Axes | NDArray[Any]:
    r"""Draw the directed visibility graph, a panel per interval on which it does not change.

    An arrow from :math:`d_2` to :math:`a` says that :math:`d_2` sees the attacker. Edges that the change at the start
    of the interval brought are thick and black, those that it took away are dotted, the others grey. An edge is dashed
    where the player does not see the other itself at the start of the interval, and is told by others; a player whose
    sensor does not work then is grey. Players stand on a circle, the same in all panels: attacker and target on
    top, defenders in order below. Players who see everything by assumption send no arrows.

    Parameters
    ----------
    run : Run
        The run to draw.
    axes : Axes or array of Axes, optional
        Where to draw; a new figure if not given. Axes left over are switched off.
    max_panels : int
        At most so many panels; a note says how many were left out.
    columns : int
        Panels in a row of a new figure.

    Returns
    -------
    Axes or array of Axes
        ``axes`` as given, or the array of the new ones.
    """
    as_run(run)
    run = until_divergence(run)
    changes = run.network_changes
    if axes is None:
        count = max(min(len(changes), as_index("max_panels", max_panels, 1000, least=1)), 1)
        axes = new_panels(count, columns, page_from=4, row=0.22, rest=0.0, square=True)
    panels = as_panels(axes)
    shown = min(len(changes), max_panels, len(panels))
    edges: set[Edge] = set()
    for k in range(shown):
        time, added, removed = changes[k]
        new, lost = set(added), set(removed)
        edges = (edges | new) - lost
        last = k + 1 == len(changes)
        until = run.outcome.time if last else changes[k + 1].time
        told, failed = aside(run, time)
        draw_graph(panels[k], run.scenario.players, edges, new if k else set(), lost, told=told, failed=failed)
        title = panels[k].set_title(f"$t\\in[{time:.6g},\\,{until:.6g}{']' if last else ')'}$")
        if panels[k].get_window_extent().width < _NARROW * panels[k].figure.dpi:
            title.set_fontsize(min(title.get_fontsize(), _SMALL))
    for panel in panels[shown:]:
        panel.set_axis_off()
    if not changes:
        panels[0].text(0.5, 0.5, "over at $t=0$", transform=panels[0].transAxes, ha="center", va="center")
    remarks = [f"and {len(changes) - shown} more"] if shown and shown < len(changes) else []
    if run.diverged is not None:
        remarks.append(outcome_text(run))
    remarks += filter(None, [world_text(run)])
    if remarks and panels:
        note(panels[max(shown, 1) - 1], ", ".join(remarks))
    return axes


def aside(run: Recorded, time: float) -> tuple[set[Edge], set[str]]:
    """Return the edges that are told and not seen at an instant, and the players whose sensors do not work then."""
    k = min(int(np.searchsorted(run.times, time)), len(run.times) - 1)
    told = set(edges_of(run.adjacency[k] & ~run.seen[k], run.scenario.players))
    if run.course is None:
        return told, set()
    return told, {run.scenario.constrained[i] for i in np.flatnonzero(~run.course.sensor_up[k])}


def _places(names: Sequence[str]) -> dict[str, Floats]:
    """Return where each player stands on the unit circle, clockwise: attacker, target, dn … d1."""
    around = ["attacker", "target", *reversed(names[:-2])]
    half = np.pi / len(around)
    angle = np.pi / 2 + half - 2 * half * np.arange(len(around))
    return {p: np.array([np.cos(a), np.sin(a)]) for p, a in zip(around, angle, strict=True)}


def draw_graph(
    ax: Axes,
    names: Sequence[str],
    edges: set[Edge],
    new: set[Edge],
    lost: set[Edge],
    *,
    told: Set[Edge] = frozenset(),
    failed: Set[str] = frozenset(),
) -> None:
    """Draw one graph: ``new`` edges thick, ``lost`` ones dotted, ``told`` ones dashed; ``failed`` players grey."""
    at = _places(names)
    node = min(0.2, 0.8 * np.sin(np.pi / len(names)))
    ax.set(xlim=(-1.32, 1.32), ylim=(-1.32, 1.32), xticks=[], yticks=[])
    ax.set_aspect("equal", adjustable="box")
    for spine in ax.spines.values():
        spine.set(color=ink(0.8), linewidth=0.5)
    for edge in sorted(edges | lost):
        kind, grey = (_LOST, 0.45) if edge in lost else (_NEW, 0.0) if edge in new else (_OLD, 0.62)
        kind = {"color": ink(grey)} | kind | (_TOLD if edge in told - lost else {})
        twin = (edge[1], edge[0]) in edges | lost
        _arrow(ax, at[edge[0]], at[edge[1]], node, bend=0.16 if twin else 0.0, kind=kind)
    for player, place in at.items():
        it = look(player)
        ax.text(
            place[0],
            place[1],
            it.symbol,
            ha="center",
            va="center",
            fontsize="small",
            zorder=3.1,
            bbox={"boxstyle": "circle,pad=0.22", "edgecolor": it.colour, "linewidth": 1.1}
            | ({"facecolor": ink(0.7), "linestyle": ":"} if player in failed else {"facecolor": paper()}),
        )


def _arrow(ax: Axes, start: Floats, end: Floats, node: float, *, bend: float, kind: dict[str, Any]) -> None:
    """Draw one edge, from the rim of a node to the rim of another, bent when its twin runs the other way."""
    run = end - start
    length = float(np.hypot(*run))
    turn = np.arctan(2 * bend)
    unit = run / length

    def rotated(v: Floats, angle: float) -> Floats:
        c, s = np.cos(angle), np.sin(angle)
        return np.array([c * v[0] - s * v[1], s * v[0] + c * v[1]])

    a = start + node * rotated(unit, -turn)
    b = end - (node + 0.03) * rotated(unit, turn)
    arrow = FancyArrowPatch(
        (a[0], a[1]), (b[0], b[1]), arrowstyle="-|>", connectionstyle=f"arc3,rad={bend}", shrinkA=0, shrinkB=0, **kind
    )
    ax.add_patch(arrow)
