"""The part of a record before its game diverges, which is all that a figure can show on one scale."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import Floats, Numbers
from tadcore.scenario.model import Scenario

from .changes import Interval, NetworkChange, intervals_of
from .course import Course
from .divergence import Divergence
from .outcome import Outcome
from .passes import Pass
from .recorded import Recorded


@dataclass(frozen=True, eq=False)
class Sound:
    """A record up to the instant of its divergence, which is its last row; made by `until_divergence`."""

    scenario: Scenario
    outcome: Outcome
    diverged: Divergence | None
    times: Floats
    position: Floats
    control: Floats
    adjacency: NDArray[np.bool_]
    gains: Numbers
    theta: Floats
    theta_terms: Floats
    passes: tuple[Pass, ...]
    seen: NDArray[np.bool_]
    course: Course | None
    network_changes: tuple[NetworkChange, ...]

    def intervals(self) -> tuple[Interval, ...]:
        """The stretches of time with one network."""
        return intervals_of(self.network_changes, self.outcome.time)


def until_divergence(run: Recorded) -> Recorded:
    """The record itself where the game does not diverge, and otherwise its rows up to that instant."""
    if run.diverged is None:
        return run
    end = min(run.diverged.time, float(run.times[-1]))
    rows = slice(int(np.searchsorted(run.times, end)) + 1)
    return Sound(
        scenario=run.scenario,
        outcome=replace(run.outcome, kind="timeout", defender=None, time=end),
        diverged=run.diverged,
        times=run.times[rows],
        position=run.position[rows],
        control=run.control[rows],
        adjacency=run.adjacency[rows],
        gains=run.gains[rows],
        theta=run.theta[rows],
        theta_terms=run.theta_terms[rows],
        passes=run.passes,
        seen=run.seen[rows],
        course=None if run.course is None else run.course.until(rows),
        network_changes=tuple(change for change in run.network_changes if change.time < end or not change.time),
    )
