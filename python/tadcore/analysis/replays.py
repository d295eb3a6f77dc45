"""The same trials, played at any radius of one player or of the team, or from any start of one player."""

from __future__ import annotations

import math
import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tadcore._shared.arrays import Floats, as_positions, as_real, as_seed, refuse_where
from tadcore._shared.limits import OF_FIELD
from tadcore.errors import MISSING, ScenarioError
from tadcore.scenario.model import Scenario
from tadcore.scenario.paths import label
from tadcore.scenario.quantities import component
from tadcore.scenarios.given import ScenarioLike, as_scenario
from tadcore.simulation.batch import Batch, simulate_batch
from tadcore.simulation.starts import Rows, rows_of
from tadcore.simulation.termination import Termination
from tadcore.statistics import TrialOutcomes
from tadcore.statistics.outcomes import indicators
from tadcore.statistics.radius import RadiusKind
from tadcore.study.study import Study

TEAM = "d*"
"""All defenders, who then share one radius."""


def refuse_random(sc: Scenario, function: str, instead: str) -> None:
    """Refuse a game whose outcome from one start is a matter of chance."""
    if sc.is_random:
        rule = f"one without failures and disturbances for {function}, since a start has many outcomes here: {instead}"
        raise ScenarioError("scenario", "a random game", rule)


def starts_of(source: ScenarioLike | Study | TrialOutcomes, positions: ArrayLike | None) -> tuple[Scenario, Rows]:
    """The game and the starts to play: those given, or those of a study, played or not."""
    if not isinstance(source, Scenario | str | os.PathLike):
        if positions is not None:
            raise ScenarioError("positions", "an array", "left out: a study brings its own starts")
        inputs = source.inputs() if isinstance(source, Study) else source.inputs
        return source.scenario, rows_of(source.scenario, inputs, source.trials)
    source = as_scenario(source)
    if positions is None:
        raise ScenarioError("positions", MISSING, "the starts to play, of shape (M, n + 2, dim)")
    starts = as_positions(positions, (source.n + 2, source.dim), rows=True)
    if not len(starts):
        raise ScenarioError("positions", "no trials", "at least one start")
    return source, Rows(starts, source.visibility_radii, source.capture_radii)


def seed_of(source: ScenarioLike | Study | TrialOutcomes, seed: int) -> int:
    """The seed of failures and disturbances: the one given with a scenario, or that of a study."""
    if isinstance(source, Scenario | str | os.PathLike):
        return as_seed(seed)
    if seed != 0:
        raise ScenarioError("seed", seed, "left out: a study brings its own")
    return source.seed


def ending_of(source: object) -> Termination:
    """When the games of a study end; at the instants of the grid where a scenario was given."""
    found: Termination = getattr(source, "termination", "sampled")
    return found


