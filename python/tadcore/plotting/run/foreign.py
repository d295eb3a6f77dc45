"""Trajectories from elsewhere, a log or another simulator, as a record that the figures of a run take."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from tadcore import _core
from tadcore._shared.arrays import as_real
from tadcore._shared.calls import public
from tadcore.errors import ScenarioError
from tadcore.game.changes import changes_of
from tadcore.game.outcome import Outcome, OutcomeKind
from tadcore.game.recorded import Recorded
from tadcore.game.sound import Sound
from tadcore.game.synthesis import theta_terms
from tadcore.scenarios.given import ScenarioLike, as_scenario


@public
def run_of(sc: ScenarioLike, times: ArrayLike, position: ArrayLike, *, control: ArrayLike | None = None) -> Recorded:
    """Make of arrays what the figures of a run take: trajectories, distances, controls, networks, animations.

    The network at every instant is that of the distances and the scenario's visibility radii, and the end that of the
    last row, by the rule of a run: an interception by the nearest defender within its capture radius, or else a capture
    where the attacker is within its own of the target, or else a timeout. There are no gains and no Θ, and their
    figures show zeros.

    Parameters
    ----------
    sc : Scenario, path or name
        Players and radii; its start is not used.
    times : array_like, shape (L + 1,)
        Increasing instants, in any steps.
    position : array_like, shape (L + 1, n + 2, dim)
        Positions, players ordered d1 … dn, target, attacker.
    control : array_like, shape (L + 1, n + 2, dim), optional
        Velocities; differences of the positions, second-order in the steps, if not given.

    Returns
    -------
    Recorded
        What every function of `tadcore.plotting` takes for a run.

    Raises
    ------
    ScenarioError
        A shape does not fit, a number is not finite, or the instants do not increase.

    Examples
    --------
    >>> import numpy as np
    >>> import tadcore
    >>> sc = tadcore.scenarios.load("paper-i1")
    >>> t = np.linspace(0.0, 1.0, 11)
    >>> log = sc.positions + 0.1 * t[:, None, None]
    >>> print(tadcore.plotting.run_of(sc, t, log).outcome)
    time runs out at t = 1
    """
    game = as_scenario(sc)
    shape = (game.n + 2, game.dim)
    at = as_real("position", position, "an array of finite numbers")
    if at.ndim != 3 or at.shape[1:] != shape or len(at) < 2 or not np.isfinite(at).all():
        rule = f"finite numbers of shape (L + 1, {shape[0]}, {shape[1]}), players ordered d1 … dn, target, attacker"
        raise ScenarioError("position", f"shape {at.shape}", rule)
    instants = as_real("times", times, "an array of increasing instants")
    if instants.shape != at.shape[:1] or not np.isfinite(instants).all() or (np.diff(instants) <= 0.0).any():
        raise ScenarioError("times", times, f"{len(at)} increasing instants, one for each row of position")
    if control is None:
        velocity = np.gradient(at, instants, axis=0, edge_order=2 if len(at) > 2 else 1)
    else:
        velocity = as_real("control", control, "an array of velocities")
        if velocity.shape != at.shape or not np.isfinite(velocity).all():
            raise ScenarioError("control", control, f"an array of finite numbers of shape {at.shape}, as position is")
    adjacency = np.array([_core.observe(row, game.visibility_radii) for row in at])
    adjacency[-1] = adjacency[-2]  # no network is formed at the end
    rows, m, size = adjacency.shape
    apart = np.linalg.norm(at[-1, :-1] - at[-1, -1], axis=-1)
    within = apart <= game.capture_radii
    nearest = int(np.argmin(np.where(within, apart, np.inf)[: game.n]))
    kind = OutcomeKind.CAPTURED if within[-1] else OutcomeKind.TIMEOUT
    kind = OutcomeKind.INTERCEPTED if within[nearest] else kind
    return Sound(
        scenario=game,
        outcome=Outcome.of(kind, nearest if kind == OutcomeKind.INTERCEPTED else -1, float(instants[-1])),
        diverged=None,
        times=instants,
        position=at,
        control=velocity,
        adjacency=adjacency,
        gains=np.zeros((rows, m, size)),
        theta=np.zeros(rows),
        theta_terms=np.zeros((rows, len(theta_terms(game.interaction)))),
        seen=adjacency,
        course=None,
        passes=(),
        network_changes=changes_of(instants[:-1], adjacency[:-1], game.players),
    )
