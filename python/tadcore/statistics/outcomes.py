"""What every statistic starts from: the outcomes of M trials, checked once, as counts and as indicators.

An *outcome* here is an event that a trial ends in: ``"timeout"``, ``"captured"`` and ``"intercepted"``, which exclude
one another and together are certain, then ``"d1"`` … ``"dn"``, interception by that defender, which together make up
``"intercepted"``. Where some trials diverged (`tadcore.game.Divergence`), a last outcome ``"diverged"`` has all of
them, however they then ended, and no other outcome has any: the four are certain together. Where weights, horizon or
step vary from trial to trial, ``"no_equilibrium"`` has those whose game has none.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tadcore._shared.arrays import Floats, Integers, as_index, refuse_where
from tadcore.errors import ScenarioError
from tadcore.game.outcome import DIVERGED, NO_EQUILIBRIUM, OutcomeKind
from tadcore.scenario.model import Scenario

MOST_TRIALS = 2**40
"""Counts up to here are whole in double precision, and so are the differences of their logarithms."""

KINDS = tuple(kind.name.lower() for kind in OutcomeKind)
"""Names of the three kinds, at the place of their codes."""

_LOST = len(KINDS)  # stands for the kind of a trial that diverged


class TrialOutcomes(Protocol):
    """What a statistic needs to know of a finished study; `tadcore.study.StudyResult` is one.

    ``kind``, ``defender`` and ``time`` have one entry for each trial, as in `tadcore.Batch`; ``inputs`` maps the name
    of each varied number, such as ``"attacker.position.x"``, to its value in every trial.
    """

    @property
    def scenario(self) -> Scenario:
        """What was played, before anything was varied."""

    @property
    def trials(self) -> int:
        """How many trials there are."""

    @property
    def seed(self) -> int:
        """What the draws were keyed with."""

    @property
    def kind(self) -> NDArray[np.int8]:
        """Codes of `OutcomeKind`."""

    @property
    def defender(self) -> NDArray[np.int32]:
        """The intercepting defender, 0-based; -1 where none intercepted."""

    @property
    def time(self) -> Floats:
        """Termination times."""

    @property
    def inputs(self) -> Mapping[str, Floats]:
        """The varied numbers."""


def outcome_names(n: int, *, diverged: bool = False) -> tuple[str, ...]:
    """The outcomes of a game, in the order of every table.

    Parameters
    ----------
    n : int
        Number of defenders.
    diverged : bool
        Whether some trials diverged.

    Returns
    -------
    tuple of str
        ``"timeout"``, ``"captured"``, ``"intercepted"``, then ``"d1"`` … ``"dn"``, and ``"diverged"`` where some did.
    """
    return (*KINDS, *(f"d{i}" for i in range(1, n + 1)), *([DIVERGED] if diverged else []))


def is_defender(name: str) -> bool:
    """Whether an outcome, or a player, is that of one defender."""
    return name[:1] == "d" and name[1:].isdigit()


def excluding(names: Sequence[str]) -> list[int]:
    """The places of the outcomes that exclude one another and together are certain, defenders left out."""
    return [i for i, name in enumerate(names) if name in (*KINDS, DIVERGED, NO_EQUILIBRIUM)]


def diverged_of(result: Any) -> NDArray[np.bool_] | None:
    """Which trials of a study diverged; None where none did, or where the result does not know of divergence."""
    tally = getattr(result, "tally", None)
    if tally is not None and not tally.diverged.any():
        return None  # without a look at the trials, which may be many, or not kept
    lost = getattr(result, "diverged", None)
    return None if lost is None or not np.any(lost) else np.asarray(lost, dtype=np.bool_)


def as_outcomes(
    kind: ArrayLike, defender: ArrayLike, n: int, diverged: ArrayLike | None = None
) -> tuple[NDArray[np.int8], NDArray[np.int32]]:
    """Two arrays of one length, at least one, that agree on who intercepted; raises `ScenarioError`.

    A trial that diverged has the code 3 and no defender, however it ended.
    """
    as_index("n", n, 2**16, least=1)
    codes, who = _integers("kind", kind), _integers("defender", defender)
    if codes.ndim != 1 or codes.shape != who.shape:
        raise ScenarioError("kind", f"shapes {codes.shape} and {who.shape}", "one code and one defender for each trial")
    if codes.size == 0:
        raise ScenarioError("kind", "no trials", "the outcomes of at least one trial")
    refuse_where("kind", codes, (codes < 0) | (codes >= len(KINDS)), "a code of OutcomeKind: 0, 1 or 2")
    intercepted = codes == OutcomeKind.INTERCEPTED
    wrong = np.where(intercepted, (who < 0) | (who >= n), who != -1)
    refuse_where("defender", who, wrong, f"in [0, {n - 1}] where a defender intercepted, -1 elsewhere")
    if diverged is not None:
        lost = np.asarray(diverged)
        if lost.dtype != np.bool_ or lost.shape != codes.shape:
            raise ScenarioError("diverged", diverged, "a bool for each trial")
        codes, who = np.where(lost, _LOST, codes), np.where(lost, -1, who)
    return codes.astype(np.int8), who.astype(np.int32)


def indicators(kind: ArrayLike, defender: ArrayLike, n: int, diverged: ArrayLike | None = None) -> NDArray[np.bool_]:
    """Which trials ended in each outcome, rows as in `outcome_names`, shape (3 + n, M).

    Where ``diverged`` is given there is a last row for it, and the others are without the trials that diverged.
    """
    codes, who = as_outcomes(kind, defender, n, diverged)
    rows = [*(codes == kind for kind in OutcomeKind), *(who == i for i in range(n))]
    return np.array(rows if diverged is None else [*rows, codes == _LOST])


def outcome_counts(kind: ArrayLike, defender: ArrayLike, n: int, diverged: ArrayLike | None = None) -> dict[str, int]:
    """How many trials ended in each outcome, by name.

    Parameters
    ----------
    kind, defender : array_like of int, shape (M,)
        As in `tadcore.Batch`.
    n : int
        Number of defenders.
    diverged : array_like of bool, shape (M,), optional
        Which trials diverged.

    Returns
    -------
    dict of str to int
        ``"timeout"``, ``"captured"``, ``"intercepted"``, then ``"d1"`` … ``"dn"``, and ``"diverged"`` where some did.

    Raises
    ------
    ScenarioError
        The arrays do not fit together, or hold no trial.
    """
    codes, who = as_outcomes(kind, defender, n, diverged)
    kinds = np.bincount(codes, minlength=_LOST + 1)
    lost = bool(kinds[_LOST])
    counts = [*kinds[:_LOST], *np.bincount(who[who >= 0], minlength=n), *([kinds[_LOST]] if lost else [])]
    return dict(zip(outcome_names(n, diverged=lost), map(int, counts), strict=True))


def as_level(level: Any) -> float:
    """A confidence level: a number strictly between 0 and 1."""
    number = isinstance(level, int | float | np.floating) and not isinstance(level, bool)
    if number and 0.0 < level < 1.0 and 0.0 < float(level) < 1.0:  # a longer double may round to 1
        return float(level)
    raise ScenarioError("level", level, "a confidence level in (0, 1), such as 0.95")


def as_counts(field: str, values: ArrayLike) -> Integers:
    """An array of whole numbers; bools, floats and ragged lists are refused."""
    array = _integers(field, values, "whole numbers")
    refuse_where(field, array, array > MOST_TRIALS, f"at most {MOST_TRIALS}")
    return array


def _integers(field: str, values: ArrayLike, rule: str = "an array of integers") -> Integers:
    try:
        array = np.asarray(values)
    except (ValueError, TypeError) as error:
        raise ScenarioError(field, values, rule) from error
    if array.dtype.kind not in "iu" and array.size:
        raise ScenarioError(field, values, rule)
    return array.astype(np.int64)