class Replays:
    """The same starts, with the same failures and disturbances, at any radius of one player, or of all defenders."""

    def __init__(
        self,
        sc: Scenario,
        rows: Rows,
        player: str,
        kind: RadiusKind,
        threads: int | None,
        seed: int = 0,
        termination: Termination = "sampled",
    ) -> None:
        player = label(player)
        if not isinstance(kind, str) or kind not in ("visibility", "capture"):
            raise ScenarioError("kind", kind, 'one of "visibility" and "capture"')
        labels = sc.constrained if kind == "visibility" else (*sc.players[: sc.n], "attacker")
        if not isinstance(player, str) or player not in (*labels, TEAM):
            rule = f"one that has a {kind} radius: {', '.join(labels)}; or {TEAM} for all defenders together"
            raise ScenarioError("player", player, rule)
        team = [f"d{i + 1}" for i in range(sc.n)] if player == TEAM else [player]
        self.columns = [component(sc, f"{one}.{kind}_radius").row for one in team]
        self.sc, self.rows, self.player, self.kind = sc, rows, player, kind
        self._options: dict[str, Any] = {"threads": threads, "seed": seed, "termination": termination}
        self._own = np.array(sc.visibility_radii if kind == "visibility" else sc.capture_radii)[self.columns]

    @property
    def own(self) -> float:
        """The radius in the scenario; NaN where the defenders of a team have several."""
        return float(self._own[0]) if (self._own == self._own[0]).all() else math.nan

    def play_own(self) -> Batch:
        """All trials with the radius, or radii, of the scenario."""
        return self._play(self._own, slice(None))

    def checked(self, field: str, radii: ArrayLike) -> Floats:
        """Radii that every trial accepts, σ < ζ included."""
        values = as_real(field, radii, "positive numbers").reshape(np.shape(radii))
        for rule in OF_FIELD[f"{self.kind}_radius"]:
            refuse_where(field, values, ~rule.holds(values), rule.words)
        defenders = [column for column in self.columns if column < self.sc.n]
        whose = "every defender's" if self.player == TEAM else "the player's"
        if defenders and self.kind == "visibility":
            least = float(self.rows.capture_radii[..., defenders].max())
            refuse_where(field, values, values <= least, f"larger than {whose} capture radius ({least!r})")
        elif defenders:
            most = float(self.rows.visibility_radii[..., defenders].min())
            refuse_where(field, values, values >= most, f"smaller than {whose} visibility radius ({most!r})")
        return values

    def play(self, radius: float | Floats, trials: NDArray[np.int64] | None = None) -> Batch:
        """All trials at one radius, or chosen trials each at its own."""
        return self._play(np.asarray(radius)[..., np.newaxis], slice(None) if trials is None else trials)

    def _play(self, radii: Floats, chosen: slice | NDArray[np.int64]) -> Batch:
        """Chosen trials with radii of shape (1 or those of `columns`,), or (trials, 1)."""
        positions = self.rows.positions[chosen]
        visibility, capture = (
            np.array(common if common.ndim == 1 else common[chosen])
            for common in (self.rows.visibility_radii, self.rows.capture_radii)
        )
        varied = visibility if self.kind == "visibility" else capture
        if radii.ndim > 1 and varied.ndim == 1:
            varied = np.repeat(varied[np.newaxis], len(positions), axis=0)
        varied[..., self.columns] = radii
        sight, reach = (varied, capture) if self.kind == "visibility" else (visibility, varied)
        return simulate_batch(self.sc, positions, sight, reach, **self._options)


class Placed:
    """The trials of a study, played from any start of one player."""

    def __init__(self, source: Study | TrialOutcomes, player: str, threads: int | None) -> None:
        self.sc, self.rows = starts_of(source, None)
        self.player = label(player)
        self._options: dict[str, Any] = {"threads": threads, "seed": source.seed, "termination": ending_of(source)}
        if self.player not in self.sc.players:
            raise ScenarioError("player", player, f"one of {', '.join(self.sc.players)}")
        self.row = self.sc.players.index(self.player)
        self.own = self.sc.positions[self.row]

    @property
    def trials(self) -> int:
        """M."""
        return len(self.rows)

    def events(self, places: Floats) -> NDArray[np.bool_]:
        """Which trials ended in each outcome from each place (L, dim), last those that diverged: (4 + n, L, M)."""
        together = 1 if self.sc.is_random else len(places)  # a batch numbers its rows, and with them its draws
        blocks = [self._played(places[first : first + together]) for first in range(0, len(places), together)]
        return np.concatenate(blocks, axis=1)

    def _played(self, places: Floats) -> NDArray[np.bool_]:
        positions = np.tile(self.rows.positions, (len(places), 1, 1))
        positions[:, self.row] = np.repeat(places, self.trials, axis=0)
        sight, capture = (
            radii if radii.ndim == 1 else np.tile(radii, (len(places), 1))
            for radii in (self.rows.visibility_radii, self.rows.capture_radii)
        )
        batch = simulate_batch(self.sc, positions, sight, capture, **self._options)
        events = indicators(batch.kind, batch.defender, self.sc.n, batch.diverged)
        return events.reshape(len(events), len(places), self.trials)
