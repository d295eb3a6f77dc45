"""Outcome maps: how the game ends, for every place where one player could have started.

All starts of a map share the game, its radii and the other players' places, so a map is one large batch. It is played
in blocks of rows, and beyond the map itself needs memory for one block only.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.calls import public
from tadcore._shared.html import block
from tadcore._shared.progress import bar
from tadcore._shared.text import one_of
from tadcore.game.outcome import OutcomeKind, kind_counts
from tadcore.scenario.model import Scenario
from tadcore.scenario.paths import label
from tadcore.scenarios.given import ScenarioLike, as_scenario
from tadcore.simulation.batch import simulate_batch

from .grids import BLOCK, Grid
from .replays import refuse_random
from .saving import save

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False, repr=False)
class OutcomeMap:
    """How the game ends over a grid of one player's start; made by `outcome_map`.

    Attributes
    ----------
    scenario : Scenario
        The game, with everyone else's place.
    player : str
        Whose start varies.
    dataset : xarray.Dataset
        ``kind`` (int8), ``defender`` (int32), ``time`` (float64) and ``diverged`` (bool) over (y, x), coded as in
        `tadcore.Batch`.
    """

    scenario: Scenario
    player: str
    dataset: xarray.Dataset

    def counts(self) -> dict[str, int]:
        """How many places of the grid lead to each kind of outcome; those that diverge, if any, are counted apart."""
        return kind_counts(self.dataset["kind"].values, self.dataset["diverged"].values)

    def plot(self, ax: Axes | None = None, **options: Any) -> Axes:
        """Draw the map; see `tadcore.plotting.outcome_map`."""
        from tadcore.plotting import outcome_map as draw

        return draw(self, ax, **options)

    def save(self, path: str | os.PathLike[str], **options: Any) -> Path:
        """Write the data (``.nc``, netCDF 3) or the figure (``.png``, ``.pdf``, ``.svg``), whole or not at all.

        Options go to `plot`, where a figure is written.

        Raises
        ------
        ScenarioError
            The file name ends in something else.
        """
        return save(self, path, options)

    def _repr_html_(self) -> str:
        from tadcore.plotting.tools.inline import inline

        return block(repr(self), inline(self.plot, repr(self)))

    def __repr__(self) -> str:
        rows, columns = self.dataset["kind"].shape
        counts = ", ".join(f"{count:,} {name}" for name, count in self.counts().items())
        return f"OutcomeMap(start of {self.player} on {columns} × {rows} places: {counts})"


@public
def outcome_map(
    sc: ScenarioLike,
    player: str = "attacker",
    *,
    x: tuple[float, float, int] = (-5.0, 5.0, 201),
    y: tuple[float, float, int] = (-5.0, 5.0, 201),
    z: float | None = None,
    threads: int | None = None,
    progress: bool = False,
) -> OutcomeMap:
    """Play the game from every place of a grid of one player's start.

    Parameters
    ----------
    sc : Scenario, path or name
        The game, and where the others start.
    player : str
        ``"d1"`` … ``"dn"``, ``"target"`` or ``"attacker"``.
    x, y : (low, high, count)
        The grid: ``count`` places from ``low`` to ``high``, both included.
    z : float, optional
        In space, the height of the plane of the grid; the player's own by default.
    threads : int, optional
        Worker threads; all cores by default.
    progress : bool
        Whether to show a progress bar, where standard error is a terminal.

    Returns
    -------
    OutcomeMap
        The outcome and its time at every place.

    Raises
    ------
    ScenarioError
        No such player, or no such grid; or the game is one of chance, with failures or disturbances.
    NoEquilibriumError
        The game has no equilibrium on [0, T].

    Examples
    --------
    >>> import tadcore
    >>> found = tadcore.outcome_map(tadcore.scenarios.load("paper-i1"), x=(-2, 2, 3), y=(2, 2, 1))
    >>> found.dataset["time"].values[0, 0]
    np.float64(1.395)
    """
    import xarray as xr

    from tadcore.scenario.provenance import provenance

    sc = as_scenario(sc)
    refuse_random(sc, "an outcome map", "tadcore.probability_map plays many trials from every start")
    player = one_of("player", label(player), sc.players)
    grid, who = Grid.of(sc, player, x, y, z), sc.players.index(player)
    kind, defender = np.empty(grid.shape, dtype=np.int8), np.empty(grid.shape, dtype=np.int32)
    time, diverged = np.empty(grid.shape), np.empty(grid.shape, dtype=np.bool_)
    flat: list[NDArray[Any]] = [array.reshape(-1) for array in (kind, defender, time, diverged)]
    for start in bar(range(0, kind.size, BLOCK), f"map of {player}", show=progress):
        block = slice(start, start + BLOCK)
        places = grid.places(block)
        positions = np.repeat(sc.positions[np.newaxis], len(places), axis=0)
        positions[:, who] = places
        batch = simulate_batch(sc, positions, threads=threads)
        for whole, part in zip(flat, (batch.kind, batch.defender, batch.time, batch.diverged), strict=True):
            whole[block] = part
    codes = ", ".join(f"{code.value} {code.name.lower()}" for code in OutcomeKind)
    return OutcomeMap(
        scenario=sc,
        player=player,
        dataset=xr.Dataset(
            {
                "kind": (("y", "x"), kind, {"long_name": f"outcome: {codes}"}),
                "defender": (("y", "x"), defender, {"long_name": "intercepting defender, 0-based; -1 where none"}),
                "time": (("y", "x"), time, {"long_name": "instant of the end", "units": "1"}),
                "diverged": (("y", "x"), diverged, {"long_name": "whether the game diverged, before its end or at it"}),
            },
            coords=grid.coords(),
            attrs={"title": f"Outcome by the start of {player}", **grid.attrs(), **provenance(sc)},
        ),
    )
