"""The feedback gains over time, one panel per player with limited sight."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from tadcore._shared.calls import public
from tadcore.game.recorded import Recorded
from tadcore.game.sound import until_divergence
from tadcore.plotting.tools.axes import above, as_panels, as_run, new_panels
from tadcore.plotting.tools.ground import ink
from tadcore.plotting.tools.style import look, symbol, time_label

from .series import MAX_VERTICALS, mark_changes, span

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@public
def gains(
    run: Recorded, axes: Axes | NDArray[Any] | None = None, *, columns: int = 1, changes: bool = True
) -> Axes | NDArray[Any]:
    r"""Draw the rows :math:`g_i` of the feedback :math:`u_i = g_i z`, a panel per player with limited sight.

    The curve in the colour and dashes of player :math:`j` is the weight that player :math:`i` gives to
    :math:`z_j = X_j - X_a`; it jumps where the network changes. Of gains that turn, :math:`a + ib`, it is :math:`a`,
    and a thinner, paler curve is :math:`b`, the weight of :math:`Jz_j`.

    Parameters
    ----------
    run : Run
        The run to draw.
    axes : Axes or array of Axes, optional
        Where to draw, in the order of ``run.scenario.constrained``; a new figure if not given. Axes left over are
        switched off, and players for whom there is none are left out.
    columns : int
        Panels in a row of a new figure.
    changes : bool
        Whether to mark the network changes.

    Returns
    -------
    Axes or array of Axes
        ``axes`` as given, or the array of the new ones.
    """
    as_run(run)
    run = until_divergence(run)
    observers = run.scenario.constrained
    if axes is None:
        axes = new_panels(len(observers), columns, page_from=2, row=1.15, rest=0.6, sharex=True)
    panels = as_panels(axes)
    entries = run.scenario.players[:-1]
    thin = len(run.network_changes) > MAX_VERTICALS
    for i, (ax, observer) in enumerate(zip(panels, observers, strict=False)):
        for j, player in enumerate(entries):
            it = look(player)
            curve, width = run.gains[:, i, j], 0.5 if thin else 1.1
            ax.plot(run.times, curve.real, color=it.colour, linestyle=it.dashes, linewidth=width)
            if np.iscomplexobj(curve) and curve.imag.any():
                ax.plot(run.times, curve.imag, color=it.colour, linestyle=it.dashes, linewidth=0.5 * width, alpha=0.7)
        ax.axhline(0.0, color=ink(0.7), linewidth=0.5, zorder=1.0)
        ax.set(xlim=span(run.times), ylabel=f"$g_{{{symbol(observer)}}}$")
        ax.yaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 2.5, 5, 10]))
        if changes:
            mark_changes(ax, run, say=ax is panels[min(len(panels), len(observers)) - 1])
    for ax in panels[len(observers) :]:
        ax.set_axis_off()
    drawn = panels[: len(observers)]
    for ax in drawn:
        below = ax.get_subplotspec()
        if below is None or below.is_last_row() or not ax.get_shared_x_axes().joined(ax, drawn[-1]) or ax is drawn[-1]:
            ax.set_xlabel(time_label(run))
    _legend(drawn[0], entries)
    return axes


def _legend(ax: Axes, entries: tuple[str, ...]) -> None:
    """Say above the first panel whose state each curve weighs."""
    handles = []
    for player in entries:
        it = look(player)
        label = f"$X_{{{symbol(player)}}}-X_a$"
        handles.append(Line2D([], [], color=it.colour, linestyle=it.dashes, linewidth=1.1, label=label))
    above(ax, handles, fontsize="small")
