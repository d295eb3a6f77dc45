"""One game, everything recorded.

At every instant t_k of the grid: termination, the network from the distances (eq:limob of Singh and Reddy), the gains
for that network (eq:optproblem, eq:optproblem2), then one sampled-data step of the closed loop (zero-order hold),
z(t_{k+1}) = exp(C_k δ) z(t_k). Everything is dimensionless, as in the paper.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import Floats, as_amount
from tadcore._shared.calls import public
from tadcore.game.changes import Interval, NetworkChange, changes_of, intervals_of
from tadcore.game.chattering import Chatter
from tadcore.game.compiled import game_of
from tadcore.game.divergence import Divergence
from tadcore.game.outcome import Outcome
from tadcore.game.passes import Pass
from tadcore.plotting.run.accessor import Plots
from tadcore.scenario.model import Scenario
from tadcore.scenarios.given import ScenarioLike, as_scenario

from .termination import Termination, as_termination
from .variants import told

if TYPE_CHECKING:
    import os

    import pandas
    import xarray

    from tadcore.plotting import Animation


@dataclass(frozen=True, eq=False, repr=False)
class Run:
    """A game from its start to its end; made by `simulate`.

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
        𝒜 at every instant; the last row repeats the last network in force.
    gains : ndarray, shape (L + 1, m, N)
        Rows of the feedback of the players with limited sight.
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
        divergence; empty with continuous termination.
    termination : {"sampled", "continuous"}
        When the game ends, see `simulate`.
    diverged : Divergence or None
        When the game diverged, and how far it went; None where it did not. It is played on, but its end, costs and
        network then say nothing of a pursuit. Where it leaves the range of double precision, the record stops before
        the end.
    certified : int
        Rows of the record whose gains are proved to be globally optimal among scalar gains.
    hysteresis, dwell : float
        The rule by which edges form and break; zero in the paper's game. See `simulate`.
    """

    scenario: Scenario
    outcome: Outcome
    times: Floats
    position: Floats
    control: Floats
    adjacency: NDArray[np.bool_]
    gains: Floats
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

    @property
    def variant(self) -> str:
        """What sets this run apart from the paper's game, in words; empty where nothing does."""
        named = {"hysteresis": self.hysteresis, "dwell": self.dwell}
        words = [f"{name} {value:g}" for name, value in named.items() if value > 0.0]
        return " and ".join([*words, *(["continuous termination"] if self.termination == "continuous" else [])])

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
        return f"Run({self.scenario.interaction}: {self.outcome}{lost}; {network}{chattering}{warning}{other})"


def _passed(passes: tuple[Pass, ...]) -> str:
    more = f" and {len(passes) - 1} times more" if len(passes) > 1 else ""
    return f"{passes[0]}{more}"


@public
def simulate(
    sc: ScenarioLike, *, hysteresis: float = 0.0, dwell: float = 0.0, termination: Termination = "sampled"
) -> Run:
    """Play a scenario and record everything.

    Parameters
    ----------
    sc : Scenario, path or name
        The game: a scenario, the path of its TOML file, or the name of a bundled one, as wherever a scenario is
        taken.
    hysteresis : float
        h ≥ 0, a length. With h > 0 an edge forms at a distance of at most ζ and breaks only beyond ζ + h. The first
        network is the paper's.
    dwell : float
        D ≥ 0, a time, rounded up to whole steps. With D > 0 an edge that changed keeps its state for D, wherever the
        players are; the first network is no change.

        Either makes it *another game than the paper's*, in which an edge must be there exactly when the distance is at
        most ζ (eq:limob); the run says so. Batches and studies have no such variant.

    termination : {"sampled", "continuous"}
        When the game ends: at the first instant of the grid at which somebody is within a capture radius, which is the
        definition; or at the first crossing of a capture radius, at its own time between two instants. The motion
        within a step is known exactly, so nothing is missed. Feedback and network are those of the grid either way, so
        the two games are bitwise the same up to the end. The last row of the record is then the state at the crossing.

    Returns
    -------
    Run
        The outcome, the trajectories, the network, Θ and the costs.

    Raises
    ------
    NoEquilibriumError
        The game has no equilibrium on [0, T].
    ScenarioError
        `hysteresis` or `dwell` is negative or not finite, or `termination` is neither of the two.

    Examples
    --------
    >>> import tadcore
    >>> run = tadcore.simulate(tadcore.scenarios.load("paper-i1"))
    >>> print(run.outcome)
    d1 intercepts the attacker at t = 1.395
    >>> [change.time for change in run.network_changes]
    [0.0, 0.16, 0.49, 0.575, 0.915, 0.96]
    """
    rule = {"hysteresis": as_amount("hysteresis", hysteresis), "dwell": as_amount("dwell", dwell)}
    ending = as_termination(termination)
    continuous = ending == "continuous"
    sc = as_scenario(sc)
    game, sight, reach = game_of(sc), sc.visibility_radii, sc.capture_radii
    band, rest = rule["hysteresis"], rule["dwell"]
    record = game.simulate(sc.positions, sight, reach, hysteresis=band, dwell=rest, continuous=continuous)
    groups = ("defenders", "target", "attacker") if sc.interaction == "I1" else ("team",)
    return Run(
        scenario=sc,
        outcome=Outcome.of(record.kind, record.defender, record.time, diverged=record.diverged is not None),
        times=record.times,
        position=record.position,
        control=record.control,
        adjacency=record.adjacency,
        gains=record.gains,
        theta=record.theta,
        theta_terms=record.theta_terms,
        costs=dict(zip(groups, map(float, record.costs), strict=True)),
        iterations=record.iterations,
        unconverged=record.unconverged,
        certified=record.certified,
        **rule,
        passes=tuple(Pass(None if who < 0 else who, *rest) for who, *rest in record.passes),
        termination=ending,
        diverged=None if record.diverged is None else Divergence(*record.diverged),
    )
