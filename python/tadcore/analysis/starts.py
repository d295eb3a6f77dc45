"""How much of an outcome's variance is the start's, and how much that of failures and disturbances."""

from __future__ import annotations

import numpy as np

from tadcore._shared.text import one_of
from tadcore.errors import ScenarioError
from tadcore.simulation.batch import simulate_batch
from tadcore.statistics.outcomes import indicators, outcome_names
from tadcore.statistics.starts import StartShare, start_share_of
from tadcore.study.study import Study

from .replays import starts_of

_AGAIN = 2**48
"""The second trial of start i is this plus i, beyond the trials of any study."""


def start_share(
    study: Study, *, outcome: str = "intercepted", level: float = 0.95, threads: int | None = None
) -> StartShare:
    """Play every start of a study twice, with failures and disturbances drawn apart, and split the variance.

    Parameters
    ----------
    study : Study
        What varies, and how many starts; independent draws (``design="random"``) of a game that is random besides.
    outcome : str
        ``"timeout"``, ``"captured"``, ``"intercepted"``, or ``"d1"`` … ``"dn"``.
    level : float
        Confidence level.
    threads : int, optional
        Worker threads; all cores by default.

    Returns
    -------
    StartShare
        The share of the variance that is the start's, with an interval, and how many trials a start deserves.

    Raises
    ------
    ScenarioError
        Nothing varies, or nothing is random besides; the design is another; no such outcome.

    Examples
    --------
    >>> import tadcore
    >>> from tadcore.sampling import Disk
    >>> sc = tadcore.scenarios.load("paper-i1").replace({"sensing.mean_time_to_failure": 0.5})
    >>> study = tadcore.Study(sc, {"attacker.position": Disk([-2, 2], 1.0)}, trials=200, seed=7)
    >>> found = tadcore.analysis.start_share(study)
    >>> found.starts, found.low <= found.share <= found.high
    (200, True)
    """
    if not isinstance(study, Study):
        raise ScenarioError("study", study, "a tadcore.Study")
    if not study.vary or not study.scenario.is_random:
        rule = "one that varies its starts, of a game with failures or disturbances: there is nothing to split"
        raise ScenarioError("study", study, rule)
    if study.design != "random":
        raise ScenarioError("study", f"design={study.design!r}", 'one with design="random": the starts are independent')
    names = outcome_names(study.scenario.n)
    row = names.index(one_of("outcome", outcome, names))
    sc, rows = starts_of(study, None)
    ended = []
    for first in (0, _AGAIN):
        batch = simulate_batch(
            sc,
            rows.positions,
            rows.visibility_radii,
            rows.capture_radii,
            threads=threads,
            termination=study.termination,
            seed=study.seed,
            first_trial=first,
        )
        ended.append(indicators(batch.kind, batch.defender, sc.n, batch.diverged)[row])
    times = np.bincount(ended[0].astype(int) + ended[1], minlength=3).tolist()
    return start_share_of(times[2], times[1], times[0], outcome=outcome, level=level)
