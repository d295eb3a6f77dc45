"""How to share a budget of visibility: the radii of given sum with which an outcome is most probable."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import Floats, as_amount, as_index
from tadcore._shared.calls import public
from tadcore._shared.shares import estimate
from tadcore._shared.text import one_of
from tadcore.errors import ScenarioError
from tadcore.simulation.batch import simulate_batch
from tadcore.statistics import outcome_names
from tadcore.statistics.outcomes import as_level, indicators
from tadcore.study.study import Study

from .replays import ending_of, starts_of
from .searches import fresh_study, judged, search

_ROOM = 1e-6  # of its capture radius, that a visibility radius is at least larger


@dataclass(frozen=True, eq=False, repr=False)
class BestRadii:
    """The visibility radii of given sum with which an outcome is most probable; made by `best_radii`.

    Attributes
    ----------
    outcome : str
        What was made probable.
    total : float
        The sum of the radii.
    radii : dict of str to float
        The radius of every defender.
    estimate, low, high : float
        P(outcome) with them, from fresh trials that the search has not seen, with Clopper and Pearson's interval.
    own : float
        P(outcome) with equal radii of the same sum, from the same fresh trials.
    gain, gain_low, gain_high : float
        The difference of the two, with Tango's interval for paired trials.
    searched : float
        The share among the trials of the search; the radii were chosen for them, so it tends to be too high.
    evaluations : int
        How many shares of the budget the search played.
    trials : int
        M, trials of the search for each of them, and fresh trials.
    level : float
        Confidence level.
    """

    outcome: str
    total: float
    radii: dict[str, float]
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
        shared = ", ".join(f"{player} {radius:.4g}" for player, radius in self.radii.items())
        share = " ".join(estimate(self.estimate, self.low, self.high))
        gain = " ".join(estimate(self.gain, self.gain_low, self.gain_high, sign=True))
        return (
            f"BestRadii({shared}, {self.total:g} in all: P({self.outcome}) = {share} on {self.trials:,} fresh trials; "
            f"{gain} beside equal radii; {self.evaluations:,} shares searched)"
        )


@public
def best_radii(
    study: Study,
    total: float,
    *,
    outcome: str = "intercepted",
    evaluations: int = 600,
    level: float = 0.95,
    seed: int | None = None,
    threads: int | None = None,
    progress: bool = False,
) -> BestRadii:
    r"""Search for visibility radii of given sum, :math:`\sum_i \zeta_{d_i}`, with which an outcome is most probable.

    Every defender gets at least a radius just above its capture radius; what is left is shared. The search is over the
    ways to share it, on common random numbers: all are played with the trials of the study, whatever radii it has or
    varies. It is a search, not a proof: other radii may be better.

    Parameters
    ----------
    study : Study
        What varies besides, and how many trials each share is played with; of a team of at least two defenders.
    total : float
        The sum of the defenders' visibility radii, more than that of their capture radii.
    outcome : str
        ``"timeout"``, ``"captured"``, ``"intercepted"``, or ``"d1"`` … ``"dn"``.
    evaluations : int
        About how many shares to play, at least 20.
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
    BestRadii
        The radii, with intervals from fresh trials.

    Raises
    ------
    ScenarioError
        No such outcome; a team of one; a sum that is too small; the fresh seed is the study's own.
    NoEquilibriumError
        The game has no equilibrium on [0, T].

    Examples
    --------
    >>> import tadcore
    >>> from tadcore.sampling import Disk
    >>> sc = tadcore.scenarios.load("paper-i1")
    >>> study = tadcore.Study(sc, {"attacker.position": Disk([-2, 2], 1.0)}, trials=100, seed=7)
    >>> found = tadcore.analysis.best_radii(study, 6.0, evaluations=60)
    >>> round(sum(found.radii.values()), 9)
    6.0
    """
    confidence, most = as_level(level), as_index("evaluations", evaluations, 10**7, least=20)
    again = fresh_study(study, seed, progress=progress)
    if study.scenario.n < 2:
        raise ScenarioError("study", "a team of one defender", "of a team of two or more: there is nothing to share")
    games, fresh = _Shared(study, threads), _Shared(again, threads)
    least = np.maximum(games.least, fresh.least)
    room = as_amount("total", total) - float(least.sum())
    if not room > 0.0:
        raise ScenarioError("total", total, f"more than the sum of the defenders' capture radii ({least.sum():.6g})")
    names = outcome_names(games.sc.n, diverged=True)
    which = names.index(one_of("outcome", outcome, names))

    def share(cuts: Floats) -> float:
        return float(games.events(least + room * _parts(cuts))[which].mean())

    bounds = [(0.0, 1.0)] * (games.sc.n - 1)
    cuts, searched, played = search(share, bounds, most, "best radii", progress=progress)
    radii, equal = least + room * _parts(cuts), np.full(games.sc.n, total / games.sc.n)
    if np.any(equal < least):
        equal = least + room / games.sc.n
    found, own = (fresh.events(given)[which] for given in (radii, equal))
    return BestRadii(
        outcome=names[which],
        total=float(total),
        radii=dict(zip(games.sc.players, map(float, radii), strict=False)),
        **asdict(judged(found, own, confidence)),
        searched=searched,
        evaluations=played,
        trials=fresh.trials,
        level=confidence,
    )


def _parts(cuts: Floats) -> Floats:
    """Shares of one, from n - 1 numbers in [0, 1]: a box in which equal volumes are equal volumes of shares."""
    rest, parts = 1.0, []
    for at, cut in enumerate(cuts):
        parts.append(rest * (1.0 - (1.0 - cut) ** (1.0 / (len(cuts) - at))))
        rest -= parts[-1]
    return np.array([*parts, max(rest, 0.0)])


class _Shared:
    """The trials of a study, played with any visibility radii of the defenders."""

    def __init__(self, study: Study, threads: int | None) -> None:
        self.sc, self.rows = starts_of(study, None)
        self.trials = len(self.rows)
        self._options: dict[str, Any] = {"threads": threads, "seed": study.seed, "termination": ending_of(study)}
        capture = np.atleast_2d(self.rows.capture_radii)[:, : self.sc.n]
        self.least = capture.max(axis=0) * (1.0 + _ROOM)

    def events(self, radii: Floats) -> NDArray[np.bool_]:
        """Which trials ended in each outcome, last those that diverged: (4 + n, M)."""
        sight = np.array(self.rows.visibility_radii)
        sight[..., : self.sc.n] = radii
        batch = simulate_batch(self.sc, self.rows.positions, sight, self.rows.capture_radii, **self._options)
        return indicators(batch.kind, batch.defender, self.sc.n, batch.diverged)
