"""What the explorer knows: a scenario, its run, an instant; no page and no browser."""

from __future__ import annotations

import io
import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import Floats, as_trial
from tadcore.errors import ScenarioError, TadcoreError
from tadcore.game.changes import changed_rows
from tadcore.game.network import Edge, edges_of
from tadcore.game.recorded import Recorded
from tadcore.game.sound import until_divergence
from tadcore.scenario.model import Scenario
from tadcore.simulation.play import simulate

MOST_POINTS = 400
"""No curve goes to the browser with more points than about this."""
_COARSE = (8, 6, 5, 4, 3, 2)  # steps that a preview takes as one


class Explorer:
    """A scenario that is being changed, and the run of it as it stands.

    Every change plays the game again; a preview plays it on a coarser grid, until `settle`. A change that breaks a rule
    raises `ScenarioError`, one that leaves the game without an equilibrium `NoEquilibriumError`; scenario and run then
    stay as they were.

    Parameters
    ----------
    sc : Scenario
        Where to begin, in the plane or in space.

    Raises
    ------
    NoEquilibriumError
        The game has no equilibrium on [0, T].
    """

    def __init__(self, sc: Scenario) -> None:
        self.scenario = sc
        self.trial = 0
        self.chosen = "attacker"
        self.run: Recorded = until_divergence(simulate(sc))
        self.time = self.run.outcome.time
        self.plane = (0, 1)
        self.preview = False

    def project(self, plane: str) -> None:
        """Look along one axis at the other two: "xy", "xz" or "yz"."""
        if plane not in self.planes:
            raise ScenarioError("plane", plane, f"one of {', '.join(self.planes)}")
        self.plane = ("xyz".index(plane[0]), "xyz".index(plane[1]))

    @property
    def planes(self) -> tuple[str, ...]:
        """The projections there are."""
        return ("xy",) if self.scenario.dim == 2 else ("xy", "xz", "yz")

    def choose(self, player: str) -> None:
        """Choose the player whose map is shown and whom keys move."""
        self.start_of(player)
        self.chosen = player

    def start_of(self, player: str) -> Floats:
        """Where a player starts, shape (dim,); raises `ScenarioError` where there is no such player."""
        if player not in self.scenario.players:
            raise ScenarioError("player", player, f"one of {', '.join(self.scenario.players)}")
        return np.array(self.scenario.positions[self.scenario.players.index(player)])

    def nudge(self, across: float, up: float, *, preview: bool = False) -> None:
        """Move the start of the chosen player in the plane that is shown."""
        x, y = self.flat(self.start_of(self.chosen)).tolist()
        self.move(self.chosen, round(x + across, 9), round(y + up, 9), preview=preview)

    def put(self, path: str, value: object) -> None:
        """Give any field another value: a weight, the horizon."""
        self._change({path: value})

    def move(self, player: str, x: float, y: float, *, preview: bool = False) -> None:
        """Start a player elsewhere in the plane that is shown; where it stands along a third axis stays."""
        place = self.start_of(player)
        place[list(self.plane)] = x, y
        self._change({f"{player}.position": tuple(place.tolist())}, preview=preview)

    def see(self, player: str, radius: float, *, preview: bool = False) -> None:
        """Give a player another visibility radius; inf for unlimited."""
        self._change({f"{player}.visibility_radius": float(radius)}, preview=preview)

    def capture(self, player: str, radius: float) -> None:
        """Give a player another capture radius."""
        self._change({f"{player}.capture_radius": float(radius)})

    def surround(self, tables: Mapping[str, object]) -> None:
        """Give the scenario other common tables of what surrounds the game; None takes one out."""
        self._change(tables)

    def draw(self, trial: int) -> None:
        """Play another trial of failures and disturbances."""
        before, self.trial = self.trial, as_trial("trial", trial)
        try:
            self._play(self.scenario, self.scenario, preview=False)
        except TadcoreError:
            self.trial = before
            raise

    def stretch(self, player: str, x: float, y: float, *, preview: bool = False) -> None:
        """Give a player the visibility radius whose disc, around where it stands now, passes through a point."""
        centre = self.flat(self.positions)[self.scenario.players.index(player)]
        self.see(player, round(float(np.hypot(x - centre[0], y - centre[1])), 4), preview=preview)

    def settle(self) -> None:
        """Play the game itself where only a preview of it was played."""
        if self.preview:
            self._play(self.scenario, self.scenario, preview=False)

    def look_at(self, time: float) -> None:
        """Choose the instant that is shown, within the run."""
        self.time = float(min(max(time, 0.0), self.run.outcome.time))

    @property
    def k(self) -> int:
        """Index of the instant that is shown."""
        return int(np.argmin(np.abs(self.run.times - self.time)))

    @property
    def positions(self) -> Floats:
        """Where everyone stands at the instant that is shown, shape (n + 2, dim)."""
        return np.asarray(self.run.position[self.k])

    def flat(self, positions: Floats) -> Floats:
        """The two coordinates that are shown, of positions of shape (…, dim)."""
        return positions[..., list(self.plane)]

    @property
    def sampled(self) -> NDArray[np.intp]:
        """Indices of the instants that are drawn: few enough, changes of the network and both ends among them."""
        last = len(self.run.times) - 1
        even = np.linspace(0, last, min(last + 1, MOST_POINTS)).round().astype(np.intp)
        jumps = changed_rows(self.run.adjacency)
        if len(jumps) > MOST_POINTS:
            return even
        return np.unique(np.concatenate([even, jumps, jumps - 1]))

    @property
    def edges(self) -> tuple[Edge, ...]:
        """Who sees whom at the instant that is shown."""
        if len(self.run.times) == 1:  # over before there is a network
            return ()
        return edges_of(self.run.adjacency[self.k], self.scenario.players)

    def toml(self) -> str:
        """The scenario as TOML."""
        return self.scenario.to_toml()

    def png(self) -> bytes:
        """The trajectories as a journal prints them, a PNG."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        from tadcore import plotting

        with plotting.style():
            figure = Figure(figsize=(plotting.COLUMN, 3.0), layout="constrained")
            FigureCanvasAgg(figure)
            space = "3d" if self.scenario.dim == 3 else None
            plotting.trajectories(self.run, figure.add_subplot(projection=space))
            picture = io.BytesIO()
            figure.savefig(picture, format="png", dpi=300)
        return picture.getvalue()

    def _change(self, changes: Mapping[str, object], *, preview: bool = False) -> None:
        scenario = self.scenario.replace(changes)
        coarse = self.coarse_step if preview else scenario.step
        self._play(scenario, scenario.replace({"step": coarse}), preview=coarse != scenario.step)

    def _play(self, scenario: Scenario, played: Scenario, *, preview: bool) -> None:
        at_end = math.isclose(self.time, self.run.outcome.time)
        self.run = until_divergence(simulate(played, trial=self.trial))
        self.scenario, self.preview = scenario, preview
        self.look_at(self.run.outcome.time if at_end else self.time)

    @property
    def coarse_step(self) -> float:
        """The step of previews: a few steps of the scenario, as long as they divide the horizon."""
        sc = self.scenario
        many = next((many for many in _COARSE if sc.steps % many == 0), 1)
        return sc.horizon / (sc.steps // many) if many > 1 else sc.step
