"""Certified outcome maps: proved areas flat, what is undecided hatched."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.patches import Patch, Rectangle

from tadcore._shared.arrays import Floats
from tadcore._shared.calls import public
from tadcore.game.outcome import ending_codes, ending_names
from tadcore.plotting.tools.axes import above
from tadcore.plotting.tools.outcomes import outcome_look
from tadcore.scenario.model import Scenario

from .maps import Extent, draw_players, region

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike, NDArray

_OPEN: dict[str, Any] = {"facecolor": "0.35", "edgecolor": "white", "hatch": "xxxxx", "linewidth": 0.0}
_RIM = 0.5  # points: a strip between two outcomes is seen however thin it is
_BESIDE = 0.006  # of the region's longer side: how far on both sides of such a strip outcomes are looked for


class Certified(Protocol):
    """Proved outcomes over one player's start: `tadcore.CertifiedMap`."""

    @property
    def scenario(self) -> Scenario:
        """The game, with everyone else's start."""

    @property
    def player(self) -> str:
        """Whose start varies."""

    @property
    def dataset(self) -> xarray.Dataset:
        """Corners, ``kind`` and ``defender`` over ``box``."""

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, bottom and top of the region."""

    def at(self, points: ArrayLike) -> tuple[NDArray[np.int8], NDArray[np.int32]]:
        """Kind and defender at some starts."""


@public
def certified_map(found: Certified, ax: Axes | None = None, *, radii: bool = True, legend: bool = True) -> Axes:
    """Draw what is proved of how the game ends by the start of one player.

    Every proved box is filled with its outcome; what is undecided is dark and hatched. Two outcomes never touch: the
    strip between them, the barrier, is drawn with a rim, so that it is seen at any zoom. Players and radii are as in
    `outcome_map`.

    Parameters
    ----------
    found : CertifiedMap
        What to draw.
    ax : Axes, optional
        Where to draw; new axes if not given.
    radii : bool
        Whether to draw capture discs and visibility radii.
    legend : bool
        Whether to name the outcomes above the axes.

    Returns
    -------
    Axes
        The axes drawn in.
    """
    extent = found.extent
    left, right, bottom, top = extent
    ax = region(found.player, extent, ax, bar=False)
    corners = _corners(found)
    kind, defender = found.dataset["kind"].values, found.dataset["defender"].values
    ax.add_patch(Rectangle((left, bottom), right - left, top - bottom, zorder=1.0, **_OPEN))
    code = ending_codes(kind, defender, np.zeros(kind.shape, dtype=bool), found.scenario.n)
    entries = []
    for i, name in enumerate(ending_names(found.scenario.n)):
        if np.any(code == i):
            fill = outcome_look(name).fill
            areas = PolyCollection(
                list(corners[code == i]), facecolor=fill, linewidth=0.0, antialiased=False, zorder=1.1
            )
            areas.set_rasterized(True)  # tens of thousands of boxes: a picture in files, exact on screen
            ax.add_collection(areas, autolim=False)
            entries.append(Patch(facecolor=fill, edgecolor="0.25", linewidth=0.5, label=outcome_look(name).label))
    strip = _barrier(found, corners, extent)
    if strip.any():
        rims = PolyCollection(list(corners[strip]), facecolor="0.15", edgecolor="0.15", linewidth=_RIM, zorder=1.2)
        rims.set_rasterized(True)
        ax.add_collection(rims, autolim=False)
    if legend:
        if np.any(kind < 0):
            entries.append(Patch(label="undecided", **{**_OPEN, "hatch": "xxxx"}))
        above(ax, entries, columns=min(len(entries), 5), columnspacing=0.7, handlelength=1.4)
    draw_players(ax, found, extent, radii=radii, dark=False)
    return ax


def _corners(found: Certified) -> Floats:
    """The corners of every box, shape (L, 4, 2)."""
    left, right, bottom, top = (found.dataset[name].values for name in ("x_low", "x_high", "y_low", "y_high"))
    return np.stack(
        [np.stack(pair, axis=-1) for pair in ((left, bottom), (right, bottom), (right, top), (left, top))], 1
    )


def _barrier(found: Certified, corners: Floats, extent: Extent) -> NDArray[np.bool_]:
    """The undecided boxes with one outcome on one side and another on the opposite one."""
    left, right, bottom, top = extent
    strip = found.dataset["kind"].values < 0
    boxes = np.flatnonzero(strip)
    middles, by = corners[boxes].mean(axis=1), _BESIDE * max(right - left, top - bottom)
    apart = np.zeros(len(boxes), dtype=np.bool_)
    for way in ((1, 0), (0, 1), (1, 1), (1, -1)):
        sides = []
        for sign in (-1, 1):
            kind, defender = found.at(np.clip(middles + sign * by * np.array(way), [left, bottom], [right, top]))
            sides.append(np.where(kind < 0, -1, 4 * (defender.astype(np.int64) + 1) + kind))
        apart |= (sides[0] >= 0) & (sides[1] >= 0) & (sides[0] != sides[1])
    strip[boxes] = apart
    return strip
