"""Path splitting: rare outcomes of games with random failures and disturbances, by paths that share a past and part.

Adaptive multilevel splitting (Cérou and Guyader, Stochastic Analysis and Applications 25, 2007). Of N games the quarter
with the lowest scores dies, everyone whose score ties with the last of them included. Each is replaced by a copy of a
survivor, up to the instant at which that one's score first passed the level; from there it draws anew. With K_q of N
replaced in round q, and a share f of N in the event when the level would be 0 or more, P = f · Π (1 - K_q/N); where all
die P = 0. That is unbiased for any score and any N (Bréhier, Gazeau, Goudenège, Lelièvre and Rousset, Annals of Applied
Probability 26, 2016): ties die together, and the score of a path up to an instant is known at that instant.

A path is a start and stretches (k, trial): from step k on it has the draws of that trial (`_core.Game.score_courses`).
It is played again from its start, bitwise, so nothing of it is kept but these numbers and the course of its score.
"""

from __future__ import annotations

import math
from collections.abc import Generator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import Floats, Integers
from tadcore.errors import ScenarioError
from tadcore.sampling.base import LOWEST, Block
from tadcore.scenario.quantities import core_setups
from tadcore.statistics.outcomes import outcome_names
from tadcore.study.study import Study

from .replications import AIM, CRUDE, TOGETHER, Search
from .splitting import Climb, StuckError

DYING = 0.25
"""Share of the games that die in a round, but for ties."""
_PILOTS = 20  # replications of the pilot
_PILOT = 200, 800  # paths of each; more where most die out
_RAREST = 1e-30
_BYTES = 1 << 28  # of the courses that are kept at once
_TRIALS, _APART = 2**55, 2**40  # trials of the first replication, beyond those of any study; and from one to the next
_PILOT_NUMBERS = 2**14  # and beyond the numbers of replications

Stretches = list[tuple[int, int]]


class _Paths:
    """The games of one replication."""

    def __init__(self, number: int, count: int, rng: np.random.Generator, inputs: Floats) -> None:
        self.rng, self.inputs, self.next = rng, inputs, _TRIALS + number * _APART
        self.stretches: list[Stretches] = [[(0, trial)] for trial in self.trials(count)]
        self.course: Floats = np.empty((0, 0))
        self.who: Integers = np.empty(0, dtype=np.int64)
        self.estimate, self.over = 1.0, False

    def trials(self, count: int) -> range:
        """Numbers of trials that nothing else has."""
        first, self.next = self.next, self.next + count
        return range(first, self.next)

    def round(self) -> NDArray[np.intp]:
        """Kill what is lowest, and give each the start and the past of a survivor; empty where this is over."""
        final = self.course[:, -1]
        count = len(final)
        level = float(np.partition(final, round(DYING * count) - 1)[round(DYING * count) - 1])
        if level >= 0.0:
            self.estimate *= float((final >= 0.0).mean())
            self.over = True
            return np.empty(0, dtype=np.intp)
        dead, living = np.flatnonzero(final <= level), np.flatnonzero(final > level)
        self.estimate *= len(living) / count
        if not len(living):
            self.over = True
            return dead[:0]
        parents = living[self.rng.integers(0, len(living), size=len(dead))]
        passed, last = np.argmax(self.course[parents] > level, axis=1).tolist(), self.course.shape[1] - 1
        for row, parent, k, trial in zip(dead.tolist(), parents.tolist(), passed, self.trials(len(dead)), strict=True):
            past = [one for one in self.stretches[parent] if one[0] < k] or self.stretches[parent][:1]
            self.stretches[row] = [*past, (k, trial)] if k < last else past  # nothing is drawn after the last instant
        self.inputs[dead] = self.inputs[parents]
        return dead

    @property
    def ended(self) -> Integers:
        """Codes of those that came to the event."""
        return self.who[self.course[:, -1] >= 0.0]


