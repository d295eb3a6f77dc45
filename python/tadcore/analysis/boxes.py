"""Boxes of one player's start, each with what is proved of it."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tadcore._shared.arrays import Floats, as_real, refuse_where
from tadcore._shared.html import as_html
from tadcore._shared.shares import share
from tadcore.errors import ScenarioError
from tadcore.scenario.model import Scenario

from .saving import save

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

_SLACK = 1e-14  # of an area: more than its sum is rounded by
_REASONS = {
    "too_small": "at the least size",
    "budget": "past the budget",
    "diverges": "diverging throughout",
}


@dataclass(frozen=True, eq=False, repr=False)
class CertifiedMap:
    """How the game ends over one player's start, as far as it is proved; made by `certified_map`.

    Proved is, for every start in a box, its rim included: the game played with the tabulated step matrices ends so, by
    the arithmetic of `tadcore.simulate_batch` and in exact arithmetic. That the matrices are the right ones is not part
    of the proof.

    Attributes
    ----------
    scenario : Scenario
        The game, with everyone else's place.
    player : str
        Whose start varies.
    dataset : xarray.Dataset
        The boxes over ``box``: ``x_low``, ``x_high``, ``y_low`` and ``y_high`` (float64), ``level`` (int8), how often
        the first boxes were cut to make it, ``kind`` (int8; -1 where nothing is proved) and ``defender`` (int32) as in
        `tadcore.Batch`, and ``reason`` (int8): 0 proved, 1 undecided at the least size, 2 past the budget, 3 every
        start diverges.
    """

    scenario: Scenario
    player: str
    dataset: xarray.Dataset

    @property
    def areas(self) -> Floats:
        """The area of each box."""
        data = self.dataset
        wide = data["x_high"].values - data["x_low"].values
        return np.asarray(wide * (data["y_high"].values - data["y_low"].values))

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, bottom and top of the region."""
        data = self.dataset
        low, high = (
            (float(data[f"{axis}_low"].min()) for axis in "xy"),
            (float(data[f"{axis}_high"].max()) for axis in "xy"),
        )
        (left, bottom), (right, top) = low, high
        return left, right, bottom, top

    @property
    def proved(self) -> float:
        """The share of the region's area whose outcome is proved."""
        return self._area(self.dataset["kind"].values >= 0) / self._whole()

    def shares(self) -> dict[str, float]:
        """The shares of the region's area: proved of each outcome that occurs, then what is not, by its reason."""
        named = {name: self._area(where) / self._whole() for name, where in self._outcomes().items()}
        reason = self.dataset["reason"].values
        rest = {name: self._area(reason == code) / self._whole() for code, name in enumerate(_REASONS, 1)}
        return {name: part for name, part in (named | rest).items() if part > 0.0}

    def bounds(self) -> dict[str, tuple[float, float]]:
        """Bounds on the probability of every outcome if the start is uniform over the region; no statistics.

        From below the area that is proved of the outcome, from above that and all that is not proved of any. Games that
        diverge count as none of these outcomes, as in statistics.
        """
        whole = self._whole()
        open_area = self._area(self.dataset["kind"].values < 0)
        named = self._outcomes()
        team = [where for name, where in named.items() if name not in ("timeout", "captured")]
        named["intercepted"] = np.logical_or.reduce(team)
        bounds = {}
        for name, where in named.items():
            area = self._area(where)
            bounds[name] = (area / whole * (1.0 - _SLACK), min((area + open_area) / whole * (1.0 + _SLACK), 1.0))
        return bounds

    def at(self, points: ArrayLike) -> tuple[NDArray[np.int8], NDArray[np.int32]]:
        """How games from some starts end, as far as that is proved.

        Parameters
        ----------
        points : array_like, shape (L, 2)
            Starts of the player within the region.

        Returns
        -------
        kind : ndarray of int8, shape (L,)
            Codes of `OutcomeKind`; -1 where nothing is proved.
        defender : ndarray of int32, shape (L,)
            The intercepting defender, 0-based; -1 where none, or nothing is proved.

        Raises
        ------
        ScenarioError
            A point is not in the region, or ``points`` is no such array.
        """
        rule = "an array of finite numbers of shape (L, 2)"
        places = as_real("points", points, rule)
        if places.ndim != 2 or places.shape[1] != 2:
            raise ScenarioError("points", f"shape {places.shape}", rule)
        left, right, bottom, top = self.extent
        inside = (places >= [left, bottom]) & (places <= [right, top])
        refuse_where("points", places, ~inside, f"in the region, [{left:g}, {right:g}] × [{bottom:g}, {top:g}]")
        kind, defender = np.full(len(places), -1, dtype=np.int8), np.full(len(places), -1, dtype=np.int32)
        for found, boxes in self._boxes_of(places):
            kinds = self.dataset["kind"].values[boxes]
            proved = kinds >= 0
            kind[found[proved]] = kinds[proved]
            defender[found[proved]] = self.dataset["defender"].values[boxes[proved]]
        return kind, defender

    def _boxes_of(self, places: Floats) -> Iterator[tuple[NDArray[np.intp], NDArray[np.intp]]]:
        """Level by level the points that lie in a box of it, and in which."""
        data = {name: self.dataset[name].values for name in ("x_low", "x_high", "y_low", "y_high")}
        for level in np.unique(self.dataset["level"].values):
            boxes = np.flatnonzero(self.dataset["level"].values == level)
            columns, rows = np.unique(data["x_low"][boxes]), np.unique(data["y_low"][boxes])
            where = _cell(columns, data["x_low"][boxes]) * len(rows) + _cell(rows, data["y_low"][boxes])
            order = np.argsort(where, kind="stable")
            wanted = _cell(columns, places[:, 0]) * len(rows) + _cell(rows, places[:, 1])
            place = np.minimum(np.searchsorted(where[order], wanted), len(boxes) - 1)
            box = boxes[order[place]]
            inside = where[order[place]] == wanted
            for axis, along in zip("xy", places.T, strict=True):
                inside &= (data[f"{axis}_low"][box] <= along) & (along <= data[f"{axis}_high"][box])
            yield np.flatnonzero(inside), box[inside]

    def _outcomes(self) -> dict[str, NDArray[np.bool_]]:
        kind, defender = self.dataset["kind"].values, self.dataset["defender"].values
        team = {f"d{i + 1}": (kind == 2) & (defender == i) for i in range(self.scenario.n)}
        return {"timeout": kind == 0, "captured": kind == 1, **team}

    def _area(self, where: NDArray[np.bool_]) -> float:
        return math.fsum(self.areas[where])

    def _whole(self) -> float:
        left, right, bottom, top = self.extent
        return (right - left) * (top - bottom)

    def plot(self, ax: Axes | None = None, **options: Any) -> Axes:
        """Draw the map; see `tadcore.plotting.certified_map`."""
        from tadcore.plotting import certified_map as draw

        return draw(self, ax, **options)

    def save(self, path: str | os.PathLike[str], **options: Any) -> Path:
        """Write the data (``.nc``, netCDF 3) or the figure (``.png``, ``.pdf``, ``.svg``), whole or not at all.

        Options go to `plot`, where a figure is written. `load_certified_map` reads the data.

        Raises
        ------
        ScenarioError
            The file name ends in something else.
        """
        return save(self, path, options)

    def _repr_html_(self) -> str:
        from tadcore.plotting.tools.inline import inline

        rows = [[name, f"[{share(low)}, {share(high)}]", ""] for name, (low, high) in self.bounds().items()]
        return as_html(repr(self), ["outcome", "probability", ""], rows, inline(self.plot, repr(self)))

    def __repr__(self) -> str:
        rest = {_REASONS[name]: part for name, part in self.shares().items() if name in _REASONS}
        undecided = ", ".join(f"{share(100.0 * part, 2)} % {words}" for words, part in rest.items())
        return (
            f"CertifiedMap(start of {self.player}: {share(100.0 * self.proved, 2)} % of the area proved by "
            f"{self.dataset.sizes['box']:,} boxes{undecided and f'; undecided {undecided}'})"
        )


def _cell(edges: Floats, values: Floats) -> NDArray[np.intp]:
    """The last edge that is not beyond each value; the first where there is none."""
    return np.maximum(np.searchsorted(edges, values, side="right") - 1, 0)
