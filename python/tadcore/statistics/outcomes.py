"""What every statistic starts from: the outcomes of M trials, checked once, as counts and as indicators.

An *outcome* here is an event that a trial ends in: ``"timeout"``, ``"captured"`` and ``"intercepted"``, which exclude
one another and together are certain, then ``"d1"`` … ``"dn"``, interception by that defender, which together make up
``"intercepted"``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tadcore._shared.arrays import Floats, Integers, as_index, refuse_where
from tadcore.errors import ScenarioError
from tadcore.game.outcome import OutcomeKind
from tadcore.scenario.model import Scenario

MOST_TRIALS = 2**40
"""Counts up to here are whole in double precision, and so are the differences of their logarithms."""

KINDS = tuple(kind.name.lower() for kind in OutcomeKind)
"""Names of the three kinds, at the place of their codes."""


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


def outcome_names(n: int) -> tuple[str, ...]:
    """The outcomes of a game, in the order of every table.

    Parameters
    ----------
    n : int
        Number of defenders.

    Returns
    -------
    tuple of str
        ``"timeout"``, ``"captured"``, ``"intercepted"``, then ``"d1"`` … ``"dn"``.
    """
    return (*KINDS, *(f"d{i}" for i in range(1, n + 1)))


def as_outcomes(kind: ArrayLike, defender: ArrayLike, n: int) -> tuple[NDArray[np.int8], NDArray[np.int32]]:
    """Two arrays of one length, at least one, that agree on who intercepted; raises `ScenarioError`."""
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
    return codes.astype(np.int8), who.astype(np.int32)


def indicators(kind: ArrayLike, defender: ArrayLike, n: int) -> NDArray[np.bool_]:
    """Which trials ended in each outcome, shape (3 + n, M), rows as in `outcome_names`."""
    codes, who = as_outcomes(kind, defender, n)
    rows = [codes == kind for kind in OutcomeKind]
    return np.array([*rows, *(who == i for i in range(n))])


def outcome_counts(kind: ArrayLike, defender: ArrayLike, n: int) -> dict[str, int]:
    """How many trials ended in each outcome, by name.

    Parameters
    ----------
    kind, defender : array_like of int, shape (M,)
        As in `tadcore.Batch`.
    n : int
        Number of defenders.

    Returns
    -------
    dict of str to int
        ``"timeout"``, ``"captured"``, ``"intercepted"``, then ``"d1"`` … ``"dn"``.

    Raises
    ------
    ScenarioError
        The arrays do not fit together, or hold no trial.
    """
    codes, who = as_outcomes(kind, defender, n)
    counts = [*np.bincount(codes, minlength=len(KINDS)), *np.bincount(who[who >= 0], minlength=n)]
    return dict(zip(outcome_names(n), map(int, counts), strict=True))


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
