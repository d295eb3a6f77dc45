"""Labels that keep out of one another's way.

A label belongs to a point of the plot. Where it is printed is decided when the figure is drawn, in the pixels of that
drawing, because only then are the size of the axes and of the text known; so labels stay apart after a resize, a zoom,
a change of dpi or a turn of a 3-D view.

Placement is greedy with a few sweeps of improvement. Each label may sit in one of a ring of places around its point;
a place costs for every label it covers, every bit of curve under it, every leader line it crosses, and for its
distance from the point. Labels take the cheapest place in turn, then are asked again with the others in place.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.lines import Line2D
from matplotlib.text import Text
from matplotlib.transforms import IdentityTransform
from numpy.typing import ArrayLike, NDArray

from tadcore._shared.arrays import Floats

from .ground import ink, paper
from .style import points

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.backend_bases import RendererBase


_ANGLES = np.deg2rad(np.arange(0.0, 360.0, 15.0))
_GAPS = np.array([3.5, 7.0, 11.0, 16.0, 22.0, 30.0, 40.0, 52.0, 66.0])  # points between a label and what it names
_AIR = 1.2  # points kept free around a label
_SWEEPS = 4


@dataclass(slots=True)
class _Label:
    anchor: Floats  # in data coordinates
    text: Text
    leader: Line2D
    leader_from: float  # points; a longer gap gets a leader line


class Labels(Artist):
    """The labels of one axes. Add points and curves, then draw the figure."""

    def __init__(self, ax: Axes) -> None:
        super().__init__()
        self._ax = ax
        self._labels: list[_Label] = []
        self._curves: list[Floats] = []
        self._spots: list[tuple[Floats, float]] = []
        self._key: tuple[float, ...] = ()
        self.set_zorder(-100.0)  # placed before the texts are printed
        self.set_in_layout(False)
        ax.add_artist(self)

    def add(self, anchor: ArrayLike, text: str, *, leader_from: float = 5.0, **style: Any) -> Text:
        """Label the point ``anchor`` (data coordinates, 2 or 3 of them) with ``text``.

        A label further from its point than ``leader_from`` typographic points is tied to it by a line.
        """
        point = np.asarray(anchor, dtype=float)
        leader = Line2D([], [], color=ink(0.35), linewidth=0.5, zorder=3.4, transform=IdentityTransform())
        style.setdefault("zorder", 4.5)
        printed = Text(0.0, 0.0, text, ha="center", va="center", transform=IdentityTransform(), **style)
        printed.set_bbox({"boxstyle": "square,pad=0.05", "facecolor": paper(), "edgecolor": "none", "alpha": 0.65})
        for artist in (leader, printed):
            artist.set_in_layout(False)
            artist.set_clip_on(False)
            self._ax.add_artist(artist)
        self._labels.append(_Label(point, printed, leader, leader_from))
        return printed

    def avoid_curve(self, points: ArrayLike) -> None:
        """Keep labels off the polyline through ``points``, data coordinates, one row per point."""
        self._curves.append(np.asarray(points, dtype=float))

    def avoid_spot(self, point: ArrayLike, radius: float = 4.0) -> None:
        """Keep labels ``radius`` typographic points away from ``point``."""
        self._spots.append((np.asarray(point, dtype=float), radius))

    @property
    def texts(self) -> list[Text]:
        """The labels, in the order in which they were added."""
        return [label.text for label in self._labels]

    def draw(self, renderer: RendererBase) -> None:
        """Put each label in its place; nothing is painted here."""
        if not self._labels or not self.get_visible():
            return
        unit = points(renderer)
        anchors = self._pixels(np.array([label.anchor for label in self._labels]))
        sizes = np.array([_size(label.text, renderer) for label in self._labels]) + 2 * _AIR * unit
        frame = np.array(self._ax.get_window_extent(renderer).extents)
        key = (unit, *anchors.ravel(), *sizes.ravel(), *frame)
        if key == self._key:
            return
        self._key = key
        centres, gaps = self._solve(anchors, sizes, frame, unit, renderer)
        for label, anchor, centre, size, gap in zip(self._labels, anchors, centres, sizes, gaps, strict=True):
            label.text.set_position((centre[0], centre[1]))
            if gap > label.leader_from:
                end = np.clip(anchor, centre - size / 2 + unit, centre + size / 2 - unit)
                label.leader.set_data([anchor[0], end[0]], [anchor[1], end[1]])
            else:
                label.leader.set_data([], [])

    def _pixels(self, points: Floats) -> Floats:
        if points.shape[1] == 3:
            from mpl_toolkits.mplot3d import proj3d

            x, y, _ = proj3d.proj_transform(*points.T, self._ax.get_proj())  # type: ignore[attr-defined]
            points = np.column_stack([x, y])
        return np.asarray(self._ax.transData.transform(points), dtype=float)

    def _obstacles(self, unit: float) -> tuple[Floats, Floats, Floats]:
        """Return points of the drawing in pixels, the room that each wants, and what covering it costs."""
        places, radii, prices = [np.empty((0, 2))], [np.empty(0)], [np.empty(0)]
        for curve in self._curves:
            dense = _resample(self._pixels(curve), 2.0 * unit)
            places.append(dense)
            radii.append(np.full(len(dense), 0.8 * unit))
            prices.append(np.full(len(dense), 3.0))
        for spot, radius in self._spots:
            places.append(self._pixels(spot[None, :]))
            radii.append(np.full(1, radius * unit))
            prices.append(np.full(1, 60.0))
        return np.vstack(places), np.concatenate(radii), np.concatenate(prices)

    def _solve(
        self, anchors: Floats, sizes: Floats, frame: Floats, unit: float, renderer: RendererBase
    ) -> tuple[Floats, Floats]:
        drawn, radii, prices = self._obstacles(unit)
        fixed = _boxes(self._ax, renderer)
        direction = np.column_stack([np.cos(_ANGLES), np.sin(_ANGLES)])
        places, costs = [], []
        for anchor, size in zip(anchors, sizes, strict=True):
            reach = _support(direction, size / 2)
            radius = reach[None, :] + _GAPS[:, None] * unit
            centre = (anchor + radius[:, :, None] * direction[None, :, :]).reshape(-1, 2)
            cost = np.repeat(_GAPS, len(direction)) * 0.25
            cost = cost + _covered(centre, size / 2, drawn, radii) @ prices
            cost += 8.0 * _astray(centre, size / 2, anchor, anchors, unit)
            cost += 0.8 * _near_segments(anchor, centre, drawn, 1.5 * unit)
            outside = np.maximum(frame[:2] - (centre - size / 2), 0) + np.maximum(centre + size / 2 - frame[2:], 0)
            cost += 400.0 * (outside.max(axis=1) > 0) + 10.0 * outside.sum(axis=1) / unit
            for box in fixed:
                cost += 2000.0 * _overlap(centre, size, (box[:2] + box[2:]) / 2, box[2:] - box[:2])
            places.append(centre)
            costs.append(cost)
        chosen = np.full(len(anchors), -1)
        for sweep in range(_SWEEPS):
            before = chosen.copy()
            for i in range(len(anchors)):
                total = costs[i].copy()
                for j in range(len(anchors)):
                    if j == i or chosen[j] < 0:
                        continue
                    other = places[j][chosen[j]]
                    total += 2000.0 * _overlap(places[i], sizes[i], other, sizes[j])
                    total += 60.0 * _crosses(anchors[i], places[i], anchors[j], other)
                    total += 40.0 * _through(anchors[i], places[i], other, sizes[j])
                    total += 40.0 * _through(anchors[j], other, places[i], sizes[i])
                chosen[i] = int(np.argmin(total))
            if sweep and np.array_equal(before, chosen):
                break
        centres = np.array([places[i][k] for i, k in enumerate(chosen)])
        return centres, np.array([_GAPS[k // len(direction)] for k in chosen])


def _size(text: Text, renderer: RendererBase) -> tuple[float, float]:
    box = text.get_window_extent(renderer)
    return box.width, box.height


def _boxes(ax: Axes, renderer: RendererBase) -> list[Floats]:
    """Return the extents of what labels must keep clear of altogether: the legend and the insets."""
    legend = ax.get_legend()
    solid = [*ax.child_axes, *([] if legend is None else [legend])]
    return [np.array(artist.get_window_extent(renderer).extents) for artist in solid]


def _resample(points: Floats, spacing: float) -> Floats:
    steps = np.hypot(*np.diff(points, axis=0).T) if len(points) > 1 else np.zeros(0)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    if along[-1] == 0.0 or not np.isfinite(along[-1]):
        return points[:1]
    at = np.linspace(0.0, along[-1], min(int(along[-1] / spacing) + 2, 4000))
    return np.column_stack([np.interp(at, along, points[:, 0]), np.interp(at, along, points[:, 1])])


def _support(direction: Floats, half: Floats) -> Floats:
    """Return how far from its centre a box reaches in each direction."""
    with np.errstate(divide="ignore"):
        return np.asarray(np.min(half / np.maximum(np.abs(direction), 1e-9), axis=1))


def _covered(centres: Floats, half: Floats, points: Floats, radii: Floats) -> Floats:
    """Tell, for each place (rows), which points (columns) a box there would cover: 1 or 0."""
    beyond = np.abs(points[None, :, :] - centres[:, None, :]) - half - radii[None, :, None]
    return np.asarray((beyond < 0).all(axis=2), dtype=float)


def _astray(centres: Floats, half: Floats, anchor: Floats, anchors: Floats, margin: float) -> NDArray[np.bool_]:
    """Tell which places lie nearer to another label's point than to their own, so that they would be misread."""
    gap = np.maximum(np.abs(anchors[None, :, :] - centres[:, None, :]) - half, 0.0)
    away = np.hypot(gap[..., 0], gap[..., 1])
    own = np.hypot(*np.maximum(np.abs(anchor - centres) - half, 0.0).T)
    others = np.hypot(*(anchors - anchor).T) > margin
    return np.asarray((away[:, others] < own[:, None]).any(axis=1))


