"""One game played, everything recorded.

At every instant t_k of the grid: termination, the network from the distances (eq:limob of Singh and Reddy), the gains
for that network (eq:optproblem, eq:optproblem2), then one sampled-data step of the closed loop (zero-order hold),
z(t_{k+1}) = exp(C_k δ) z(t_k). Everything is dimensionless, as in the paper. Where sensors fail, players report or are
disturbed, the network is what is left of sight and what is told, and every step ends with a displacement.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tadcore import _core
from tadcore._shared.arrays import as_amount, as_seed, as_trial, complex_of
from tadcore._shared.calls import public
from tadcore.game.compiled import core_world, game_of
from tadcore.game.course import Course, shapes
from tadcore.game.divergence import Divergence
from tadcore.game.outcome import Outcome
from tadcore.game.passes import Pass
from tadcore.game.synthesis import GainKind, as_gains
from tadcore.scenario.model import Scenario
from tadcore.scenarios.given import ScenarioLike, as_scenario

from .outside import Network, as_network
from .rules import refuse_between
from .run import Run
from .termination import Termination, as_termination


@public
def simulate(
    sc: ScenarioLike,
    *,
    hysteresis: float = 0.0,
    dwell: float = 0.0,
    termination: Termination = "sampled",
    seed: int = 0,
    trial: int = 0,
    network: Network | None = None,
    gains: GainKind = "scalar",
    mirror: bool = False,
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
        Not for players who are disturbed, whose path between two instants is not known.
    seed, trial : int
        What failures and disturbances are drawn from: trial i of a study with this seed has the same. Without any they
        change nothing.
    network : callable, optional
        ``f(k, t, positions, sight)``, called at every instant t_k before the step, with the positions (n + 2, dim) and
        what is seen, bool (m, N) as in `Run.adjacency`; it returns the network in use, of the same shape and type, in
        the place of ``sight`` and of what players report. The run says that its network came from outside. What the
        function raises ends the run.
    gains : {"scalar", "turning"}
        ``"turning"``, in the plane: at every instant the gains of ``tadcore.synthesize(…, gains="turning")``, blocks
        aI + bJ where such have a lower Θ than scalars. Where none have, the run is bitwise that of scalar gains.
    mirror : bool
        Whether the mirror images aI - bJ of those gains are played, whose Θ is the same. From the mirror image of the
        start they play the mirror image of the run.

        Batches, studies and maps have scalar gains.

    Returns
    -------
    Run
        The outcome, the trajectories, the network, Θ and the costs.

    Raises
    ------
    NoEquilibriumError
        The game has no equilibrium on [0, T].
    ScenarioError
        `hysteresis` or `dwell` is negative or not finite, `termination` is neither of the two or cannot be had for
        players who are disturbed, `seed` or `trial` is out of range, `network` is no function, or returns something
        else, or gains are to turn in space.

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
    key = {"seed": as_seed(seed), "trial": as_trial("trial", trial)}
    decide = as_network(network)
    sc = as_scenario(sc)
    kind = as_gains(sc, gains, mirror=mirror)
    game = game_of(sc)
    refuse_between(sc, ending)
    record = game.simulate(
        sc.positions,
        sc.visibility_radii,
        sc.capture_radii,
        hysteresis=rule["hysteresis"],
        dwell=rule["dwell"],
        continuous=ending == "continuous",
        world=core_world(sc),
        seed=key["seed"],
        trial=key["trial"],
        network=decide,
        gains=kind,
    )
    groups = ("defenders", "target", "attacker") if sc.interaction == "I1" else ("team",)
    return Run(
        scenario=sc,
        outcome=Outcome.of(record.kind, record.defender, record.time, diverged=record.diverged is not None),
        times=record.times,
        position=record.position,
        control=record.control,
        adjacency=record.adjacency,
        gains=record.gains if record.turn is None else complex_of(record.gains, record.turn),
        theta=record.theta,
        theta_terms=record.theta_terms,
        costs=dict(zip(groups, map(float, record.costs), strict=True)),
        iterations=record.iterations,
        unconverged=record.unconverged,
        certified=record.certified,
        **rule,
        passes=tuple(Pass(None if who < 0 else who, *rest) for who, *rest in record.passes),
        termination=ending,
        turning=kind != "scalar",
        mirror=kind == "mirror",
        diverged=None if record.diverged is None else Divergence(*record.diverged),
        course=_course(sc, record, **key, from_outside=decide is not None),
    )


def _course(sc: Scenario, record: _core.Record, seed: int, trial: int, *, from_outside: bool) -> Course | None:
    """What surrounded the game; of a world in which nothing can happen, and whose network is its own, nothing."""
    seen = record.seen
    if seen is None:
        return None
    shape = shapes(sc, len(record.times))

    def states(array: NDArray[np.bool_] | None, name: str, *, otherwise: bool) -> NDArray[np.bool_]:
        return np.full(shape[name], otherwise) if array is None else array

    still = np.zeros(shape["displacement"])
    return Course(
        seed=seed,
        trial=trial,
        seen=seen,
        sensor_up=states(record.sensor_up, "sensor_up", otherwise=True),
        edge_up=states(record.edge_up, "edge_up", otherwise=True),
        heard=states(record.heard, "heard", otherwise=False),
        displacement=still if record.displacement is None else record.displacement,
        from_outside=from_outside,
    )
