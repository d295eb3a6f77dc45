"""Rare events: probabilities of outcomes that crude Monte Carlo would need millions or billions of games to see."""

from __future__ import annotations

import math
from collections.abc import Generator, Iterator
from typing import TypeVar

import numpy as np

from tadcore._shared.arrays import Floats, as_index
from tadcore._shared.calls import public
from tadcore._shared.progress import bar
from tadcore._shared.text import one_of
from tadcore.errors import ScenarioError
from tadcore.statistics.intervals import ends
from tadcore.statistics.outcomes import as_level, is_defender, outcome_names
from tadcore.study.study import Study

from .normal import NormalInputs
from .rarity import RareEvent, summary
from .splitting import Climb, Ladder, StuckError, climb, pilot

Result = TypeVar("Result")

REPLICATIONS = 20
"""Replications at least."""
RAREST_CRUDE = 1e-3
"""Above this probability crude Monte Carlo is better."""
_CRUDE = 10_000  # games played crudely, first of all
_PILOT = 1_000  # points above each level in the pilot
_FEWEST, _MOST = 200, 20_000  # points of a replication
_AIM = 0.85  # of the error that is asked for
_MOST_REPLICATIONS = 2_000
_STREAM = 2**63  # a purpose that no quantity of a study has


@public
def rare(
    study: Study,
    event: str = "captured",
    *,
    error: float = 0.1,
    level: float = 0.95,
    threads: int | None = None,
    progress: bool = False,
) -> RareEvent:
    """Estimate the probability of a rare outcome of a study, by multilevel splitting.

    Games are ranked by how far they were from the event (`Batch.scores`); a pilot finds levels of that score, each
    reached by a tenth of the games that reach the one before, and independent replications then multiply these shares:
    an unbiased estimate, and a spread that says how good it is.

    Parameters
    ----------
    study : Study
        What varies: positions, coordinates and radii, by samplers with quantiles. Its trials and its design play no
        part.
    event : str
        ``"captured"``, ``"intercepted"``, ``"d1"`` … ``"dn"`` or ``"timeout"``. Games that diverge are in none of them.
    error : float
        Relative standard error to aim at: 0.1 for 10 %.
    level : float
        Confidence level of the interval.
    threads : int, optional
        Worker threads; all cores by default. The answer does not depend on them.
    progress : bool
        Whether to show a progress bar, where standard error is a terminal.

    Returns
    -------
    RareEvent
        ``probability``, ``interval``, ``runs`` and what else is to be known.

    Raises
    ------
    ScenarioError
        The event is no rarer than 1e-3, as crude runs show it, or nothing leads to it; a sampler has no quantiles; the
        game has failures or disturbances; no such event.
    NoEquilibriumError
        The game has no equilibrium on [0, T].

    Notes
    -----
    Of N points the share above each level is counted; `tadcore.analysis.splitting` has the method, in which levels,
    moves and lengths of chains stay as the pilot chose them, so that every replication is unbiased. Where twenty of
    them spread by more than the error that is asked for, more are played, once.

    Scores jump where the visibility network changes. No estimate is biased by that, but where an event comes in
    separate ways, replications that miss one of them are too low, and few are much too high: they differ by more than a
    normal law would let them, and the interval is not to be trusted. `RareEvent.replications`, ``rates`` and ``shares``
    show it.

    Examples
    --------
    >>> import tadcore
    >>> from tadcore.sampling import Gaussian
    >>> sc = tadcore.scenarios.load("paper-i1-full").replace({"step": 0.02})
    >>> starts = zip(sc.players, sc.positions)
    >>> study = tadcore.Study(sc, {f"{p}.position": Gaussian(at, 0.03) for p, at in starts}, trials=1, seed=7)
    >>> found = tadcore.rare(study, "intercepted", error=0.2)
    >>> 1e-5 < found.probability < 4e-5, found.runs < 100_000
    (True, True)
    """
    if not isinstance(study, Study):
        raise ScenarioError("study", study, "a tadcore.Study")
    sc = study.scenario
    event = one_of("event", event, outcome_names(sc.n))
    aim, sure = _fraction("error", error), as_level(level)
    workers = None if threads is None else as_index("threads", threads, 2**16, least=1)
    if sc.is_random:
        rule = "one without failures and disturbances for rare events: there the start alone decides"
        raise ScenarioError("scenario", "a random game", rule)
    if study.termination != "sampled":
        rule = '"sampled" for rare events: scores compare distances at the instants of the grid'
        raise ScenarioError("termination", study.termination, rule)
    search = _Search(NormalInputs(study, event, workers), study.seed, event)
    for _ in bar(search.steps(aim), f"P({event})", show=progress):
        pass
    found = search.climbs
    estimates = np.concatenate([one.estimates for one in found])
    probability, interval, reached = summary(estimates, sure)
    if probability == 0.0:
        raise ScenarioError("event", event, "one that is reached: no replication came to it, though the pilot did")
    return RareEvent(
        scenario=sc,
        event=event,
        probability=probability,
        interval=interval,
        level=sure,
        error=reached,
        runs=search.runs,
        replications=estimates,
        levels=search.ladder.levels,
        rates=np.concatenate([one.rates for one in found]),
        shares=_shares(found, estimates, sc.n) if event == "intercepted" else {},
        seed=study.seed,
    )


