"""Where to place a player: the start at which an outcome is most probable."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from tadcore._shared.arrays import Floats, as_index
from tadcore._shared.calls import public
from tadcore._shared.shares import estimate
from tadcore._shared.text import one_of
from tadcore.errors import ScenarioError
from tadcore.scenario.model import Scenario
from tadcore.statistics import outcome_names
from tadcore.statistics.outcomes import as_level
from tadcore.study.study import Study

from .grids import as_range
from .replays import Placed
from .searches import fresh_study, judged, search


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
        What varies, how many trials each place is played with, and when a game ends (`Study`'s ``termination``).
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
    confidence, most = as_level(level), as_index("evaluations", evaluations, 10**7, least=20)
    again = fresh_study(study, seed, progress=progress)
    games, fresh = Placed(study, player, threads), Placed(again, player, threads)
    names = outcome_names(games.sc.n, diverged=True)
    which = names.index(one_of("outcome", outcome, names))

    def share(place: Floats) -> float:
        return float(games.events(place[np.newaxis])[which].mean())

    bounds = _bounds(games.sc, x, y, z)
    place, searched, played = search(share, bounds, most, f"best start of {games.player}", progress=progress)
    events = fresh.events(np.array([place, fresh.own]))[which]
    return BestStart(
        player=games.player,
        outcome=names[which],
        position=tuple(map(float, place)),
        **asdict(judged(events[0], events[1], confidence)),
        searched=searched,
        evaluations=played,
        trials=fresh.trials,
        level=confidence,
    )


def _bounds(sc: Scenario, x: Any, y: Any, z: Any) -> list[tuple[float, float]]:
    """Where the player may start, by axis."""
    given = {"x": x, "y": y} | ({} if z is None else {"z": z})
    if len(given) != sc.dim:
        rule = "a range (low, high) of heights" if sc.dim == 3 else "left out: this game is in the plane"
        raise ScenarioError("z", z, rule)
    return [as_range(axis, ends) for axis, ends in given.items()]
