"""The jumps of the controls at the changes of the network."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tadcore._shared.calls import public
from tadcore.game.externality import control_jumps
from tadcore.game.recorded import Recorded
from tadcore.game.sound import until_divergence
from tadcore.plotting.tools.axes import above, as_run, new_axes
from tadcore.plotting.tools.ground import ink, paper
from tadcore.plotting.tools.style import PAGE, edge_text, look

if TYPE_CHECKING:
    from matplotlib.axes import Axes


MAX_NAMED = 12
"""With more changes than this the edges are not named below the axis."""
_ROOM = 0.6  # inches that the edges of one change take; in narrower places they stand upright


@public
def externality(run: Recorded, *, ax: Axes | None = None) -> Axes:
    """Draw how far each player's control jumps at every change of the network.

    A filled marker is the jump of a player whose own edge changed; an open one is the jump of another player, which is
    the network externality (Remark networkexternality). Jumps of length zero are left out.

    Parameters
    ----------
    run : Run
        The run to draw.
    ax : Axes, optional
        Where to draw; new axes across two columns if not given.

    Returns
    -------
    Axes
        The axes drawn in.
    """
    as_run(run)
    run = until_divergence(run)
    found = control_jumps(run)
    ax = new_axes(ax, PAGE, 2.6)
    count = found.sizes["time"]
    place = np.arange(count, dtype=float)
    players = [str(p) for p in found["player"].values]
    width = 0.6 / max(len(players), 1)
    for i, player in enumerate(players):
        it = look(player)
        size = np.asarray(found["size"].sel(player=player).values, dtype=float)
        own = np.asarray(found["own"].sel(player=player).values, dtype=bool)
        at = place + (i - 0.5 * (len(players) - 1)) * width
        there = size > 1e-12 * max(float(found["size"].max()), 1e-300)
        ax.vlines(at[there], 0.0, size[there], color=it.colour, linestyle=it.dashes, linewidth=1.0)
        for filled in (True, False):
            shown = there & (own == filled)
            face = it.colour if filled else paper()
            ax.plot(
                at[shown],
                size[shown],
                linestyle="none",
                marker=it.marker,
                color=it.colour,
                markerfacecolor=face,
                markeredgewidth=0.9,
                zorder=2.6,
                clip_on=False,
            )
        ax.plot([], [], linestyle="none", marker=it.marker, color=it.colour, label=it.symbol)
    ax.plot([], [], linestyle="none", marker="o", color=ink(0.3), label="own edge")
    ax.plot([], [], linestyle="none", marker="o", color=ink(0.3), markerfacecolor=paper(), label="another's edge")
    ax.set_ylabel("jump of the control")
    ax.set_ylim(bottom=0.0)
    ax.set_xlim(-0.6, max(count - 0.4, 0.6))
    if count <= MAX_NAMED:
        times = found["time"].values.tolist()
        upright = ax.get_window_extent().width / ax.figure.dpi < _ROOM * count
        labels = [f"{t:.6g}\n{_named(run, t)}" for t in times]
        ax.set_xticks(place, labels, rotation=90 if upright else 0)
        ax.set_xlabel("time $t$ of the change, and its edges")
    else:
        ax.set_xlabel("changes of the network, in order")
    above(ax, ax.get_legend_handles_labels()[0], handletextpad=0.1)
    return ax


def _named(run: Recorded, time: float) -> str:
    change = next(c for c in run.network_changes if c.time == time)
    parts = [edge_text(p, [q]) for p, q in change.added] + [edge_text(p, [q], lost=True) for p, q in change.removed]
    return "\n".join(parts)
