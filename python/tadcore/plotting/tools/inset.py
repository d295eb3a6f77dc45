"""A magnified view of the end, where players meet, set into an empty part of the figure."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.patches import Rectangle

from tadcore._shared.arrays import Floats

from .ground import ink

if TYPE_CHECKING:
    from matplotlib.axes import Axes


_TOUCHING = 7.0  # points between two end markers that touch
_CROWD = 3  # so many touching pairs make a crowd
_WIDTHS = (0.5, 0.44, 0.38, 0.33, 0.28)  # of the axes, as the margins are
_MARGIN = 0.03
_CLEAR = 0.04
_LEAST = 1.5  # a weaker lens would show nothing new


def crowd(ax: Axes, ends: Floats, low: Floats, high: Floats) -> Floats | None:
    """Return those of the end points, shape (·, 2), that would be printed on top of one another, or None if few are."""
    width, height = _inches(ax)
    scale = 72.0 * min(width / (high[0] - low[0]), height / (high[1] - low[1]))
    apart = scale * np.linalg.norm(ends[:, None] - ends[None, :], axis=-1)
    touching = (apart < _TOUCHING) & ~np.eye(len(ends), dtype=bool)
    return ends[touching.any(axis=1)] if touching.sum() // 2 >= _CROWD else None


def magnify(
    ax: Axes, crowded: Floats, occupied: Floats, low: Floats, high: Floats, pad: float, draw: Callable[[Axes], None]
) -> Axes | None:
    """Draw once more, with ``draw``, the region ``pad`` around ``crowded``, in a square that ``occupied`` leaves free.

    Returns the axes of the inset, or None where nothing is free or the region is too large to gain from it.
    """
    width, height = _inches(ax)
    low, high = filled(low, high, width / height)
    spread = np.ptp(crowded, axis=0) + 2 * pad
    extent = float(max(spread[0], spread[1] * width / height)) * 1.1
    part = extent / float(high[0] - low[0])  # of the axes' width, and of their height too
    relative = (occupied - low) / (high - low)
    for size in _WIDTHS:
        if size < _LEAST * part:
            break
        corner = _free(relative, size)
        if corner is not None:
            inset = ax.inset_axes((*corner, size, size))
            _frame(ax, inset, crowded, extent, extent * height / width, draw)
            return inset
    return None


def _free(occupied: Floats, size: float) -> Floats | None:
    """Return the lower left corner of the square of this size furthest from all points, None where none is clear."""
    along = np.linspace(_MARGIN, 1.0 - _MARGIN - size, 13)
    corners = np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)
    centre = corners[:, None, :] + size / 2
    gap = np.maximum(np.abs(occupied - centre) - size / 2, 0.0)
    clearance = np.linalg.norm(gap, axis=-1).min(axis=1)
    best = int(np.argmax(clearance))
    return corners[best] if clearance[best] > _CLEAR else None


def _frame(ax: Axes, inset: Axes, crowded: Floats, width: float, height: float, draw: Callable[[Axes], None]) -> None:
    draw(inset)
    x, y = (crowded.min(axis=0) + crowded.max(axis=0)) / 2
    inset.set(xlim=(x - width / 2, x + width / 2), ylim=(y - height / 2, y + height / 2), xticks=[], yticks=[])
    inset.set_aspect("equal")
    inset.patch.set_alpha(0.9)
    for spine in inset.spines.values():
        spine.set(color=ink(0.5), linewidth=0.6)
    corner = (x - width / 2, y - height / 2)
    ax.add_patch(Rectangle(corner, width, height, fill=False, edgecolor=ink(0.5), linewidth=0.6, zorder=3.3))


def _inches(ax: Axes) -> tuple[float, float]:
    box = ax.get_window_extent()
    dpi = ax.figure.dpi
    return box.width / dpi, box.height / dpi


def filled(low: Floats, high: Floats, ratio: float) -> tuple[Floats, Floats]:
    """Widen the box about its centre to the ratio of the axes, as an equal aspect will."""
    size, centre = high - low, (low + high) / 2
    size = np.array([max(size[0], size[1] * ratio), max(size[1], size[0] / ratio)])
    return centre - size / 2, centre + size / 2
