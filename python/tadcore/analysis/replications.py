"""What every estimate of a rare event goes through: crude runs, a pilot, replications, more if they spread too much."""

from __future__ import annotations

import abc
import math
from collections.abc import Generator, Iterator
from typing import TypeVar

import numpy as np

from tadcore._shared.arrays import Floats
from tadcore.errors import ScenarioError
from tadcore.statistics.intervals import ends

from .rarity import summary
from .splitting import Climb, StuckError

Result = TypeVar("Result")

TOGETHER = 20
"""Replications at least, and those that are played side by side at most."""
RAREST_CRUDE = 1e-3
"""Above this probability crude Monte Carlo is better."""
CRUDE = 10_000
"""Games that are played crudely, first of all."""
AIM = 0.85
"""Of the error that is asked for what the pilot aims at."""
_FEWEST, _MOST = 200, 20_000  # points of a replication
_MOST_REPLICATIONS = 2_000
_STREAM = 2**63  # a purpose that no quantity of a study has


class Search(abc.ABC):
    """Crude runs, a pilot, and replications until the error is reached."""

    def __init__(self, seed: int, event: str, error: float) -> None:
        self.seed, self.event, self.error = seed, event, error
        self.runs = 0
        self.climbs: list[Climb] = []

    @abc.abstractmethod
    def crude(self) -> Floats:
        """Scores of games as the study draws them."""

    @abc.abstractmethod
    def prepare(self) -> Generator[int, None, float]:
        """The pilot: the squared relative error of a replication, times its points."""

    @abc.abstractmethod
    def group(self, numbers: range, count: int) -> Generator[int, None, Climb]:
        """The replications of these numbers, from 1, with so many points each."""

    @property
    def estimates(self) -> Floats:
        """One for each replication."""
        return np.concatenate([one.estimates for one in self.climbs])

    def together(self, count: int) -> int:
        """How many replications of so many points are played side by side."""
        return TOGETHER

    def steps(self) -> Iterator[int]:
        """Everything, a move at a time."""
        error = self.error
        scores = self.crude()
        self.runs += len(scores)
        yield len(scores)
        self._refuse_what_is_not_rare(scores)
        try:
            points = (yield from self._counted(self.prepare())) / (AIM * error) ** 2
        except StuckError as stuck:
            raise ScenarioError("event", self.event, _unreached(stuck)) from None
        count = min(max(math.ceil(points / TOGETHER), _FEWEST), _MOST)
        wanted = min(max(TOGETHER, math.ceil(points / count)), _MOST_REPLICATIONS)
        yield from self._replicate(count, wanted)
        # A second stage, of a size that the first decides.
        _, _, reached = summary(self.estimates, 0.95)
        if error < reached < math.inf:
            yield from self._replicate(count, min(math.ceil(wanted * (reached / error) ** 2), _MOST_REPLICATIONS))

    def _replicate(self, count: int, wanted: int) -> Iterator[int]:
        """Play replications until there are so many."""
        done, size = sum(len(one.estimates) for one in self.climbs), self.together(count)
        for first in range(done, wanted, size):
            numbers = range(1 + first, 1 + min(first + size, wanted))
            self.climbs.append((yield from self._counted(self.group(numbers, count))))

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

    def generator(self, number: int) -> np.random.Generator:
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
