"""Names of curves at their right-hand ends, spread apart where the ends meet."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.artist import Artist
from matplotlib.text import Annotation, Text

from tadcore._shared.arrays import Floats

from .style import points

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.backend_bases import RendererBase


_LEFT = 9.0  # points from the frame to a name
_APART = 1.0  # points between two names


class _Ends(Artist):
    """Spreads the names when the figure is drawn, since only then is the height of the axes known."""

    def __init__(self, ax: Axes, names: list[Annotation]) -> None:
        super().__init__()
        self._ax, self._names = ax, names
        self.set_zorder(-100.0)
        self.set_in_layout(False)
        ax.add_artist(self)

    def draw(self, renderer: RendererBase) -> None:
        """Put each name level with its curve, or as near as the others allow."""
        unit = points(renderer)
        frame = self._ax.get_window_extent(renderer)
        wanted = np.array([self._ax.transData.transform((0.0, name.xy[1]))[1] for name in self._names])
        boxes = [Text.get_window_extent(name, renderer) for name in self._names]  # without the leader
        heights = np.array([box.height for box in boxes]) + _APART * unit
        placed = spread(np.clip(wanted, frame.y0, frame.y1), heights, frame.y0, frame.y1)
        for name, have, want in zip(self._names, placed, wanted, strict=True):
            name.set_position((_LEFT, (have - want) / unit))


def spread(wanted: Floats, heights: Floats, low: float, high: float) -> Floats:
    """Return centres as near to ``wanted`` as boxes of these heights can be without touching, within the range.

    Subtracting the heights of the boxes below turns "boxes do not touch" into "values do not decrease", so the
    nearest centres in least squares are an isotonic regression.
    """
    from scipy.optimize import isotonic_regression

    order = np.argsort(wanted, kind="stable")
    below = np.cumsum(heights[order]) - heights[order] / 2
    shifted = isotonic_regression(wanted[order] - below).x
    placed = np.empty(len(wanted))
    placed[order] = np.clip(shifted, low, max(high - float(heights.sum()), low)) + below
    return placed


def label_ends(ax: Axes, ends: Sequence[tuple[float, str, str]]) -> list[Annotation]:
    """Name curves right of the frame: ``ends`` holds, for each, its last value, its name and its colour."""
    names = []
    for value, text, colour in ends:
        names.append(
            ax.annotate(
                text,
                (1.0, value),
                xycoords=("axes fraction", "data"),
                xytext=(_LEFT, 0.0),
                textcoords="offset points",
                ha="left",
                va="center",
                color=colour,
                annotation_clip=False,
                arrowprops={"arrowstyle": "-", "color": colour, "linewidth": 0.5, "shrinkA": 0, "shrinkB": 0},
            )
        )
    _Ends(ax, names)
    return names
