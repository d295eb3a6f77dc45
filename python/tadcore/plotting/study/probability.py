"""The probability of an outcome over the start of one player."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tadcore._shared.calls import public
from tadcore.plotting.tools.axes import new_axes
from tadcore.plotting.tools.style import COLUMN, symbol

from .maps import OverStarts, draw_players, edges

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
    if outcome not in names:
        raise ValueError(f"no outcome {outcome!r}; one of {', '.join(names)}")
    if quantity not in _QUANTITIES:
        raise ValueError(f"no quantity {quantity!r}; one of {', '.join(_QUANTITIES)}")
    x, y = (np.asarray(found.dataset[axis].values, dtype=float) for axis in "xy")
    left, right, bottom, top = extent = (*edges(x, y), *edges(y, x))
    ratio = (top - bottom) / (right - left)
    beside = 0.7 if legend else 0.0  # inches that the colour bar takes
    ax = new_axes(ax, COLUMN, float(np.clip((COLUMN - 0.6 - beside) * ratio + 0.5, 1.6, 5.5)))
    share = found.dataset[quantity].sel(outcome=outcome).values
    image = ax.imshow(share, origin="lower", extent=extent, cmap="cividis", vmin=0.0, vmax=1.0, zorder=1.0)
    if min(share.shape) > 1 and share.min() < share.max():
        ax.contour(x, y, share, levels=[0.1, 0.3, 0.5, 0.7, 0.9], colors="white", linewidths=0.6, zorder=1.5)
    if legend:
        bar = ax.inset_axes((1.03, 0.0, 0.045, 1.0))  # as tall as the map, whatever its aspect
        words = "" if quantity == "estimate" else f", {quantity.replace('_', ' ')}"
        label = outcome if not outcome[1:].isdigit() else f"{symbol(outcome)}"
        text = f"P({outcome}){words}" if label == outcome else f"$P({label})${words}"
        bar.figure.colorbar(image, cax=bar, label=text)
    draw_players(ax, found, extent, radii=radii, dark=True)
    if best:
        estimate = found.dataset["estimate"].sel(outcome=outcome).values
        row, column = np.unravel_index(int(estimate.argmax()), estimate.shape)
        for colour, width in (("white", 2.4), ("black", 1.0)):
            ax.plot(x[column], y[row], marker="+", color=colour, markersize=9, markeredgewidth=width, zorder=3.4)
    who = symbol(found.player)
    ax.set(xlabel=f"$x_{{{who}}}(0)$", ylabel=f"$y_{{{who}}}(0)$", xlim=(left, right), ylim=(bottom, top))
    ax.set_aspect("equal")
    return ax
