"""Two studies on common random numbers: what the change did, trial by trial.

`tadcore.statistics.differences` has the intervals and the tests.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from tadcore._shared.arrays import Floats, Integers
from tadcore._shared.html import as_html
from tadcore._shared.shares import estimate, percent
from tadcore._shared.text import as_text
from tadcore.errors import ScenarioError
from tadcore.game.outcome import OutcomeKind

from .differences import Method, difference_interval, discordant, fair_coins, mcnemar
from .outcomes import (
    KINDS,
    TrialOutcomes,
    as_level,
    as_outcomes,
    diverged_of,
    indicators,
    outcome_names,
)
from .stopping import level_of, stopping_of

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False, repr=False)
class Comparison:
    """How outcomes differ between two studies of the same trials; made by `compare`.

    Attributes
    ----------
    names : tuple of str
        ``"timeout"``, ``"captured"``, ``"intercepted"``, then ``"d1"`` … ``"dn"``; last ``"diverged"``, where some
        trials did in A or in B.
    difference, low, high : ndarray, shape (3 + n,) or (4 + n,)
        P_A - P_B and the ends of its interval.
    only_a, only_b : ndarray of int, shape (3 + n,)
        Trials that end so in A but not in B, and the reverse.
    p_value : ndarray, shape (3 + n,)
        Of the exact McNemar test of no difference; with ``"sequence"`` of a test that holds whenever one stops.
    transitions : ndarray of int, shape (3, 3) or (4, 4)
        Trials by their kind in A (row) and in B (column), in the order of `OutcomeKind`; last those that diverged,
        where there are any.
    flipped : ndarray of int
        The trials whose kind differs, or that diverged in one of the two.
    redirected : ndarray of int
        The trials that are intercepted in both, by different defenders.
    trials : int
        M.
    level : float
        Confidence level of each interval by itself.
    method : {"score", "sequence"}
        For a number of trials that was fixed beforehand, or for one that a rule decided.
    rule : str
        The rule that was asked when to stop; empty where there was none.
    """

    names: tuple[str, ...]
    difference: Floats
    low: Floats
    high: Floats
    only_a: Integers
    only_b: Integers
    p_value: Floats
    transitions: Integers
    flipped: Integers
    redirected: Integers
    trials: int
    level: float
    method: Method = "score"
    rule: str = ""

    def to_pandas(self) -> pd.DataFrame:
        """A table with one row for each outcome."""
        import pandas as pd

        columns = {name: getattr(self, name) for name in ("difference", "low", "high", "only_a", "only_b", "p_value")}
        return pd.DataFrame(columns, index=pd.Index(self.names, name="outcome"))

    def _table(self) -> tuple[str, list[str], list[list[str]]]:
        rows = [
            [name, f"{a:,}", f"{b:,}", shown[0], _p_text(p), shown[1]]
            for name, a, b, shown, p in zip(
                self.names, self.only_a, self.only_b, self._texts(), self.p_value, strict=True
            )
        ]
        head = ["outcome", "only A", "only B", "P(A) - P(B)", "p-value", f"{percent(self.level)} ({self.method})"]
        by = f", {self.rule}" if self.rule else ""
        return f"{self.trials:,} trials{by}, {len(self.flipped):,} flipped", head, rows

    def __repr__(self) -> str:
        return as_text(*self._table())

    def _repr_html_(self) -> str:
        return as_html(*self._table())

    def _texts(self) -> list[tuple[str, str]]:
        columns = zip(self.difference, self.low, self.high, strict=True)
        return [estimate(d, low, high, sign=True) for d, low, high in columns]


def _p_text(p: float) -> str:
    return f"{p:.2g}" if p > 0.0 else "< 1e-300"  # smaller than any double


def compare(a: TrialOutcomes, b: TrialOutcomes, *, level: float | None = None) -> Comparison:
    """Compare two studies of the same trials.

    Where a rule was asked when to stop one of them, intervals and p-values are those that hold whenever one stops.

    Parameters
    ----------
    a, b : StudyResult
        Two studies with the same seed, number of trials and varied inputs, of scenarios that may differ in everything
        else but the number of defenders.
    level : float, optional
        Confidence level of each interval by itself; 0.95, or that of the rule that was asked when to stop.

    Returns
    -------
    Comparison
        Paired differences A - B, transitions, and the trials that flipped.

    Raises
    ------
    ScenarioError
        The studies do not share their random numbers.
    """
    if a.scenario.n != b.scenario.n:
        raise ScenarioError("b.scenario", f"{b.scenario.n} defenders", f"a game of {a.scenario.n}, as a's is")
    if a.seed != b.seed:
        raise ScenarioError("b.seed", b.seed, f"{a.seed}, as a's is: the comparison needs common random numbers")
    if a.trials != b.trials:
        raise ScenarioError("b.trials", b.trials, f"{a.trials}, as a's are: trials are compared one by one")
    if set(a.inputs) != set(b.inputs):
        wanted = ", ".join(sorted(a.inputs)) or "nothing"
        raise ScenarioError("b.vary", ", ".join(sorted(b.inputs)) or "nothing", f"what a varies: {wanted}")
    for name in a.inputs:
        unlike = np.flatnonzero(~np.equal(a.inputs[name], b.inputs[name]))
        if unlike.size:
            i = int(unlike[0])
            rule = f"{float(a.inputs[name][i])!r}, as a's is: the comparison needs common random numbers"
            raise ScenarioError(f"b.inputs[{name!r}][{i}]", float(b.inputs[name][i]), rule)
    rules = {f"{name} {stopping}": stopping for name, one in (("A", a), ("B", b)) if (stopping := stopping_of(one))}
    found = paired(
        a.kind,
        a.defender,
        b.kind,
        b.defender,
        a.scenario.n,
        diverged_a=diverged_of(a),
        diverged_b=diverged_of(b),
        level=level_of(next(iter(rules.values()), None), level),
        method="sequence" if rules else "score",
    )
    return replace(found, rule=", ".join(rules))


def paired(
    kind_a: ArrayLike,
    defender_a: ArrayLike,
    kind_b: ArrayLike,
    defender_b: ArrayLike,
    n: int,
    *,
    diverged_a: ArrayLike | None = None,
    diverged_b: ArrayLike | None = None,
    level: float = 0.95,
    method: Method = "score",
) -> Comparison:
    """Compare the outcomes of the same M trials under two conditions, as `compare` does.

    Parameters
    ----------
    kind_a, defender_a, kind_b, defender_b : array_like of int, shape (M,)
        Outcomes under A and under B, as in `tadcore.Batch`.
    n : int
        Number of defenders.
    diverged_a, diverged_b : array_like of bool, shape (M,), optional
        Which trials diverged; these are counted apart.
    level : float
        Confidence level of each interval by itself.
    method : {"score", "sequence"}
        Tango's interval and McNemar's test for a number of trials that was fixed beforehand, or a confidence sequence
        and a test that hold whenever one stops.

    Returns
    -------
    Comparison
        Paired differences A - B.

    Raises
    ------
    ScenarioError
        The arrays do not fit together.
    """
    as_level(level)
    lost = diverged_a is not None or diverged_b is not None
    none_a, none_b = (np.zeros(np.size(kind), dtype=np.bool_) if lost else None for kind in (kind_a, kind_b))
    events_a = indicators(kind_a, defender_a, n, none_a if diverged_a is None else diverged_a)
    events_b = indicators(kind_b, defender_b, n, none_b if diverged_b is None else diverged_b)
    code_a, who_a = as_outcomes(kind_a, defender_a, n, diverged_a)
    code_b, who_b = as_outcomes(kind_b, defender_b, n, diverged_b)
    if code_a.shape != code_b.shape:
        raise ScenarioError("kind_b", f"{len(code_b)} trials", f"{len(code_a)} trials, as in A")
    only_a, only_b = discordant(events_a, events_b)
    trials = len(code_a)
    low, high = difference_interval(only_a, only_b, trials, level=level, method=method)
    test = fair_coins if method == "sequence" else mcnemar
    p_values = [test(int(x), int(y)) for x, y in zip(only_a, only_b, strict=True)]
    transitions = np.zeros((len(KINDS) + lost, len(KINDS) + lost), dtype=np.int64)
    np.add.at(transitions, (code_a, code_b), 1)
    both = (code_a == OutcomeKind.INTERCEPTED) & (code_b == OutcomeKind.INTERCEPTED)
    return Comparison(
        names=outcome_names(n, diverged=lost),
        difference=(only_a - only_b) / trials,
        low=low,
        high=high,
        only_a=only_a,
        only_b=only_b,
        p_value=np.array(p_values, dtype=np.float64),
        transitions=transitions,
        flipped=np.flatnonzero(code_a != code_b),
        redirected=np.flatnonzero(both & (who_a != who_b)),
        trials=trials,
        level=float(level),
        method=method,
    )
