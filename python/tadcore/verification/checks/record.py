"""The record against the equations: network, strategies, controls and motion, recomputed from the scenario."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import Floats
from tadcore.simulation.run import Run
from tadcore.verification.oracle.adapted import Adapted
from tadcore.verification.oracle.indices import adapted_weights, theta_terms
from tadcore.verification.oracle.matrices import FeedbackSolution, stacked_rows
from tadcore.verification.report import Check, VerificationReport

_MOTION, _CONTROL, _ADMISSIBLE, _THETA, _RIM = 1e-10, 1e-12, 1e-12, 1e-10, 1e-9


def check_record(run: Run, equilibrium: FeedbackSolution) -> VerificationReport:
    """Check every recorded array of a run against the equations that define it.

    Parameters
    ----------
    run : Run
        The run, of at least one step.
    equilibrium : Equilibrium
        The scenario's Riccati solution.

    Returns
    -------
    VerificationReport
        The network from the distances, gains within what the network shows, controls from the gains, Θ from the
        gains, and the motion from the controls.
    """
    sc = run.scenario
    adapted = Adapted(run, equilibrium)
    length, m = adapted.length, len(sc.constrained)
    z = run.position[:, :-1] - run.position[:, -1:]
    extent = max(float(np.abs(z).max()), 1e-300)
    checks = [_network(run)]

    blind = _unseen(run.gains[:length], run.adjacency[:length])
    value = blind / max(float(np.abs(run.gains).max()), 1e-300) if blind else 0.0
    remedy = "a gain uses a player that is out of sight: the strategy cannot be implemented"
    checks.append(Check("record.admissible", value, _ADMISSIBLE, True, remedy, "eq:nwadapt"))

    rows = stacked_rows(equilibrium.feedback, sc.players)[:length]
    rows[:, :m] = run.gains[:length]
    expected = rows @ z[:length]
    size = max(float(np.abs(rows).max()) * extent, 1e-300)
    off = np.abs(run.control[:length] - expected).max(axis=2) / size
    k, i = np.unravel_index(int(off.argmax()), off.shape)
    where = f"{sc.players[i]} at t = {run.times[k]:.6g}"
    remedy = "the control is not the feedback of the gains and of P at that state"
    checks.append(Check("record.control", float(off.max()), _CONTROL, True, remedy, "eq:1d, eq:nwadapt", where))

    _, ends = adapted.states(adapted.played)
    drift = np.abs(ends - z).max(axis=(1, 2)) / extent
    where = f"t = {run.times[int(drift.argmax())]:.6g}"
    remedy = "the positions do not follow from the recorded gains"
    checks.append(Check("record.motion", float(drift.max()), _MOTION, True, remedy, "eq:stateequation", where))

    terms = theta_terms(sc, adapted.weights_on_grid)
    theta = terms @ np.array(sc.synthesis_weights)
    # relative to Θ of standing still, the size of what cancels where everyone sees everyone
    still = adapted_weights(sc, adapted.m, adapted.grid[:, :length], np.zeros_like(adapted.gains))
    largest = max(float(theta_terms(sc, still).max()), float(terms.max()), 1e-300)
    gap = max(float(np.abs(theta - run.theta[:length]).max()), float(np.abs(terms - run.theta_terms[:length]).max()))
    remedy = "Θ is not that of the recorded gains"
    label = "eq:errfun1" if sc.interaction == "I1" else "eq:errfun2"
    checks.append(Check("record.theta", gap / largest, _THETA, True, remedy, label))
    return VerificationReport("record", tuple(checks))


def _network(run: Run) -> Check:
    """How far a pair is from its visibility radius where the recorded edge contradicts the distance."""
    sc, length = run.scenario, len(run.times) - 1
    m, size = len(sc.constrained), sc.n + 1
    at = run.position[:length]
    distance = np.linalg.norm(at[:, :m, None] - at[:, None], axis=-1)
    entry = distance[:, :, :size].copy()
    entry[:, np.arange(m), np.arange(m)] = distance[:, :, size]
    radius = sc.visibility_radii[None, :, None]
    wrong = run.adjacency[:length] != (entry <= radius)
    beyond = np.where(wrong, np.abs(entry - radius), 0.0)
    scale = float(np.abs(at).max()) + 1e-300
    remedy = "the network is not that of the distances"
    return Check("record.network", float(beyond.max()) / scale, _RIM, True, remedy, "eq:limob")


def _unseen(gains: Floats, adjacency: NDArray[np.bool_]) -> float:
    """The largest part of a gain row outside the row space of 𝓘_i."""
    worst = 0.0
    for i in range(gains.shape[1]):
        sees = adjacency[:, i]
        foreign = np.where(sees, 0.0, gains[:, i])
        foreign[:, i] = 0.0
        total = np.where(sees[:, i], 0.0, gains[:, i].sum(axis=1))  # unseen attacker: only differences z_j - z_i
        worst = max(worst, float(np.abs(foreign).max()), float(np.abs(total).max()))
    return worst
