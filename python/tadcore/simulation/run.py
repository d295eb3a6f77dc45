"""One game, everything recorded: the record, and what can be asked of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import Floats, Numbers
from tadcore.game.changes import Interval, NetworkChange, changes_of, intervals_of
from tadcore.game.chattering import Chatter
from tadcore.game.course import Contact, Course, EdgeOutage, Outage, contacts, edge_outages, sensor_outages
from tadcore.game.divergence import Divergence
from tadcore.game.outcome import Outcome
from tadcore.game.passes import Pass
from tadcore.game.recorded import scalar_gains
from tadcore.plotting.run.accessor import Plots
from tadcore.scenario.model import Scenario

from .termination import Termination
from .variants import TURNING_WORDS, told

if TYPE_CHECKING:
    import os

    import pandas
    import xarray

    from tadcore.plotting import Animation


@dataclass(frozen=True, eq=False, repr=False)
class Run:
    """A game from its start to its end; made by `tadcore.simulate`.

    The record has L + 1 rows, t_0 … t_L, the last of them the terminal state. m is the number of players with limited
    sight (n in I1, n + 1 in I2) and N = n + 1.

    Attributes
    ----------
    scenario : Scenario
        What was played.
    outcome : Outcome
        How it ended.
    times : ndarray, shape (L + 1,)
        Instants.
    position, control : ndarray, shape (L + 1, n + 2, dim)
        Positions and controls (velocities) in the order of ``scenario.players``. The last control is the feedback at
        the terminal state under the last network in force.
    adjacency : ndarray of bool, shape (L + 1, m, N)
        𝒜 at every instant: what each player used, seen by itself or reported to it; the last row repeats the last
        network in force.
    gains : ndarray, shape (L + 1, m, N)
        Rows of the feedback of the players with limited sight, u_i = gains[k, i] @ z. Of a run with turning gains
        complex: u_x + iu_y = gains[k, i] @ (z_x + iz_y).
    theta : ndarray, shape (L + 1,)
        Θ₁ or Θ₂, in reduced norms.
    theta_terms : ndarray, shape (L + 1, 4 or 3)
        Its terms, unweighted.
    costs : dict of str to float
        J over [0, outcome.time], terminal term included: ``"defenders"``, ``"target"``, ``"attacker"`` in I1
        (eq:fullobj), ``"team"`` in I2, which the attacker minimises and the team maximises (eq:obj:zero_sum).
    iterations : int
        Steps of the synthesis solver, all instants together.
    unconverged : int
        Instants at which the synthesis stopped short of its tolerance.
    passes : tuple of Pass
        Capture radii entered between two instants, where termination is not tested, in the order of time, up to a
        divergence; empty with continuous termination, and where players are disturbed, whose path between two instants
        is not known.
    termination : {"sampled", "continuous"}
        When the game ends, see `tadcore.simulate`.
    diverged : Divergence or None
        When the game diverged, and how far it went; None where it did not. It is played on, but its end, costs and
        network then say nothing of a pursuit. Where it leaves the range of double precision, the record stops before
        the end.
    certified : int
        Rows of the record whose gains are proved to be globally optimal among scalar gains.
    hysteresis, dwell : float
        The rule by which edges form and break; zero in the paper's game. See `tadcore.simulate`.
    turning, mirror : bool
        Whether gains may turn, and whether their mirror images were played; see `tadcore.simulate`.
    course : Course or None
        What failed, who heard whom and what displaced the players; None where the scenario has no such tables and the
        network is its own.
    """

    scenario: Scenario
    outcome: Outcome
    times: Floats
    position: Floats
    control: Floats
    adjacency: NDArray[np.bool_]
    gains: Numbers
    theta: Floats
    theta_terms: Floats
    costs: dict[str, float]
    iterations: int
    unconverged: int
    certified: int
    hysteresis: float = 0.0
    dwell: float = 0.0
    passes: tuple[Pass, ...] = ()
    termination: Termination = "sampled"
    diverged: Divergence | None = None
    turning: bool = False
    mirror: bool = False
    course: Course | None = None

    @property
    def seed(self) -> int:
        """The seed of failures and disturbances; 0 where there are none."""
        return 0 if self.course is None else self.course.seed

    @property
    def trial(self) -> int:
        """The trial of failures and disturbances; 0 where there are none."""
        return 0 if self.course is None else self.course.trial

    @property
    def seen(self) -> NDArray[np.bool_]:
        """What each player saw itself, shape (L + 1, m, N) as ``adjacency``, which it is where nobody reports."""
        return self.adjacency if self.course is None else self.course.seen

    @cached_property
    def theta_price(self) -> Floats:
        """The price of team consistency, shape (L,): Θ under the criterion "component" less Θ under "paper".

        At every instant with a network in force, 0 where nobody, or everybody, knows everything. Both are the lowest Θ
        that a search finds; where that under "component" is the lower one, the other was missed, and the price is 0.
        A run with turning gains is refused: both are among scalar gains.
        """
        from tadcore.game.compiled import game_of

        scalar_gains(self)
        in_force = len(self.times) - 1
        return game_of(self.scenario).theta_price(np.arange(in_force), self.adjacency[:in_force])

    @property
    def relayed(self) -> NDArray[np.bool_]:
        """What players knew by reports alone, shape (L + 1, m, N)."""
        return self.adjacency & ~self.seen

    @property
    def sensor_outages(self) -> tuple[Outage, ...]:
        """(player, start, end) of the stretches over which a sensor did not work, by player."""
        return () if self.course is None else sensor_outages(self.course, self.times, self.scenario)

    @property
    def edge_outages(self) -> tuple[EdgeOutage, ...]:
        """(edge, start, end) of the stretches over which one player would not have detected another, in range or not.

        Those of the player's whole sensor are not among them.
        """
        return () if self.course is None else edge_outages(self.course, self.times, self.scenario)

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """(listener, speaker, start, end) of the stretches over which one player heard another, by listener."""
        return () if self.course is None else contacts(self.course, self.times, self.scenario)

    @property
    def variant(self) -> str:
        """What sets this run apart from one by the default rules, in words; empty where nothing does."""
        named = {"hysteresis": self.hysteresis, "dwell": self.dwell}
        words = [f"{name} {value:g}" for name, value in named.items() if value > 0.0]
        words += ["continuous termination"] if self.termination == "continuous" else []
        words += [TURNING_WORDS[self.mirror]] if self.turning or self.mirror else []
        outside = self.course is not None and self.course.from_outside
        return " and ".join([*words, *(["a network from outside"] if outside else [])])

    @property
    def converged(self) -> bool:
        """Whether the gains of every instant reached the tolerance, and the game did not diverge."""
        return self.unconverged == 0 and self.diverged is None

    @cached_property
    def dataset(self) -> xarray.Dataset:
        """The record as a labelled dataset over (time, player, axis), with symbols and sources in its attributes."""
        from .files import dataset_of

        return dataset_of(self)

    @cached_property
    def network_changes(self) -> tuple[NetworkChange, ...]:
        """(time, edges added, edges removed) wherever the network changes, the initial network first.

        Empty for a game that is over at t = 0: termination is tested before the network is formed. Of a game that
        diverges, ``changes_after_divergence`` counts the last ones.
        """
        in_force = len(self.times) - 1
        return changes_of(self.times[:in_force], self.adjacency[:in_force], self.scenario.players)

    @property
    def changes_after_divergence(self) -> int:
        """How many of the network changes come after the game diverged: in the end they are of rounding noise."""
        until = np.inf if self.diverged is None else self.diverged.time
        return sum(change.time >= until for change in self.network_changes)

    def intervals(self) -> tuple[Interval, ...]:
        """(start, end, edges) of the stretches with one network, the last up to the end of the game."""
        return intervals_of(self.network_changes, self.outcome.time)

    @cached_property
    def chattering(self) -> tuple[Chatter, ...]:
        """Stretches in which one edge flips at almost every instant: (edge, start, end, flips), in order of time.

        At least six flips, never more than five steps apart: a sliding mode of the continuous game, whose number of
        flips is a property of δ. `tadcore.verification.sliding_study` finds its limit.
        """
        from tadcore.game.chattering import chatter

        return chatter(self)

    @property
    def plot(self) -> Plots:
        """Figures of this run by name: ``run.plot.trajectories()``, ``.network()``, ``.controls()`` and so on."""
        from tadcore.plotting.run.accessor import Plots

        return Plots(self)

    def animate(self, *, seconds: float = 8.0, fps: float = 20.0, width: float = 7.2) -> Animation:
        """The run as moving pictures: ``run.animate().save("run.gif")``, or shown in a notebook.

        Parameters
        ----------
        seconds : float
            How long the game takes on the screen; pauses at network changes and at the end are added.
        fps : float
            Pictures in a second.
        width : float
            Width of the pictures in inches.

        Returns
        -------
        tadcore.plotting.Animation
            Its ``save`` writes GIF, MP4 or HTML.

        Raises
        ------
        ValueError
            A number is not positive.
        """
        from tadcore.plotting import Animation

        return Animation(self, seconds=seconds, fps=fps, width=width)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the run; `tadcore.load_run` reads it back.

        Parameters
        ----------
        path : path
            A name that ends in ``.nc``: one netCDF 3 file, which xarray opens. A name without a suffix, or a folder
            that is there: ``run.nc``, ``scenario.toml`` and ``summary.json`` in that folder. Each file appears whole
            or not at all; folders on the way are made.

        Raises
        ------
        ScenarioError
            The name ends in something else.
        OSError
            The place cannot be written.
        """
        from .files import save

        save(self, path)

    def to_pandas(self) -> pandas.DataFrame:
        """The motion as a table: one row for each instant and player, with position, control and distance to a.

        Returns
        -------
        pandas.DataFrame
            Indexed by (time, player); columns ``x``, ``y``, in space ``z``, ``control_x`` and so on, ``distance``.
        """
        import pandas

        axes = "xyz"[: self.scenario.dim]
        distance = np.linalg.norm(self.position - self.position[:, -1:], axis=-1)
        columns = {axis: self.position[..., i] for i, axis in enumerate(axes)}
        columns |= {f"control_{axis}": self.control[..., i] for i, axis in enumerate(axes)} | {"distance": distance}
        index = pandas.MultiIndex.from_product([self.times, self.scenario.players], names=["time", "player"])
        return pandas.DataFrame({name: values.ravel() for name, values in columns.items()}, index=index)

    def _repr_html_(self) -> str:
        from .shown import html_of

        return html_of(self)

    def __repr__(self) -> str:
        later = self.changes_after_divergence
        changes = max(len(self.network_changes) - 1, 0) - later
        network = {0: "fixed network", 1: "1 network change"}.get(changes, f"{changes} network changes")
        if self.diverged is not None:
            network += f" and {later} after it diverged"
        warning = "" if not self.unconverged else f", {self.unconverged} instants NOT converged"
        edges = dict.fromkeys("→".join(c.edge) for c in self.chattering)
        chattering = f", chattering: {', '.join(edges)}" if edges else ""
        other = f"; a variant, {told(self)}" if self.variant else ""
        other += f"; {_passed(self.passes)}" if self.passes else ""
        lost = (
            ""
            if self.diverged is None
            else f"; DIVERGES at t = {self.diverged.time:.10g}, size {self.diverged.size:.2g}"
        )
        drawn = f"; seed {self.seed}, trial {self.trial}" if self.scenario.is_random else ""
        return f"Run({self.scenario.interaction}: {self.outcome}{lost}; {network}{chattering}{warning}{other}{drawn})"


def _passed(passes: tuple[Pass, ...]) -> str:
    more = f" and {len(passes) - 1} times more" if len(passes) > 1 else ""
    return f"{passes[0]}{more}"
