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
from tadcore.analysis.replays import refuse_random
from tadcore.game.compiled import game_of
from tadcore.game.outcome import ending_codes, ending_names
from tadcore.plotting.tools.outcomes import outcome_look
from tadcore.scenario.model import Scenario
from tadcore.simulation.rules import capture_rows, visibility_rows

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
"""Of every pixel, from below: the outcome, as an index of `ending_names`, or one of the two above."""


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


def sampled(sc: Scenario, player: str, region: Region, stop: _core.Stop) -> Iterator[Picture]:
    """The outcome at the middle of every pixel, from below: first of coarse ones, then of all."""
    refuse_random(sc, "an outcome map", "tadcore.probability_map plays many trials from every start")
    names = tuple(ending_names(sc.n))
    codes = np.full((SIDE, SIDE), UNKNOWN, dtype=np.int64)
    for pixels in (_COARSE, 1):
        for first in range(0, SIDE, _STRIP):
            codes = codes.copy()
            strip = _played(sc, player, region, pixels, first, stop)
            codes[first : first + _STRIP] = np.repeat(np.repeat(strip, pixels, axis=0), pixels, axis=1)
            yield Picture((first + _STRIP) / SIDE if pixels == 1 else 0.0, codes, names)


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
    names = tuple(ending_names(sc.n))
    while not proving.done:
        proving.advance(_BOXES, stop)
        corners, kind, defender = proving.settled()
        edges = np.round((corners.reshape(-1, 2, 2) - [left, bottom]) / step).astype(np.int64)
        low, size = edges[:, 0], np.maximum(edges[:, 1] - edges[:, 0], 1)
        code = np.where(kind < 0, UNDECIDED, ending_codes(kind, defender, np.zeros_like(kind, dtype=bool), sc.n))
        codes = np.full((SIDE, SIDE), UNKNOWN, dtype=np.int64)
        for wide, high in np.unique(size, axis=0).tolist():
            alike = (size == [wide, high]).all(axis=1)
            columns, rows = low[alike].T
            across = np.minimum(columns[:, None, None] + np.arange(wide), SIDE - 1)
            up = np.minimum(rows[:, None, None] + np.arange(high)[:, None], SIDE - 1)
            codes[up, across] = code[alike, None, None]
        yield Picture(float(np.mean(codes != UNKNOWN)), codes, names)


def _played(sc: Scenario, player: str, region: Region, pixels: int, first: int, stop: _core.Stop) -> Codes:
    """The outcomes at the middles of squares of so many pixels, of the strip from one row of pixels on."""
    left, _, bottom, _ = region
    wide, high = pixels * _pixel(region)
    x = left + wide * (np.arange(SIDE // pixels) + 0.5)
    y = bottom + high * (first // pixels + np.arange(_STRIP // pixels) + 0.5)
    starts = np.tile(sc.positions, (len(y), len(x), 1, 1))
    starts[:, :, sc.players.index(player), 0] = x
    starts[:, :, sc.players.index(player), 1] = y[:, np.newaxis]
    rows = starts.reshape(-1, *sc.positions.shape)
    sight, capture = visibility_rows(sc, None, len(rows)), capture_rows(sc, None, len(rows))
    # The core itself, which can be stopped within a batch: one of a large team takes minutes.
    kind, defender, _, diverged, _ = game_of(sc).simulate_batch(rows, sight, capture, threads=_threads(), stop=stop)
    return ending_codes(kind, defender, diverged, sc.n).astype(np.int64).reshape(len(y), len(x))


def _pixel(region: Region) -> NDArray[np.float64]:
    """How wide and how high a pixel is."""
    left, right, bottom, top = region
    return np.array([(right - left) / SIDE, (top - bottom) / SIDE])


def _threads() -> int:
    """All cores but one, which is the page's."""
    return max(1, cores() - 1)
