"""Where one player may start: the grid that a map is played over, and the ranges of a region."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import Floats, as_index
from tadcore._shared.limits import COORDINATE
from tadcore.errors import ScenarioError
from tadcore.scenario.model import Scenario

BLOCK = 1 << 16
"""Games played at once: some megabytes of positions, and enough work for any number of threads."""

_MOST_ON_AN_AXIS = 100_000
_MOST = 200_000_000  # places: 13 bytes each
_FINEST = 1e-12  # of the ends, between neighbours: closer ones are not told apart in a figure
_SMALLEST = 1e-100


@dataclass(frozen=True)
class Grid:
    """The starts of one player: every (x, y) of the axes and, in space, one height."""

    player: str
    columns: Floats
    rows: Floats
    up: float | None

    @classmethod
    def of(cls, sc: Scenario, player: str, x: Sequence[Any], y: Sequence[Any], z: float | None) -> Grid:
        """From (low, high, count) for each axis; the height is the player's own where none is given."""
        columns, rows = _axis("x", x), _axis("y", y)
        if len(columns) * len(rows) > _MOST:
            raise ScenarioError("x, y", f"{len(columns) * len(rows):,} places", f"a grid of at most {_MOST:,} places")
        return cls(player, columns, rows, _height(sc, player, z))

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return len(self.rows), len(self.columns)

    def places(self, block: slice) -> Floats:
        """Some of the places, row after row, shape (L, dim)."""
        index = np.arange(*block.indices(len(self.rows) * len(self.columns)))
        across, along = self.columns[index % len(self.columns)], self.rows[index // len(self.columns)]
        height: list[NDArray[Any]] = [] if self.up is None else [np.full(len(index), self.up)]
        return np.column_stack([across, along, *height])

    def coords(self) -> dict[str, Any]:
        """The axes as coordinates of a dataset."""
        return {
            axis: (axis, values, {"long_name": f"initial {axis} of {self.player}", "units": "1"})
            for axis, values in (("x", self.columns), ("y", self.rows))
        }

    def attrs(self) -> dict[str, Any]:
        """Player and height as attributes of a dataset."""
        return {"player": self.player, **({} if self.up is None else {"z": self.up})}


def _height(sc: Scenario, player: str, z: float | None) -> float | None:
    """In space, the height of the plane of a grid: the one given, or the player's own; None in the plane."""
    if z is not None and (sc.dim == 2 or not math.isfinite(z)):
        raise ScenarioError("z", z, "a finite height" if sc.dim == 3 else "left out: this game is in the plane")
    if sc.dim == 2:
        return None
    return float(sc.positions[sc.players.index(player), 2] if z is None else z)


def as_range(field: str, given: Sequence[Any]) -> tuple[float, float]:
    """The ends of an axis of a region, from (low, high); raises `ScenarioError`."""
    try:
        low, high = map(float, given)
    except (TypeError, ValueError):
        raise ScenarioError(field, given, "(low, high)") from None
    if not (COORDINATE.holds(low) and COORDINATE.holds(high) and low < high):
        raise ScenarioError(field, given, f"(low, high) with low < high, each end {COORDINATE.words}")
    return low, high


def _axis(field: str, given: Sequence[Any]) -> Floats:
    """The places of one axis of a grid, from (low, high, count)."""
    try:
        low, high, count = given
        ends = float(low), float(high)
    except (TypeError, ValueError):
        raise ScenarioError(field, given, "(low, high, count)") from None
    number = as_index(f"{field}[2]", count, _MOST_ON_AN_AXIS, least=1)
    for end in ends:
        if not COORDINATE.holds(end):
            raise ScenarioError(field, given, f"(low, high, count), each end {COORDINATE.words}")
    if ends[0] > ends[1] or (ends[0] == ends[1]) != (number == 1):
        raise ScenarioError(field, given, "(low, high, count) with low < high, or one place with low = high")
    if number > 1 and not (ends[1] - ends[0]) / (number - 1) >= _FINEST * max(abs(ends[0]), abs(ends[1]), _SMALLEST):
        raise ScenarioError(field, given, f"(low, high, count) with places at least {_FINEST:g} of the ends apart")
    return np.linspace(*ends, number)
