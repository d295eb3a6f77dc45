r"""The probability of an outcome over the start of one player.

Whatever else a study varies stays varied, and every start of the player is played with the same trials: common random
numbers. So P, as estimated from M fixed trials, is a function of the start without noise, piecewise constant;
differences between starts are better known than the probabilities themselves.

**Pointwise** intervals are Clopper and Pearson's; **bands** hold at all places of the grid at once, for one outcome:
Clopper and Pearson's at 1 - (1 - level) / places (Bonferroni). Of a study that a rule was asked to stop, both are
confidence sequences instead.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tadcore._shared.calls import public
from tadcore._shared.html import block
from tadcore._shared.progress import bar
from tadcore._shared.shares import estimate
from tadcore.errors import ScenarioError
from tadcore.scenario.model import Scenario
from tadcore.statistics import TrialOutcomes, outcome_names
from tadcore.statistics.confidence import Confidence
from tadcore.study.study import Study

from .grids import BLOCK, Grid
from .replays import Placed

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False, repr=False)
class ProbabilityMap:
    """Outcome probabilities over a grid of one player's start; made by `probability_map`.

    Attributes
    ----------
    scenario : Scenario
        The game, and where everyone is who does not vary.
    player : str
        Whose start runs over the grid.
    trials : int
        M, the same trials at every place.
    level : float
        Confidence level.
    dataset : xarray.Dataset
        ``count``, ``estimate``, ``low``, ``high`` (at each place by itself), ``band_low`` and ``band_high`` (at all
        places at once, for one outcome), over (outcome, y, x). The last outcome is ``"diverged"`` where some trials
        did; they are in no other.
    """

    scenario: Scenario
    player: str
    trials: int
    level: float
    dataset: xarray.Dataset

    def best(self, outcome: str = "intercepted") -> dict[str, float]:
        """The place of the grid where an outcome came most often, with its band.

        The band holds at all places at once, so it holds at a place that was chosen for its share.

        Parameters
        ----------
        outcome : str
            ``"timeout"``, ``"captured"``, ``"intercepted"``, ``"d1"`` … ``"dn"``, or, where some did, ``"diverged"``.

        Returns
        -------
        dict of str to float
            ``x``, ``y``, ``estimate``, ``low`` and ``high``.

        Raises
        ------
        ScenarioError
            No such outcome.
        """
        if outcome not in self.dataset["outcome"].values:
            raise ScenarioError("outcome", outcome, f"one of {', '.join(map(str, self.dataset['outcome'].values))}")
        here = self.dataset.sel(outcome=outcome)
        row, column = np.unravel_index(int(here["estimate"].values.argmax()), here["estimate"].shape)
        place = here.isel(y=int(row), x=int(column))
        found = {"x": place["x"], "y": place["y"], "estimate": place["estimate"]}
        found |= {"low": place["band_low"], "high": place["band_high"]}
        return {name: float(value) for name, value in found.items()}

    def plot(self, ax: Axes | None = None, **options: Any) -> Axes:
        """Draw the map; see `tadcore.plotting.probability_map`."""
        from tadcore.plotting import probability_map as draw

        return draw(self, ax, **options)

    def _repr_html_(self) -> str:
        from tadcore.plotting.tools.inline import inline

        return block(repr(self), inline(self.plot, repr(self)))

    def __repr__(self) -> str:
        _, rows, columns = self.dataset["estimate"].shape
        best = self.best()
        share, interval = estimate(best["estimate"], best["low"], best["high"])
        rule = self.dataset.attrs.get("rule")
        by = f"; {rule}" if rule else ""
        return (
            f"ProbabilityMap(start of {self.player} on {columns} × {rows} places, {self.trials:,} trials each: "
            f"P(intercepted) up to {share} {interval} at ({best['x']:g}, {best['y']:g}){by})"
        )


@public
def probability_map(
    source: Study | TrialOutcomes,
    player: str,
    *,
    x: tuple[float, float, int],
    y: tuple[float, float, int],
    z: float | None = None,
    level: float | None = None,
    threads: int | None = None,
    progress: bool = False,
) -> ProbabilityMap:
    """Play the trials of a study from every place of a grid of one player's start.

    Parameters
    ----------
    source : Study or StudyResult
        What varies, and the trials; played or not. Where it varies the start of this player, the grid takes its place.
        A game ends as in the study, at an instant or at the crossing itself.
    player : str
        ``"d1"`` … ``"dn"``, ``"target"`` or ``"attacker"``.
    x, y : (low, high, count)
        The grid: ``count`` places from ``low`` to ``high``, both included.
    z : float, optional
        In space, the height of the plane of the grid; the player's own by default.
    level : float, optional
        Confidence level of intervals and bands; 0.95, or that of the rule that was asked when to stop the study.
    threads : int, optional
        Worker threads; all cores by default.
    progress : bool
        Whether to show a progress bar, where standard error is a terminal.

    Returns
    -------
    ProbabilityMap
        Probabilities with intervals at every place.

    Raises
    ------
    ScenarioError
        No such player, or no such grid.
    NoEquilibriumError
        The game has no equilibrium on [0, T].

    Examples
    --------
    >>> import tadcore
    >>> from tadcore.sampling import Disk
    >>> sc = tadcore.scenarios.load("paper-i1")
    >>> study = tadcore.Study(sc, {"attacker.position": Disk([-2, 2], 1.0)}, trials=100, seed=7)
    >>> found = tadcore.probability_map(study, "d3", x=(-1, 1, 3), y=(0, 2, 3))
    >>> found.dataset.sizes["outcome"], found.trials
    (6, 100)
    """
    import xarray as xr

    from tadcore.scenario.provenance import provenance

    sure = Confidence.of(source, level)
    games = Placed(source, player, threads)
    sc = games.sc
    grid = Grid.of(sc, games.player, x, y, z)
    shape, total = grid.shape, math.prod(grid.shape)
    together = max(1, BLOCK // games.trials)
    count = np.empty((len(outcome_names(sc.n, diverged=True)), total), dtype=np.int64)
    for first in bar(range(0, total, together), f"probability map of {games.player}", show=progress):
        block = slice(first, first + together)
        count[:, block] = games.events(grid.places(block)).sum(axis=2)
    names = outcome_names(sc.n, diverged=bool(count[-1].any()))
    count = count[: len(names)]
    values = {"count": count, "estimate": count / games.trials}
    values |= dict(zip(("low", "high"), sure.ends(count, games.trials, "exact"), strict=True))
    values |= dict(zip(("band_low", "band_high"), sure.band(count, games.trials, total), strict=True))
    attrs = {"title": f"Outcome probabilities by the start of {games.player}", "trials": games.trials}
    return ProbabilityMap(
        scenario=sc,
        player=games.player,
        trials=games.trials,
        level=sure.level,
        dataset=xr.Dataset(
            {name: (("outcome", "y", "x"), array.reshape((-1, *shape))) for name, array in values.items()},
            coords={"outcome": list(names), **grid.coords()},
            attrs={**attrs, **sure.attrs(), **grid.attrs(), **provenance(sc)},
        ),
    )