def _near_segments(start: Floats, ends: Floats, points: Floats, width: float) -> Floats:
    """Count the points that lie along each leader line, its first stretch left out."""
    if not len(points):
        return np.zeros(len(ends))
    run = ends - start
    length2 = np.maximum((run**2).sum(axis=1), 1e-12)
    rel = points - start
    s = (rel @ run.T) / length2
    away = np.abs(rel[:, :1] * run[:, 1] - rel[:, 1:] * run[:, 0]) / np.sqrt(length2)
    return np.asarray(((s > 0.25) & (s < 1.0) & (away < width)).sum(axis=0), dtype=float)


def _overlap(centres: Floats, size: Floats, other: Floats, other_size: Floats) -> NDArray[np.bool_]:
    return np.asarray((np.abs(centres - other) < (size + other_size) / 2).all(axis=1))


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _crosses(start: Floats, ends: Floats, other_start: Floats, other_end: Floats) -> NDArray[np.bool_]:
    """Tell which segments ``start``-``ends`` cross the segment of another leader."""
    run, other = ends - start, other_end - other_start
    d1, d2 = _cross(run, other_start - start), _cross(run, other_end - start)
    d3, d4 = _cross(other, start - other_start), _cross(other, ends - other_start)
    return np.asarray((d1 * d2 < 0) & (d3 * d4 < 0))


def _through(start: Floats, ends: Floats, centres: Floats, size: Floats) -> NDArray[np.bool_]:
    """Tell which segments ``start``-``ends`` pass through a box; one segment and many boxes, or many and one."""
    at = np.linspace(0.0, 1.0, 9)[:, None, None]
    path = start + at * (ends - start)
    return np.asarray((np.abs(path - centres) < size / 2).all(axis=2).any(axis=0))
