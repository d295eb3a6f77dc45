r"""Where to place a player: the probability of an outcome over its start, and the start at which it is largest.

Whatever else a study varies stays varied, and every start of the player is played with the same trials: common random
numbers. So P, as estimated from M fixed trials, is a function of the start without noise, piecewise constant, which an
optimiser can search; differences between starts are better known than the probabilities themselves.

- **Pointwise** intervals are Clopper and Pearson's; **bands** hold at all places of the grid at once, for one outcome:
  Clopper and Pearson's at 1 - (1 - level) / places (Bonferroni). Of a study that a rule was asked to stop, both are
  confidence sequences instead.
- The start that an optimiser returns was chosen for the trials that it was chosen with, so its share there is too
  high. `best_start` therefore plays it again with fresh trials, and reports those.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tadcore._shared.arrays import Floats, as_index
from tadcore._shared.calls import public
from tadcore._shared.progress import bar
from tadcore._shared.shares import estimate
from tadcore.errors import ScenarioError
from tadcore.scenario.model import Scenario
from tadcore.statistics import TrialOutcomes, difference_interval, outcome_names, proportion_interval
from tadcore.statistics.intervals import Method, band, ends
from tadcore.statistics.outcomes import as_level
from tadcore.statistics.stopping import level_of, stopping_of
from tadcore.study.study import Study

from .maps import grid_of, height
from .replays import Placed

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

_BLOCK = 1 << 16
"""Games played at once."""


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

    stopping = stopping_of(source)
    confidence = level_of(stopping, level)
    games = Placed(source, player, threads)
    sc, (columns, rows) = games.sc, grid_of(x, y)
    up = height(sc, games.player, z)
    places = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    if up is not None:
        places = np.column_stack([places, np.full(len(places), up)])
    together = max(1, _BLOCK // games.trials)
    count = np.empty((len(outcome_names(sc.n, diverged=True)), len(places)), dtype=np.int64)
    for first in bar(range(0, len(places), together), f"probability map of {games.player}", show=progress):
        block = slice(first, first + together)
        count[:, block] = games.events(places[block]).sum(axis=2)
    names = outcome_names(sc.n, diverged=bool(count[-1].any()))
    count = count[: len(names)]
    method: Method = "exact" if stopping is None else "sequence"
    low, high = ends(count, games.trials, 1.0 - confidence, method)
    band_low, band_high = band(count, games.trials, 1.0 - confidence, len(places), method)
    shape = (len(names), len(rows), len(columns))
    values = {"count": count, "estimate": count / games.trials, "low": low, "high": high}
    values |= {"band_low": band_low, "band_high": band_high}
    return ProbabilityMap(
        scenario=sc,
        player=games.player,
        trials=games.trials,
        level=confidence,
        dataset=xr.Dataset(
            {name: (("outcome", "y", "x"), array.reshape(shape)) for name, array in values.items()},
            coords={
                "outcome": list(names),
                "x": ("x", columns, {"long_name": f"initial x of {games.player}", "units": "1"}),
                "y": ("y", rows, {"long_name": f"initial y of {games.player}", "units": "1"}),
            },
            attrs={
                "title": f"Outcome probabilities by the start of {games.player}",
                "player": games.player,
                "trials": games.trials,
                "level": confidence,
                **({} if stopping is None else {"rule": str(stopping)}),
                **({} if up is None else {"z": up}),
                **provenance(sc),
            },
        ),
    )


@dataclass(frozen=True, eq=False, repr=False)
class BestStart:
    """The start of one player at which an outcome is most probable; made by `best_start`.

    Attributes
    ----------
    player, outcome : str
        Whose start, and what was made probable.
    position : tuple of float
        Where.
    estimate, low, high : float
        P(outcome) there, from fresh trials that the search has not seen, with Clopper and Pearson's interval.
    own : float
        P(outcome) where the scenario has the player, from the same fresh trials.
    gain, gain_low, gain_high : float
        The difference of the two, with Tango's interval for paired trials.
    searched : float
        The share at ``position`` among the trials of the search; it was chosen for them, so it tends to be too high.
    evaluations : int
        Places that the search played.
    trials : int
        M, trials of the search at each place, and fresh trials.
    level : float
        Confidence level.
    """

    player: str
    outcome: str
    position: tuple[float, ...]
    estimate: float
    low: float
    high: float
    own: float
    gain: float
    gain_low: float
    gain_high: float
    searched: float
    evaluations: int
    trials: int
    level: float

    def __repr__(self) -> str:
        place = ", ".join(f"{value:.4g}" for value in self.position)
        share = " ".join(estimate(self.estimate, self.low, self.high))
        gain = " ".join(estimate(self.gain, self.gain_low, self.gain_high, sign=True))
        return (
            f"BestStart({self.player} at ({place}): P({self.outcome}) = {share} on {self.trials:,} fresh trials; "
            f"{gain} beside its own start; "
            f"{self.evaluations:,} places searched)"
        )


@public
def best_start(
    study: Study,
    player: str,
    *,
    x: tuple[float, float],
    y: tuple[float, float],
    z: tuple[float, float] | None = None,
    outcome: str = "intercepted",
    evaluations: int = 600,
    level: float = 0.95,
    seed: int | None = None,
    threads: int | None = None,
    progress: bool = False,
) -> BestStart:
    """Search for the start of one player at which an outcome is most probable.

    The search divides the ranges into ever smaller rectangles (`scipy.optimize.direct`, locally biased), on common
    random numbers: all places are played with the trials of the study. It is a search, not a proof: another place may
    be better.

    Parameters
    ----------
    study : Study
        What varies, and how many trials each place is played with.
    player : str
        ``"d1"`` … ``"dn"``, ``"target"`` or ``"attacker"``.
    x, y, z : (low, high)
        Where the player may start; ``z`` in space only.
    outcome : str
        ``"timeout"``, ``"captured"``, ``"intercepted"``, or ``"d1"`` … ``"dn"``.
    evaluations : int
        About how many places to play, at least 20.
    level : float
        Confidence level of the intervals.
    seed : int, optional
        Of the fresh trials; the study's own plus one by default.
    threads : int, optional
        Worker threads; all cores by default.
    progress : bool
        Whether to show a progress bar, where standard error is a terminal.

    Returns
    -------
    BestStart
        The place, with intervals from fresh trials.

    Raises
    ------
    ScenarioError
        No such player, range or outcome; the fresh seed is the study's own.
    NoEquilibriumError
        The game has no equilibrium on [0, T].

    Examples
    --------
    >>> import tadcore
    >>> from tadcore.sampling import Disk
    >>> sc = tadcore.scenarios.load("paper-i1")
    >>> study = tadcore.Study(sc, {"attacker.position": Disk([-2, 2], 1.0)}, trials=100, seed=7)
    >>> found = tadcore.best_start(study, "d3", x=(-2, 2), y=(-2, 2), evaluations=60)
    >>> found.low <= found.estimate <= found.high
    True
    """
    from scipy.optimize import direct

    if not isinstance(study, Study):
        raise ScenarioError("study", study, "a tadcore.Study: fresh trials are drawn from it")
    confidence, most = as_level(level), as_index("evaluations", evaluations, 10**7, least=20)
    fresh_seed = (study.seed + 1) % 2**64 if seed is None else as_index("seed", seed, 2**64 - 1)
    if fresh_seed == study.seed:
        raise ScenarioError("seed", seed, "another than the study's own: the fresh trials must be new")
    again = study.replace(seed=fresh_seed)
    for one in (study, again):
        one.check(progress=progress)
    games = Placed(study, player, threads)
    names = outcome_names(games.sc.n, diverged=True)
    which = names.index(as_outcome(outcome, games.sc.n))
    bounds = _bounds(games.sc, x, y, z)
    steps = iter(bar(range(most), f"best start of {games.player}", show=progress))
    played = 0

    def loss(place: Floats) -> float:
        nonlocal played
        next(steps, None)
        played += 1
        return -float(games.events(place[np.newaxis])[which].mean())

    found = direct(loss, bounds, maxfun=most, maxiter=most, vol_tol=0.0, len_tol=0.0)
    for _ in steps:
        pass
    fresh = Placed(again, player, threads)
    events = fresh.events(np.array([found.x, fresh.own]))[which]
    hits, own = int(events[0].sum()), int(events[1].sum())
    low, high = proportion_interval(hits, fresh.trials, level=confidence, method="exact")
    better, worse = (int(np.count_nonzero(events[i] & ~events[1 - i])) for i in (0, 1))
    gain_low, gain_high = difference_interval(better, worse, fresh.trials, level=confidence)
    return BestStart(
        player=games.player,
        outcome=names[which],
        position=tuple(map(float, found.x)),
        estimate=hits / fresh.trials,
        low=float(low),
        high=float(high),
        own=own / fresh.trials,
        gain=(hits - own) / fresh.trials,
        gain_low=float(gain_low),
        gain_high=float(gain_high),
        searched=-float(found.fun),
        evaluations=played,
        trials=fresh.trials,
        level=confidence,
    )


def as_outcome(name: str, n: int) -> str:
    """The name of an outcome of a game of n defenders."""
    names = outcome_names(n, diverged=True)
    if name not in names:
        raise ScenarioError("outcome", name, f"one of {', '.join(names)}")
    return name


def _bounds(sc: Scenario, x: Any, y: Any, z: Any) -> list[tuple[float, float]]:
    """Where the player may start, by axis."""
    given = {"x": x, "y": y} | ({} if z is None else {"z": z})
    if len(given) != sc.dim:
        rule = "a range (low, high) of heights" if sc.dim == 3 else "left out: this game is in the plane"
        raise ScenarioError("z", z, rule)
    return [_range(axis, ends) for axis, ends in given.items()]


def _range(field: str, given: Sequence[Any]) -> tuple[float, float]:
    try:
        low, high = map(float, given)
    except (TypeError, ValueError):
        raise ScenarioError(field, given, "(low, high)") from None
    if not (np.isfinite([low, high]).all() and low < high):
        raise ScenarioError(field, given, "(low, high), finite, with low < high")
    return low, high
