"""Certified outcome maps: boxes of one player's start from which every game ends alike, proved and not sampled."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tadcore import _core
from tadcore._shared.arrays import Floats, as_index, as_threads
from tadcore._shared.calls import public
from tadcore._shared.progress import bar
from tadcore._shared.text import one_of
from tadcore.errors import ScenarioError
from tadcore.game.compiled import game_of
from tadcore.scenario.model import Scenario
from tadcore.scenario.paths import label
from tadcore.scenarios.given import ScenarioLike, as_scenario

from .boxes import CertifiedMap
from .grids import as_range
from .loading import TITLE

_TOGETHER = 1 << 13  # cells after which the keyboard is read and the progress bar moves
_MOST_CELLS = 10**9
_FINE = 2048  # cells along the longer side by default, at their least


@public
def certified_map(
    sc: ScenarioLike,
    player: str = "attacker",
    *,
    x: tuple[float, float] = (-5.0, 5.0),
    y: tuple[float, float] = (-5.0, 5.0),
    resolution: float | None = None,
    budget: int = 200_000,
    threads: int | None = None,
    progress: bool = False,
) -> CertifiedMap:
    """Prove how the game ends, box by box of one player's start.

    Boxes in which more than one outcome may be possible are cut in four, down to a least size. The answer does not
    depend on the number of threads. The game is the paper's: sampled termination, no failures, disturbances or links.

    Parameters
    ----------
    sc : Scenario, path or name
        The game in the plane, and where the others start.
    player : str
        ``"d1"`` … ``"dn"``, ``"target"`` or ``"attacker"``.
    x, y : (low, high)
        The region of its starts.
    resolution : float, optional
        The least side of a box; a 2048th of the region's longer side by default.
    budget : int
        Boxes to look at, at most; larger ones come first. It bounds the work and the memory: some 300 bytes a box for
        three defenders, more with the square of their number.
    threads : int, optional
        Worker threads; all cores by default.
    progress : bool
        Whether to show a progress bar, where standard error is a terminal.

    Returns
    -------
    CertifiedMap
        The boxes, each with the outcome that is proved, and those that stayed undecided.

    Raises
    ------
    ScenarioError
        No such player or region; the game is in space, or has failures, disturbances or links.
    NoEquilibriumError
        The game has no equilibrium on [0, T].

    Examples
    --------
    >>> import tadcore
    >>> sc = tadcore.scenarios.load("paper-i1-full")
    >>> found = tadcore.certified_map(sc, x=(-3, 3), y=(-3, 3), resolution=0.09)
    >>> found.proved > 0.8
    True
    >>> found.at([[-2.0, 2.0]])
    (array([1], dtype=int8), array([-1], dtype=int32))
    """
    proving = Proving(sc, player, x=x, y=y, resolution=resolution, budget=budget, threads=threads)
    for _ in bar(_advances(proving), f"certified map of {proving.player}", show=progress):
        pass
    return proving.result()


class Proving:
    """A certified map in the making; `certified_map` has the arguments.

    Attributes
    ----------
    scenario : Scenario
        The game.
    player : str
        Whose start varies.
    """

    def __init__(
        self,
        sc: ScenarioLike,
        player: str,
        *,
        x: tuple[float, float],
        y: tuple[float, float],
        resolution: float | None,
        budget: int,
        threads: int | None,
    ) -> None:
        self.scenario = sc = as_scenario(sc)
        _refuse(sc)
        self.player = player = one_of("player", label(player), sc.players)
        low, high = np.transpose([as_range("x", x), as_range("y", y)]).tolist()
        longer = max(high[0] - low[0], high[1] - low[1])
        self._least = longer / _FINE if resolution is None else _positive("resolution", resolution)
        self._threads = as_threads(threads)
        self._cells = _core.Cells(
            game_of(sc),
            sc.positions,
            sc.visibility_radii,
            sc.capture_radii,
            player=sc.players.index(player),
            low=low,
            high=high,
            resolution=self._least,
            budget=as_index("budget", budget, _MOST_CELLS, least=1),
        )

    @property
    def done(self) -> bool:
        """Whether every box is settled."""
        return self._cells.done

    def advance(self, boxes: int, stop: _core.Stop | None = None) -> int:
        """Look at the next boxes, at most so many; how many it were."""
        return self._cells.advance(boxes, threads=self._threads, stop=stop)

    def settled(self) -> tuple[Floats, NDArray[np.int8], NDArray[np.int32]]:
        """The boxes that are settled by now: corners (L, 4), kind, below 0 where nothing is proved, and defender."""
        corners, _, kind, defender = self._cells.leaves()
        return corners, kind, defender

    def result(self) -> CertifiedMap:
        """The map, once every box is settled."""
        return _result(self.scenario, self.player, self._cells.leaves(), self._least, self._cells.counts)


def _advances(proving: Proving) -> Iterator[int]:
    """Go through the boxes, some thousands at once."""
    while not proving.done:
        yield from range(proving.advance(_TOGETHER))


def _result(
    sc: Scenario, player: str, leaves: tuple[NDArray[Any], ...], resolution: float, counts: tuple[int, int]
) -> CertifiedMap:
    import xarray as xr

    from tadcore.scenario.provenance import provenance

    order = np.lexsort((leaves[0][:, 0], leaves[0][:, 1], leaves[1]))
    corners, level, kind, defender = (array[order] for array in leaves)
    names = ("x_low", "y_low", "x_high", "y_high")
    words = {"low": "least", "high": "largest"}
    data: dict[str, Any] = {
        name: ("box", corners[:, i], {"long_name": f"{words[name[2:]]} initial {name[0]} of {player}", "units": "1"})
        for i, name in enumerate(names)
    }
    data["level"] = ("box", level.astype(np.int8), {"long_name": "how often it was cut from a first box"})
    codes = "outcome: 0 timeout, 1 captured, 2 intercepted, -1 not proved"
    data["kind"] = ("box", np.maximum(kind, -1), {"long_name": codes})
    data["defender"] = ("box", defender, {"long_name": "intercepting defender, 0-based; -1 where none"})
    reasons = "reason: 0 proved, 1 undecided at the least size, 2 past the budget, 3 every start diverges"
    data["reason"] = ("box", np.maximum(-kind, 0).astype(np.int8), {"long_name": reasons})
    attrs = {"title": f"{TITLE} {player}", "player": player, "resolution": resolution}
    attrs |= {"boxes_looked_at": float(counts[0]), "steps": float(counts[1]), **provenance(sc)}
    return CertifiedMap(sc, player, xr.Dataset(data, attrs=attrs))


def _refuse(sc: Scenario) -> None:
    """Refuse what the proof does not cover, by name."""
    if sc.dim != 2:
        raise ScenarioError(
            "scenario", "a game in space", "one in the plane for a certified map: cells are boxes there"
        )
    if sc.world is not None:
        rule = "one without failures, disturbances and links for a certified map: the proof covers sight alone"
        raise ScenarioError("scenario", "a game with failures, disturbances or links", rule)


def _positive(field: str, value: Any) -> float:
    number = (
        value if isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool) else None
    )
    if number is None or not (number > 0 and math.isfinite(number)):
        raise ScenarioError(field, value, "a positive finite number")
    return float(number)
