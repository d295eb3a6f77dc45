"""Pictures of a map in the making: how the game ends by the start of one player, sampled or proved.

Each is a generator that yields how far it is, and the outcome at every pixel so far; it can be left at any time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from matplotlib.colors import to_rgb
from numpy.typing import NDArray

from tadcore import _core
from tadcore._shared.threads import cores
from tadcore.analysis.certified import Proving
from tadcore.analysis.maps import outcome_map
from tadcore.plotting.tools.outcomes import outcome_look
from tadcore.scenario.model import Scenario

SIDE = 256
"""Pixels along each side."""
UNKNOWN, UNDECIDED = -2, -1
"""Of a pixel: nothing is known yet; nothing will be proved."""

_COARSE = 4  # pixels along each side that the first picture takes as one
_STRIP = 16  # rows of pixels from picture to picture
_BOXES = 256  # looked at from picture to picture
_FINEST = 0.9  # of a pixel: boxes as wide as one are not cut
_BUDGET = 200_000  # boxes: more than there are at this resolution

Region: TypeAlias = tuple[float, float, float, float]
"""Left, right, bottom, top."""
Codes: TypeAlias = NDArray[np.int64]
"""Of every pixel, from below: the outcome, as an index of `outcomes_of`, or one of the two above."""


@dataclass(frozen=True)
class Picture:
    """A map so far."""

    share: float
    """How much of it is there."""
    codes: Codes
    names: tuple[str, ...]

    @property
    def there(self) -> list[str]:
        """The outcomes that occur."""
        return [name for i, name in enumerate(self.names) if np.any(self.codes == i)]

    def rgba(self, alpha: float, undecided: tuple[str, float]) -> NDArray[np.uint32]:
        """The colours, as Bokeh takes them: outcomes with one opacity, what stays undecided in a colour of its own."""
        colours = np.zeros((len(self.names) + 2, 4))
        colours[2:, :3] = [outcome_look(name).fill for name in self.names]
        colours[2:, 3] = alpha
        colours[UNDECIDED - UNKNOWN] = *to_rgb(undecided[0]), undecided[1]
        packed = np.round(255.0 * colours).astype(np.uint8).view(np.uint32)[:, 0]
        return np.asarray(packed[self.codes - UNKNOWN])


def outcomes_of(sc: Scenario) -> tuple[str, ...]:
    """The outcomes of a game in the order of their codes."""
    return ("timeout", "captured", *sc.players[: sc.n], "diverged")


def sampled(sc: Scenario, player: str, region: Region, stop: _core.Stop) -> Iterator[Picture]:
    """The outcome at the middle of every pixel: first of coarse ones, then from below."""
    names, step = outcomes_of(sc), _pixel(region)
    codes = np.repeat(
        np.repeat(_played(sc, player, region, step * _COARSE, 0, SIDE // _COARSE), _COARSE, 0), _COARSE, 1
    )
    yield Picture(0.0, codes, names)
    for first in range(0, SIDE, _STRIP):
        codes = codes.copy()
        codes[first : first + _STRIP] = _played(sc, player, region, step, first, _STRIP)
        yield Picture((first + _STRIP) / SIDE, codes, names)


def proved(sc: Scenario, player: str, region: Region, stop: _core.Stop) -> Iterator[Picture]:
    """What is proved of the boxes of one player's start, the larger boxes first."""
    left, right, bottom, top = region
    step = _pixel(region)
    proving = Proving(
        sc,
        player,
        x=(left, right),
        y=(bottom, top),
        resolution=_FINEST * float(step.min()),
        budget=_BUDGET,
        threads=_threads(),
    )
    names = outcomes_of(sc)
    while not proving.done:
        proving.advance(_BOXES, stop)
        corners, kind, defender = proving.settled()
        edges = np.round((corners.reshape(-1, 2, 2) - [left, bottom]) / step).astype(np.int64)
        low, size = edges[:, 0], np.maximum(edges[:, 1] - edges[:, 0], 1)
        code = np.where(kind < 0, UNDECIDED, np.where(kind == 2, 2 + defender, kind))
        codes = np.full((SIDE, SIDE), UNKNOWN, dtype=np.int64)
        for wide, high in np.unique(size, axis=0).tolist():
            alike = (size == [wide, high]).all(axis=1)
            columns, rows = low[alike].T
            across = np.minimum(columns[:, None, None] + np.arange(wide), SIDE - 1)
            up = np.minimum(rows[:, None, None] + np.arange(high)[:, None], SIDE - 1)
            codes[up, across] = code[alike, None, None]
        yield Picture(float(np.mean(codes != UNKNOWN)), codes, names)


def _played(sc: Scenario, player: str, region: Region, step: NDArray[np.float64], first: int, rows: int) -> Codes:
    """The outcomes at the middles of some rows of pixels of a size."""
    left, _, bottom, _ = region
    columns = round((region[1] - left) / float(step[0]))
    (x0, x1), (y0, y1) = (
        left + step[0] * np.array([0.5, columns - 0.5]),
        bottom + step[1] * (first + np.array([0.5, rows - 0.5])),
    )
    data = outcome_map(sc, player, x=(x0, x1, columns), y=(y0, y1, rows), threads=_threads()).dataset
    code = np.where(data["kind"].values == 2, 2 + data["defender"].values.astype(np.int64), data["kind"].values)
    return np.where(data["diverged"].values, sc.n + 2, code).astype(np.int64)


def _pixel(region: Region) -> NDArray[np.float64]:
    """How wide and how high a pixel is."""
    left, right, bottom, top = region
    return np.array([(right - left) / SIDE, (top - bottom) / SIDE])


def _threads() -> int:
    """All cores but one, which is the page's."""
    return max(1, cores() - 1)
