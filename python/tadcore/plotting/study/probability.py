"""The probability of an outcome over the start of one player."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tadcore._shared.calls import public
from tadcore.plotting.tools.axes import colour_bar
from tadcore.plotting.tools.outcomes import listed
from tadcore.plotting.tools.style import symbol

from .maps import OverStarts, draw_players, frame

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_QUANTITIES = ("estimate", "low", "high", "band_low", "band_high")


@public
def probability_map(
    found: OverStarts,
    ax: Axes | None = None,
    *,
    outcome: str = "intercepted",
    quantity: str = "estimate",
    radii: bool = True,
    best: bool = True,
    legend: bool = True,
) -> Axes:
    """Draw how probable an outcome is, by the start of one player.

    Lines follow the probabilities 0.1, 0.3, 0.5, 0.7 and 0.9. The players stand where the scenario has them, as in
    `outcome_map`; what a study varies is drawn at the value that the scenario gives it.

    Parameters
    ----------
    found : ProbabilityMap
        What to draw.
    ax : Axes, optional
        Where to draw; new axes of a one-column figure if not given.
    outcome : str
        ``"timeout"``, ``"captured"``, ``"intercepted"``, or ``"d1"`` … ``"dn"``.
    quantity : {"estimate", "low", "high", "band_low", "band_high"}
        The share of the trials, or an end of its interval, pointwise or over all places at once.
    radii : bool
        Whether to draw capture discs and visibility radii.
    best : bool
        Whether to mark the place where the outcome came most often with a cross.
    legend : bool
        Whether to name the colours beside the map.

    Returns
    -------
    Axes
        The axes drawn in.

    Raises
    ------
    ValueError
        No such outcome or quantity.
    """
    names = found.dataset["outcome"].values.tolist()
    listed("outcome", outcome, names)
    listed("quantity", quantity, _QUANTITIES)
    ax, x, y, extent = frame(found, ax, bar=legend)
    share = found.dataset[quantity].sel(outcome=outcome).values
    image = ax.imshow(share, origin="lower", extent=extent, cmap="cividis", vmin=0.0, vmax=1.0, zorder=1.0)
    if min(share.shape) > 1 and share.min() < share.max():
        ax.contour(x, y, share, levels=[0.1, 0.3, 0.5, 0.7, 0.9], colors="white", linewidths=0.6, zorder=1.5)
    if legend:
        words = "" if quantity == "estimate" else f", {quantity.replace('_', ' ')}"
        label = outcome if not outcome[1:].isdigit() else f"{symbol(outcome)}"
        text = f"P({outcome}){words}" if label == outcome else f"$P({label})${words}"
        colour_bar(ax, image, text)
    draw_players(ax, found, extent, radii=radii, dark=True)
    if best:
        estimate = found.dataset["estimate"].sel(outcome=outcome).values
        row, column = np.unravel_index(int(estimate.argmax()), estimate.shape)
        for colour, width in (("white", 2.4), ("black", 1.0)):
            ax.plot(x[column], y[row], marker="+", color=colour, markersize=9, markeredgewidth=width, zorder=3.4)
    return ax
