"""One chunk of a study: drawn, checked and played, as a function of (scenario, vary, seed, chunk) alone."""

from __future__ import annotations

import contextlib
import math
import threading
import time
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any

import numpy as np

from tadcore._core import Game, Stop, World, simulate_games
from tadcore._shared.arrays import Floats
from tadcore._shared.limits import OF_FIELD, can_be_told, divides, sees_whom_it_intercepts, too_far
from tadcore._shared.progress import bar
from tadcore._shared.threads import in_order
from tadcore.errors import ScenarioError
from tadcore.game.compiled import core_world, game_of
from tadcore.sampling.base import Block, Sampler
from tadcore.sampling.design import CHUNK, Design, generator, unit_points
from tadcore.scenario.model import Scenario
from tadcore.scenario.numbers import GAMMA, games_of
from tadcore.scenario.quantities import Quantity, core_setups, setups
from tadcore.simulation.rules import extents_of
from tadcore.simulation.termination import Termination
from tadcore.statistics.tally import Tally, steps_of

from .task import Outcomes, Played, Task
from .vary import quantities


@dataclass(frozen=True, eq=False)
class Plan:
    """What the chunks of a study are computed from."""

    scenario: Scenario
    vary: dict[str, Sampler]
    seed: int
    design: Design
    termination: Termination = "sampled"
    passes: bool = False
    _one_at_a_time: threading.Lock = field(default_factory=threading.Lock, init=False)

    def __getstate__(self) -> dict[str, Any]:
        """What it was made from: the lock, the compiled game and what else follows are made again."""
        return {item.name: getattr(self, item.name) for item in fields(self) if item.init}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state, _one_at_a_time=threading.Lock())

    @cached_property
    def varied(self) -> tuple[tuple[Quantity, Sampler], ...]:
        """Every quantity that varies, with its sampler."""
        return quantities(self.scenario, self.vary)

    @cached_property
    def quantities(self) -> tuple[Quantity, ...]:
        """The same, without samplers."""
        return tuple(quantity for quantity, _ in self.varied)

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """Names of the inputs, one for each varied component."""
        return tuple(name for quantity in self.quantities for name in quantity.columns)

    def draw(self, chunk: int, rows: int = CHUNK) -> Floats:
        """Inputs of the first ``rows`` trials of a chunk, shape (rows, columns).

        The chunk is always drawn whole and then cut: what a trial draws cannot depend on how many follow.
        """
        layout = [(q.purpose, sampler.coordinates(q.components)) for q, sampler in self.varied]
        points = unit_points(self.design, self.seed, chunk, layout)
        drawn = []
        for (q, sampler), p in zip(self.varied, points, strict=True):
            # What has a state of its own, such as a user's function, must not be called by two threads at once.
            with contextlib.nullcontext() if sampler.by_points else self._one_at_a_time:
                block = Block(p, generator(self.seed, chunk, q.purpose), chunk * CHUNK)
                drawn.append(sampler.draw(block, q.components))
        columns = np.empty((len(self.columns), CHUNK))  # each by itself in memory, as everything after this wants it
        if drawn:
            np.concatenate([values.T for values in drawn], out=columns)
        return columns.T[:rows]

    def check(self, chunk: int, inputs: Floats) -> None:
        """Raise `ScenarioError` for the first trial of a chunk whose draws are no game: its path, number and value."""
        fields = [(name, quantity.field) for quantity in self.quantities for name in quantity.columns]
        for values, (name, kind) in zip(inputs.T, fields, strict=True):
            for rule in OF_FIELD[kind]:
                self._refuse(chunk, name, values, ~rule.holds(values), rule.words)
        self._check_games(chunk, inputs)
        positions, sight, capture = setups(self.scenario, self.quantities, inputs)
        for i in range(self.scenario.n):
            reach, seen = (np.broadcast_to(radii[..., i], len(inputs)) for radii in (capture, sight))
            bad = ~sees_whom_it_intercepts(reach, seen)
            words = f"larger than the defender's capture radius, {float(reach[int(bad.argmax())])!r}"
            self._refuse(chunk, f"defenders.{i}.visibility_radius", seen, bad, words)
        extents = extents_of(positions)
        for i, (where, seen) in enumerate(zip(self.scenario.constrained, np.atleast_2d(sight).T, strict=True)):
            bad = ~can_be_told(seen, extents)
            path = f"defenders.{i}.visibility_radius" if i < self.scenario.n else f"{where}.visibility_radius"
            self._refuse(chunk, path, np.broadcast_to(seen, bad.shape), bad, too_far(float(extents[int(bad.argmax())])))
        shortest = self._shortest_link
        bad = ~can_be_told(np.full(len(inputs), shortest), extents)
        farthest = too_far(float(extents.max(initial=0.0)))
        self._refuse(chunk, "communication.radius", np.full(len(inputs), shortest), bad, farthest)

    def _check_games(self, chunk: int, inputs: Floats) -> None:
        """The rules that tie the numbers of a game together."""
        if not self.games:
            return
        rows = games_of(self.scenario, self.quantities, inputs)
        horizon, step = rows[:, 0], rows[:, 1]
        if "step" in self.games:
            self._refuse(chunk, "step", step, ~divides(horizon, step), "a divisor of the horizon")
        self._refuse(chunk, "horizon", horizon, ~divides(horizon, step), "a multiple of the step")
        gamma = rows[:, -len(self.scenario.synthesis_weights) :]
        self._refuse(chunk, GAMMA, gamma.sum(axis=1), ~(gamma > 0.0).any(axis=1), "weights of which one is positive")

    def check_ahead(
        self, trials: int, only: range | None = None, *, threads: int | None = None, progress: bool = False
    ) -> None:
        """Check before anything runs that every trial is a game: a millisecond a chunk, few of them in memory.

        Where the supports of the samplers prove it, the first chunk is enough.
        """

        def checked(chunk: int) -> None:
            self.check(chunk, self.draw(chunk, min(CHUNK, trials - chunk * CHUNK)))

        wanted = range(math.ceil(trials / CHUNK)) if only is None else only
        chunks = wanted[:1] if self.proven else wanted
        for _ in bar(in_order(checked, chunks, threads), "checking draws", total=len(chunks), show=progress):
            pass

    @cached_property
    def proven(self) -> bool:
        """Whether the supports of the samplers alone leave no bad draw possible."""
        sc = self.scenario
        reach = {("visibility_radius", i): (float(r), float(r)) for i, r in enumerate(sc.visibility_radii)}
        reach |= {("capture_radius", i): (float(r), float(r)) for i, r in enumerate(sc.capture_radii)}
        farthest = float(np.abs(sc.positions).max())
        for quantity, sampler in self.varied:
            ends = sampler.bounds()
            if quantity.field == "position":
                farthest = max(farthest, *map(abs, ends))
            if quantity.field in ("horizon", "step", GAMMA):
                return False
            if not all(rule.holds(end) for rule in OF_FIELD[quantity.field] for end in ends):
                return False
            reach[quantity.field, quantity.row] = ends
        shortest = [reach["visibility_radius", i][0] for i in range(len(sc.constrained))]
        if not all(can_be_told(radius, 2.0 * farthest) for radius in (*shortest, self._shortest_link)):
            return False
        pairs = ((reach["capture_radius", i], reach["visibility_radius", i]) for i in range(sc.n))
        return all(sees_whom_it_intercepts(capture[1], sight[0]) for capture, sight in pairs)

    @cached_property
    def _shortest_link(self) -> float:
        """The least radius within which anyone is heard; inf where there are no links."""
        world = self.scenario.world
        return np.inf if world is None or world.link_radius is None else float(np.nanmin(world.link_radius))

    def _refuse(self, chunk: int, path: str, values: Floats, bad: Any, rule: str) -> None:
        if bad.any():
            row = int(bad.argmax())
            raise ScenarioError(f"{path}, trial {chunk * CHUNK + row:,}", float(values[row]), rule)

    @cached_property
    def game(self) -> Game:
        """The compiled game, shared by all that have its weights."""
        return game_of(self.scenario)

    @cached_property
    def games(self) -> tuple[str, ...]:
        """What varies and makes every trial a game of its own; empty where all share one and its table of gains."""
        return tuple(quantity.path for quantity in self.quantities if quantity.of_game)

    @property
    def between(self) -> bool:
        """Whether a game may end between the instants of the scenario's grid."""
        return self.termination == "continuous" or "horizon" in self.games or "step" in self.games

    @cached_property
    def world(self) -> World | None:
        """What surrounds the game, as the core takes it; None for the paper's game."""
        return core_world(self.scenario)

    def play(self, inputs: Floats, first: int, threads: int | None, stop: Stop | None = None) -> Outcomes:
        """Play the trials from ``first`` on, which have these inputs; the core refuses what is no game.

        It ends when ``stop`` is set.
        """
        starts, sight, capture = core_setups(self.scenario, self.quantities, inputs)
        continuous, passes = self.termination == "continuous", self.passes
        if self.games:
            interaction, numbers = self.scenario.interaction, games_of(self.scenario, self.quantities, inputs)
            kind, defender, time, _, diverged, passed = simulate_games(
                interaction,
                numbers,
                starts,
                sight,
                capture,
                continuous=continuous,
                passes=passes,
                threads=threads,
                stop=stop,
            )
        else:
            kind, defender, time, diverged, passed = self.game.simulate_batch(
                starts,
                sight,
                capture,
                continuous=continuous,
                passes=passes,
                threads=threads,
                stop=stop,
                world=self.world,
                seed=self.seed,
                first_trial=first,
            )
        return Outcomes(kind, defender, time, diverged, inputs, passed if self.passes else None)

    def tally(self, outcomes: Outcomes) -> Tally:
        """How many of the trials ended in each way at each step of the scenario's grid, later ones at its last."""
        sc = self.scenario
        step, _ = steps_of(outcomes.time, sc.horizon, sc.steps, between=self.between)
        if "horizon" in self.games:
            step = np.minimum(step, sc.steps)
        return Tally.of(outcomes.kind, outcomes.defender, outcomes.diverged, step, sc.n, sc.steps)

    def run(self, task: Task, threads: int | None, stop: Stop | None = None) -> Played:
        """Draw and play a group of chunks, one after another."""
        began = time.perf_counter()
        kept, tallies = [], []
        for chunk, rows in task.chunks():
            outcomes = self.play(self.draw(chunk, rows), chunk * CHUNK, threads, stop)
            tallies.append(self.tally(outcomes))
            if task.keep != "counts":
                kept.append(outcomes if task.keep == "all" else outcomes._replace(inputs=None))
        if not task.apart:
            tallies = [Tally.sum(tallies, self.scenario.n, self.scenario.steps)]
        return Played(task, tuple(tallies), tuple(kept), time.perf_counter() - began)
