"""Rare events: probabilities of outcomes that crude Monte Carlo would need millions or billions of games to see."""

from __future__ import annotations

import numpy as np

from tadcore._shared.arrays import Floats, as_threads
from tadcore._shared.calls import public
from tadcore._shared.progress import bar
from tadcore._shared.text import one_of
from tadcore.errors import ScenarioError
from tadcore.statistics.outcomes import as_level, is_defender, outcome_names
from tadcore.study.study import Study

from .normal import StartSearch
from .path_splitting import PathSearch
from .rarity import RareEvent, summary
from .splitting import Climb


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
    each an unbiased estimate, and their spread says how good the mean is.

    Parameters
    ----------
    study : Study
        What varies, if anything: positions, coordinates and radii, by samplers with quantiles. Its trials and its
        design play no part.
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
        The event is no rarer than 1e-3, as crude runs show it, or nothing leads to it; a sampler has no quantiles; no
        such event. Of a game with failures or disturbances: crude Monte Carlo needs fewer games, as a pilot shows it,
        or the event is a timeout.
    NoEquilibriumError
        The game has no equilibrium on [0, T].

    Notes
    -----
    Of N points the share above each level is counted; `tadcore.analysis.splitting` has the method, in which levels,
    moves and lengths of chains stay as the pilot chose them, so that every replication is unbiased. Where twenty of
    them spread by more than the error that is asked for, more are played, once.

    Where something fails at random or players are disturbed, `tadcore.analysis.path_splitting` splits paths instead:
    games with the lowest scores die, and others are continued in their place from where they passed them, with new
    draws. Any sampler that draws will do then. It pays where the score rises on the way to the event, and not where a
    single failure or the first instants decide; then it refuses, and names what crude Monte Carlo needs.

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
    aim, sure, workers = _fraction("error", error), as_level(level), as_threads(threads)
    if study.termination != "sampled":
        rule = '"sampled" for rare events: scores compare distances at the instants of the grid'
        raise ScenarioError("termination", study.termination, rule)
    search = (PathSearch if sc.is_random else StartSearch)(study, event, aim, workers)
    for _ in bar(search.steps(), f"P({event})", show=progress):
        pass
    estimates = search.estimates
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
        levels=search.ladder.levels if isinstance(search, StartSearch) else np.empty(0),
        rates=np.concatenate([one.rates for one in search.climbs]),
        shares=_shares(search.climbs, estimates, sc.n) if event == "intercepted" else {},
        seed=study.seed,
    )


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