class _Search:
    """The pilot, and replications until the error is reached."""

    ladder: Ladder

    def __init__(self, score: NormalInputs, seed: int, event: str) -> None:
        self.score, self.seed, self.event = score, seed, event
        self.runs = 0
        self.climbs: list[Climb] = []

    def steps(self, error: float) -> Iterator[int]:
        """Everything, a move of all chains at a time."""
        rng = self._generator(0)
        u = rng.standard_normal((_CRUDE, self.score.dim))
        scores, _ = self.score(u)
        self.runs += len(u)
        yield len(u)
        self._refuse_what_is_not_rare(scores)
        try:
            self.ladder = yield from self._counted(pilot(self.score, rng, u, scores, _PILOT))
        except StuckError as stuck:
            raise ScenarioError("event", self.event, _unreached(stuck)) from None
        points = self.ladder.inflation / (_AIM * error) ** 2
        count = min(max(math.ceil(points / REPLICATIONS), _FEWEST), _MOST)
        wanted = min(max(REPLICATIONS, math.ceil(points / count)), _MOST_REPLICATIONS)
        yield from self._replicate(count, wanted)
        # A second stage, of a size that the first decides.
        _, _, reached = summary(np.concatenate([one.estimates for one in self.climbs]), 0.95)
        if error < reached < math.inf:
            yield from self._replicate(count, min(math.ceil(wanted * (reached / error) ** 2), _MOST_REPLICATIONS))

    def _replicate(self, count: int, wanted: int) -> Iterator[int]:
        """Play replications until there are so many, some side by side."""
        done = sum(len(one.rates) for one in self.climbs)
        for first in range(done, wanted, REPLICATIONS):
            rngs = [self._generator(1 + r) for r in range(first, min(first + REPLICATIONS, wanted))]
            one = yield from self._counted(climb(self.score, self.score.dim, self.ladder, rngs, count))
            self.climbs.append(one)

    def _counted(self, moves: Generator[int, None, Result]) -> Generator[int, None, Result]:
        """The same, with the games counted."""
        while True:
            try:
                played = next(moves)
            except StopIteration as stop:
                result: Result = stop.value
                return result
            self.runs += played
            yield played

    def _generator(self, number: int) -> np.random.Generator:
        """The stream of the pilot, 0, or of a replication."""
        words = {"key": [self.seed, number], "counter": [0, 0, 0, _STREAM]}
        return np.random.Generator(np.random.Philox(**{k: np.array(v, dtype=np.uint64) for k, v in words.items()}))

    def _refuse_what_is_not_rare(self, scores: Floats) -> None:
        count = int(np.count_nonzero(scores >= 0.0))
        if count <= RAREST_CRUDE * len(scores):
            return
        low, high = (float(end[0]) for end in ends(np.array([count]), len(scores), 0.05, "exact"))
        rule = (
            f"rarer than {RAREST_CRUDE:g}: {count:,} of {len(scores):,} crude runs ended so, P = "
            f"{count / len(scores):.3g} [{low:.3g}, {high:.3g}], where crude Monte Carlo is better: call "
            "Study.run(), and probabilities() of its result"
        )
        raise ScenarioError("event", self.event, rule)


def _unreached(stuck: StuckError) -> str:
    if stuck.tied:
        return f"one that scores lead to: of a share {stuck.above:.1e} of all games, all are equally far from it"
    return f"one that can come: P is below {stuck.above:.1e}, if the event is possible at all"


def _shares(climbs: list[Climb], estimates: Floats, n: int) -> dict[str, float]:
    """Of the probability of an interception the share of each defender."""
    ended = [codes for one in climbs for codes in one.ended]
    total = np.zeros(n)
    for codes, estimate in zip(ended, estimates, strict=True):
        if len(codes):
            total += estimate * np.bincount(codes, minlength=n) / len(codes)
    names = [name for name in outcome_names(n) if is_defender(name)]
    return dict(zip(names, (total / total.sum()).tolist(), strict=True))


def _fraction(field: str, value: object) -> float:
    if isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool) and 0.0 < value <= 0.5:
        return float(value)
    raise ScenarioError(field, value, "a relative standard error in (0, 0.5], such as 0.1 for 10 %")