class PathSearch(Search):
    """Rare outcomes of games that are random besides their starts."""

    def __init__(self, study: Study, event: str, error: float, threads: int | None) -> None:
        super().__init__(study.seed, event, error)
        self._plan, self._threads = study.plan, threads
        if event == "timeout":
            rule = "an outcome that comes at an instant, where something fails at random or is disturbed"
            raise ScenarioError("event", event, rule)
        for quantity, sampler in self._plan.varied:
            field = f'vary["{quantity.path}"]'
            if quantity.of_game:
                raise ScenarioError(field, sampler, "left out for rare events: it makes every trial a game of its own")
            if sampler.by_points and not sampler.coordinates(quantity.components):
                raise ScenarioError(field, sampler, "a sampler that draws: these starts follow one another")
        self._column = outcome_names(study.scenario.n).index(event)

    def together(self, count: int) -> int:
        """As many as memory holds the courses of."""
        return int(max(1, min(TOGETHER, _BYTES // (8 * count * (self._plan.scenario.steps + 1)))))

    def crude(self) -> Floats:
        """Scores of games as the study draws them."""
        paths = self._paths(0, CRUDE)
        rows = max(CRUDE // 10, 1)
        played = [self._play(paths.inputs[i : i + rows], paths.stretches[i : i + rows]) for i in range(0, CRUDE, rows)]
        return np.concatenate([course[:, -1] for course, _ in played])

    def prepare(self) -> Generator[int, None, float]:
        """Replications of few paths, which are played to see how much they differ, and whether splitting pays."""
        mean = 0.0
        for i, count in enumerate(_PILOT):
            first = _PILOT_NUMBERS + i * _PILOTS
            found = yield from self.group(range(first, first + _PILOTS), count)
            mean = float(found.estimates.mean())
            if np.count_nonzero(found.estimates) >= _PILOTS // 2:
                inflation = count * float(found.estimates.var(ddof=1)) / mean**2
                self._refuse_what_does_not_pay(mean, inflation)
                return inflation
        about = f", P is about {mean:.1e}" if mean else ""
        rule = f"one that paths lead to: most replications of {_PILOT[-1]:,} paths died out before it{about}"
        raise ScenarioError("event", self.event, rule)

    def _refuse_what_does_not_pay(self, mean: float, inflation: float) -> None:
        """Refuse where crude Monte Carlo needs fewer games, by what the pilot saw."""
        rounds = math.log(mean) / math.log(1.0 - DYING)
        runs = inflation / (AIM * self.error) ** 2 * (1.0 + DYING * rounds)
        crude = (1.0 - mean) / (mean * self.error**2)
        if runs > crude:
            rule = (
                f"one for which splitting pays: with P about {mean:.1e} it would need some {runs:.1e} runs here, crude "
                f"Monte Carlo {crude:.1e}: call Study.run(), and probabilities() of its result"
            )
            raise ScenarioError("event", self.event, rule)

    def group(self, numbers: range, count: int) -> Generator[int, None, Climb]:
        """Replications side by side."""
        all_of = [self._paths(number, count) for number in numbers]
        rows = [np.arange(count)] * len(all_of)
        while True:
            playing = [(paths, own) for paths, own in zip(all_of, rows, strict=True) if len(own)]
            if not playing:
                break
            inputs = np.concatenate([paths.inputs[own] for paths, own in playing])
            stretches = [paths.stretches[row] for paths, own in playing for row in own.tolist()]
            course, who = self._play(inputs, stretches)
            ends = np.cumsum([0, *(len(own) for _, own in playing)])
            for (paths, own), first, last in zip(playing, ends[:-1], ends[1:], strict=True):
                if not len(paths.course):
                    paths.course, paths.who = course[first:last], who[first:last]
                else:
                    paths.course[own], paths.who[own] = course[first:last], who[first:last]
            yield len(stretches)
            rows = [paths.round() if not paths.over else own[:0] for paths, own in zip(all_of, rows, strict=True)]
            if all(paths.over or paths.estimate < _RAREST for paths in all_of):
                break
        if any(not paths.over for paths in all_of):
            raise StuckError(max(paths.estimate for paths in all_of), tied=False)
        estimates = np.array([paths.estimate for paths in all_of])
        return Climb(np.empty((len(all_of), 0)), [paths.ended for paths in all_of], estimates)

    def _paths(self, number: int, count: int) -> _Paths:
        """The games that a replication begins with."""
        rng = self.generator(number)
        drawn = [np.empty((count, 0))]
        for quantity, sampler in self._plan.varied:
            points = np.maximum(rng.random((count, sampler.coordinates(quantity.components))), LOWEST)
            drawn.append(sampler.draw(Block(points, rng, 0), quantity.components))
        inputs = np.concatenate(drawn, axis=1)
        self._plan.check(0, inputs)
        return _Paths(number, count, rng, inputs)

    def _play(self, inputs: Floats, stretches: list[Stretches]) -> tuple[Floats, Integers]:
        """The courses of the score, and the intercepting defender of each path or -1."""
        starts, sight, capture = core_setups(self._plan.scenario, self._plan.quantities, inputs)
        flat = np.array([one for row in stretches for one in row], dtype=np.uint64)
        offsets = np.cumsum([0, *map(len, stretches)]).astype(np.uint64)
        world: Any = self._plan.world
        who, course = self._plan.game.score_courses(
            starts,
            sight,
            capture,
            world=world,
            seed=self.seed,
            offsets=offsets,
            steps=np.ascontiguousarray(flat[:, 0]),
            trials=np.ascontiguousarray(flat[:, 1]),
            column=self._column,
            threads=self._threads,
        )
        return course, who.astype(np.int64)
