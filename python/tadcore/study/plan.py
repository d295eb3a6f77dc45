"""One chunk of a study: drawn, checked and played, as a function of (scenario, vary, seed, chunk) alone."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import Floats
from tadcore._shared.limits import OF_FIELD, can_be_told, sees_whom_it_intercepts, too_far
from tadcore._shared.progress import bar
from tadcore.errors import ScenarioError
from tadcore.sampling.base import Block, Sampler
from tadcore.sampling.design import CHUNK, Design, generator, unit_points
from tadcore.scenario.model import Scenario
from tadcore.scenario.quantities import Quantity, setups
from tadcore.simulation.batch import simulate_batch
from tadcore.simulation.rules import extents_of
from tadcore.simulation.termination import Termination

from .vary import quantities


class Outcomes(NamedTuple):
    """What a chunk returns: plain arrays of one length, ready for another process."""

    kind: NDArray[np.int8]
    defender: NDArray[np.int32]
    time: Floats
    diverged: NDArray[np.bool_]
    inputs: Floats
    """What was drawn, one column for each varied component."""
    passed: NDArray[np.bool_] | None = None
    """Whether a capture radius was entered between two instants, where that is looked for."""


@dataclass(frozen=True, eq=False)
class Plan:
    """What the chunks of a study are computed from."""

    scenario: Scenario
    vary: dict[str, Sampler]
    seed: int
    design: Design
    termination: Termination = "sampled"
    passes: bool = False

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
        drawn = [
            sampler.draw(Block(p, generator(self.seed, chunk, q.purpose), chunk * CHUNK), q.components)
            for (q, sampler), p in zip(self.varied, points, strict=True)
        ]
        return np.concatenate(drawn, axis=1)[:rows] if drawn else np.empty((rows, 0))

    def check(self, chunk: int, inputs: Floats) -> None:
        """Raise `ScenarioError` for the first trial of a chunk whose draws are no game: its path, number and value."""
        fields = [(name, quantity.field) for quantity in self.quantities for name in quantity.columns]
        for values, (name, field) in zip(inputs.T, fields, strict=True):
            for rule in OF_FIELD[field]:
                self._refuse(chunk, name, values, ~rule.holds(values), rule.words)
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

    def check_ahead(self, trials: int, *, progress: bool = False) -> None:
        """Check before anything runs that every trial is a game: a millisecond a chunk, one chunk in memory at a time.

        Where the supports of the samplers prove it, the first chunk is enough.
        """
        chunks = range(1 if self._proven() else math.ceil(trials / CHUNK))
        for chunk in bar(chunks, "checking draws", show=progress):
            self.check(chunk, self.draw(chunk, min(CHUNK, trials - chunk * CHUNK)))

    def _proven(self) -> bool:
        """Whether the supports of the samplers alone leave no bad draw possible."""
        sc = self.scenario
        reach = {("visibility_radius", i): (float(r), float(r)) for i, r in enumerate(sc.visibility_radii)}
        reach |= {("capture_radius", i): (float(r), float(r)) for i, r in enumerate(sc.capture_radii)}
        farthest = float(np.abs(sc.positions).max())
        for quantity, sampler in self.varied:
            ends = sampler.bounds()
            if quantity.field == "position":
                farthest = max(farthest, *map(abs, ends))
            if not all(rule.holds(end) for rule in OF_FIELD[quantity.field] for end in ends):
                return False
            reach[quantity.field, quantity.row] = ends
        if not all(can_be_told(reach["visibility_radius", i][0], 2.0 * farthest) for i in range(len(sc.constrained))):
            return False
        pairs = ((reach["capture_radius", i], reach["visibility_radius", i]) for i in range(sc.n))
        return all(sees_whom_it_intercepts(capture[1], sight[0]) for capture, sight in pairs)

    def _refuse(self, chunk: int, path: str, values: Floats, bad: NDArray[np.bool_], rule: str) -> None:
        if bad.any():
            row = int(bad.argmax())
            raise ScenarioError(f"{path}, trial {chunk * CHUNK + row:,}", float(values[row]), rule)

    def run(self, chunk: int, rows: int, threads: int | None) -> Outcomes:
        """Draw, check and play the first ``rows`` trials of a chunk."""
        inputs = self.draw(chunk, rows)
        self.check(chunk, inputs)
        positions, sight, capture = setups(self.scenario, self.quantities, inputs)
        between: dict[str, Any] = {"termination": self.termination, "passes": self.passes}
        batch = simulate_batch(self.scenario, positions, sight, capture, threads=threads, **between)
        return Outcomes(batch.kind, batch.defender, batch.time, batch.diverged, inputs, batch.passed)


def run_chunk(
    scenario: str,
    vary: dict[str, Sampler],
    seed: int,
    design: Design,
    termination: Termination,
    passes: bool,
    chunk: int,
    rows: int,
    threads: int | None,
) -> Outcomes:
    """`Plan.run` in another process, from the scenario's TOML; the process keeps its table from chunk to chunk."""
    from tadcore.scenario.model import Scenario

    return Plan(Scenario.from_toml_string(scenario), vary, seed, design, termination, passes).run(chunk, rows, threads)
