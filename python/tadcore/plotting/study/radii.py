"""One outcome against the radii of several players."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tadcore._shared.calls import public
from tadcore.plotting.tools.axes import new_axes
from tadcore.plotting.tools.ends import label_ends
from tadcore.plotting.tools.ground import paper
from tadcore.plotting.tools.outcomes import listed, outcome_look
from tadcore.plotting.tools.style import COLUMN, look
from tadcore.statistics.radii import RadiusCurves

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@public
def radius_curves(curves: RadiusCurves, ax: Axes | None = None, *, outcome: str = "intercepted") -> Axes:
    """Draw the probability of one outcome against the radius of each player.

    The bands hold at all radii of all players at once; a tick on a curve marks the player's own radius in the scenario,
    or the reference that was given.

    Parameters
    ----------
    curves : RadiusCurves
        What to draw.
    ax : Axes, optional
        Where to draw; new axes of a one-column figure if not given.
    outcome : str
        ``"timeout"``, ``"captured"``, ``"intercepted"``, or ``"d1"`` … ``"dn"``.

    Returns
    -------
    Axes
        The axes drawn in.

    Raises
    ------
    ValueError
        No such outcome, or no finite radius to draw it at.
    """
    first = curves.curves[0]
    listed("outcome", outcome, first.names)
    finite = np.isfinite(first.radii)
    if not finite.any():
        raise ValueError("no finite radius to draw")
    ax = new_axes(ax, COLUMN, 2.4)
    at, ends = first.radii[finite], []
    for curve in curves:
        it, i = look(curve.player), curve.names.index(outcome)
        share = curve.estimate[i][finite]
        ax.fill_between(
            at, curve.band_low[i][finite], curve.band_high[i][finite], color=it.colour, alpha=0.15, linewidth=0
        )
        ax.plot(
            at, share, color=it.colour, linestyle=it.dashes, marker=it.marker, markersize=3.2, markerfacecolor=paper(),
            markeredgewidth=0.8, markevery=max(len(at) // 12, 1),
        )  # fmt: skip
        if at[0] <= curve.reference <= at[-1]:
            ax.plot(
                curve.reference, np.interp(curve.reference, at, share), marker="|", markersize=9, color=it.colour,
                markeredgewidth=1.2,
            )  # fmt: skip
        ends.append((float(share[-1]), it.symbol, it.colour))
    letter = r"\zeta" if first.radius == "visibility" else r"\sigma"
    ax.set(
        xlabel=f"${letter}$ of one player" + (", or of all defenders" if "d*" in curves.players else ""),
        ylabel=f"P({outcome_look(outcome).label})",
    )
    label_ends(ax, ends)
    return ax
