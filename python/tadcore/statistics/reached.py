"""By when a share of all games has ended in an outcome: a quantile of its time, with the interval of the band."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tadcore._shared.arrays import Floats
from tadcore._shared.shares import percent
from tadcore.errors import ScenarioError


@dataclass(frozen=True, repr=False)
class ReachedTime:
    """The instant by which a share of all trials has ended in an outcome, or that there is none.

    Attributes
    ----------
    outcome : str
        The event.
    at_least : float
        The share of all trials.
    time : float or None
        The first instant of the grid at which the estimate reaches it; None where it does not until T.
    earliest, latest : float or None
        What the true instant lies between: the first at which the upper end of the band reaches the share, and the
        first at which the lower end does; None where that does not until T.
    level : float
        Confidence level of the band. It holds at all times at once, so every interval read from it holds as well,
        those of other shares included.
    """

    outcome: str
    at_least: float
    time: float | None
    earliest: float | None
    latest: float | None
    level: float

    def __repr__(self) -> str:
        head = f"{100.0 * self.at_least:.6g} % {self.outcome}"
        if self.earliest is None:
            return f"{head}: surely not until T, {percent(self.level)}"
        latest = "not until T" if self.latest is None else f"{self.latest:g}"
        when = "not until T" if self.time is None else f"by t = {self.time:g}"
        return f"{head} {when} [{self.earliest:g}, {latest}], {percent(self.level)}"


def reached(
    times: Floats, curves: tuple[Floats, Floats, Floats], outcome: str, at_least: float, level: float
) -> ReachedTime:
    """Read the estimate, the lower and the upper end of a band, each over the same instants."""
    if isinstance(at_least, bool) or not (isinstance(at_least, int | float | np.floating) and 0.0 < at_least < 1.0):
        raise ScenarioError("at_least", at_least, "a share in (0, 1)")

    def first(curve: Floats) -> float | None:
        there = np.flatnonzero(curve >= at_least)
        return float(times[there[0]]) if there.size else None

    estimate, low, high = map(first, curves)
    return ReachedTime(outcome, float(at_least), estimate, earliest=high, latest=low, level=level)
