"""The trials of a study as functions of standard normal numbers: samplers by quantiles, games by their scores."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from tadcore._shared.arrays import Floats, Integers
from tadcore.errors import ScenarioError
from tadcore.game.outcome import OutcomeKind
from tadcore.scenario.quantities import core_setups
from tadcore.statistics.outcomes import outcome_names
from tadcore.study.study import Study

from .replications import CRUDE, Search
from .splitting import Climb, StuckError, climb, pilot

_PILOT = 1_000, 5_000  # points above each level in the pilot; more where these get stuck


class NormalInputs:
    """Scores of an event for points of independent standard normal numbers, one row for each game.

    Raises
    ------
    ScenarioError
        A sampler has no quantiles, or what varies makes every trial a game of its own.
    """

    def __init__(self, study: Study, event: str, threads: int | None) -> None:
        self._plan, self._threads = study.plan, threads
        sc = study.scenario
        self._column = outcome_names(sc.n).index(event)
        self._layout = []
        for quantity, sampler in self._plan.varied:
            field = f'vary["{quantity.path}"]'
            if quantity.of_game:
                raise ScenarioError(field, sampler, "left out for rare events: it makes every trial a game of its own")
            coordinates = sampler.coordinates(quantity.components)
            if not sampler.by_points or not coordinates:
                rule = (
                    "a sampler with quantiles for rare events, such as Gaussian, Box or a distribution of scipy.stats"
                )
                raise ScenarioError(field, sampler, rule)
            self._layout.append((sampler, quantity.components, coordinates))
        self.dim: int = sum(coordinates for _, _, coordinates in self._layout)

    def inputs(self, normal: Floats) -> Floats:
        """What the samplers make of the numbers, one column for each varied component."""
        ends = np.cumsum([coordinates for _, _, coordinates in self._layout])
        parts = np.split(normal, ends[:-1], axis=1)
        drawn = [
            sampler.from_normal(np.ascontiguousarray(part), components)
            for part, (sampler, components, _) in zip(parts, self._layout, strict=True)
        ]
        return np.concatenate(drawn, axis=1)

    def __call__(self, normal: Floats) -> tuple[Floats, Integers]:
        """Play the games; their scores, and the intercepting defender of each or -1."""
        inputs = self.inputs(normal)
        try:
            self._plan.check(0, inputs)
        except ScenarioError as error:
            path, rule = error.field.partition(", trial")[0], "also far in the tail of its law: truncate the sampler"
            raise ScenarioError(f"a draw of {path}", error.value, f"{error.rule}, {rule}") from None
        starts, sight, capture = core_setups(self._plan.scenario, self._plan.quantities, inputs)
        kind, defender, _, _, scores = self._plan.game.score_batch(
            starts, sight, capture, threads=self._threads, world=self._plan.world
        )
        who = np.where(kind == OutcomeKind.INTERCEPTED, defender, -1)
        return np.ascontiguousarray(scores[:, self._column]), who.astype(np.int64)


class StartSearch(Search):
    """Rare outcomes of games that their starts alone decide."""

    def __init__(self, study: Study, event: str, error: float, threads: int | None) -> None:
        super().__init__(study.seed, event, error)
        self.score = NormalInputs(study, event, threads)
        self._rng = self.generator(0)

    def crude(self) -> Floats:
        """Scores of games as the study draws them."""
        self._first = self._rng.standard_normal((CRUDE, self.score.dim))
        self._scores, _ = self.score(self._first)
        return self._scores

    def prepare(self) -> Generator[int, None, float]:
        """Levels, moves and lengths of chains."""
        for points in _PILOT:
            try:
                self.ladder = yield from pilot(self.score, self._rng, self._first, self._scores, points)
                break
            except StuckError:  # it lost the way that leads there, which more points may keep
                if points == _PILOT[-1]:
                    raise
        return self.ladder.inflation

    def group(self, numbers: range, count: int) -> Generator[int, None, Climb]:
        """Replications side by side."""
        return climb(self.score, self.score.dim, self.ladder, [self.generator(r) for r in numbers], count)
