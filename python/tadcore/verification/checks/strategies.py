"""Network, gains, controls and Θ of a record: each row from the positions, the network and P at its instant."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import Floats
from tadcore.game.recorded import scalar_gains
from tadcore.scenario.model import Scenario
from tadcore.simulation.run import Run
from tadcore.verification.oracle.indices import adapted_weights, theta_terms
from tadcore.verification.oracle.matrices import Matrices
from tadcore.verification.oracle.optimality import CRITICAL, Optimality
from tadcore.verification.report import Check

from .claims import RECORD
from .ending import TINY, distances

_EPS = float(np.finfo(np.float64).eps)


def check_network(run: Run) -> Check:
    """How far a pair is from its visibility radius where an edge contradicts the distance, relative to both."""
    last = max(len(run.times) - 1, 1)  # in a game over at t = 0 the only row holds the network of the start
    beyond = network_errors(run.scenario, run.position[:last], run.adjacency[:last])
    k, i, j = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
    players = run.scenario.players
    where = f"{players[i]}→{players[-1 if i == j else j]} at t = {run.times[k]:.6g}" if beyond[k, i, j] else ""
    return RECORD["record.network"].judge(float(beyond[k, i, j]), where)


def network_errors(sc: Scenario, at: Floats, adjacency: NDArray[np.bool_]) -> Floats:
    """The same for every entry of 𝒜, shape (rows, m, N); 0 where edge and distance agree."""
    m, size = len(sc.constrained), sc.n + 1
    distance = distances(at[:, :m, None], at[:, None])
    reach = np.abs(at).max(axis=-1)
    largest = reach[:, :m, None] + reach[:, None]
    each = np.arange(m)
    for pairs in (distance, largest):  # entry i is the attacker
        pairs[:, each, each] = pairs[:, :, size]
    distance, largest = distance[..., :size], largest[..., :size]
    radius = sc.visibility_radii[None, :, None]
    wrong = adjacency != (distance <= radius)
    with np.errstate(invalid="ignore"):
        beyond = np.where(np.isfinite(radius), np.abs(distance - radius) / (radius + largest), 1.0)
    return np.asarray(np.where(wrong, beyond, 0.0))


def check_admissible(run: Run) -> Check:
    """The largest part of a gain outside what the network lets its player use, relative to its row."""
    last = max(len(run.times) - 1, 1)
    blind = unseen(scalar_gains(run)[:last], run.adjacency[:last])
    k, i = np.unravel_index(int(np.argmax(blind)), blind.shape)
    where = f"{run.scenario.players[i]} at t = {run.times[k]:.6g}" if blind[k, i] else ""
    return RECORD["record.admissible"].judge(float(blind[k, i]), where)


def unseen(gains: Floats, adjacency: NDArray[np.bool_]) -> Floats:
    """For every row (rows, m) the largest part outside the row space of 𝓘_i, relative to the largest gain of all."""
    each = np.arange(gains.shape[1])
    foreign = np.where(adjacency, 0.0, np.abs(gains))
    foreign[:, each, each] = 0.0
    sees_attacker = adjacency[:, each, each]
    total = np.where(sees_attacker, 0.0, np.abs(gains.sum(axis=2)))  # else only differences z_j - z_i
    worst = np.maximum(foreign.max(axis=2), total)
    largest = np.broadcast_to(np.abs(gains).max(axis=(1, 2))[:, None], worst.shape)
    return np.asarray(np.divide(worst, largest, out=np.zeros_like(worst), where=largest > 0.0))


def control_errors(run: Run, rows: Floats, part: slice) -> Floats:
    """How far controls are from u = Gz, shape (rows, n + 2), relative to the sizes of G and z."""
    at = run.position[part]
    z = at[:, :-1] - at[:, -1:]
    off = np.abs(run.control[part] - rows[part] @ z).max(axis=2)
    rounded = 4.0 * _EPS / RECORD["record.control"].bound * np.abs(at).max(axis=(1, 2))
    size = np.abs(rows[part]).max(axis=(1, 2)) * (np.abs(z).max(axis=(1, 2)) + rounded)
    return np.asarray(off / np.maximum(size, TINY)[:, None])


def check_control(run: Run, rows: Floats) -> Check:
    """The largest of `control_errors` before the last row."""
    off = control_errors(run, rows, slice(0, -1))
    k, i = np.unravel_index(int(np.argmax(off)), off.shape)
    where = f"{run.scenario.players[i]} at t = {run.times[k]:.6g}"
    return RECORD["record.control"].judge(float(off[k, i]), where)


def theta_errors(run: Run, m: Matrices, values: Floats, part: slice) -> Floats:
    """How far Θ and its terms are from those of the gains, shape (rows,), relative to Θ of them or at rest."""
    sc, P, G = run.scenario, values[:, part], scalar_gains(run)[part]
    terms = theta_terms(sc, adapted_weights(sc, m, P, G))
    still = theta_terms(sc, adapted_weights(sc, m, P, np.zeros_like(G)))  # the size of what cancels
    largest = np.maximum(np.maximum(still, terms).max(axis=1), TINY)
    theta = np.abs(terms @ np.array(sc.synthesis_weights) - run.theta[part])
    return np.asarray(np.maximum(theta, np.abs(terms - run.theta_terms[part]).max(axis=1)) / largest)


def check_theta(run: Run, m: Matrices, values: Floats) -> Check:
    """The largest of `theta_errors` before the last row."""
    off = theta_errors(run, m, values, slice(0, -1))
    k = int(np.argmax(off))
    return RECORD["record.theta"].judge(float(off[k]), f"t = {run.times[k]:.6g}")


def check_last_row(run: Run, m: Matrices, values: Floats, rows: Floats, found: Optimality) -> Check:
    """The terminal row: the largest error of anything in it, each relative to what is accepted of it.

    Gains are accepted that are as critical as those of the rows before: ``gains.gradient`` says how critical these are.
    """
    last = slice(len(run.times) - 1, None)
    network, gains = run.adjacency[last], scalar_gains(run)[last]
    if len(run.times) > 1:
        changed = float((network[0] != run.adjacency[-2]).any())
    else:
        changed = 0.0 if run.course else float(network_errors(run.scenario, run.position[last], network).max())
    parts = {
        "network": changed / RECORD["record.network"].bound,
        "gains beyond sight": float(unseen(gains, network).max()) / RECORD["record.admissible"].bound,
        "gains": float(found.gradient[-1]) / max(CRITICAL, 10.0 * float(found.gradient[:-1].max(initial=0.0))),
        "Θ": float(theta_errors(run, m, values, last)[0]) / RECORD["record.theta"].bound,
        "controls": float(control_errors(run, rows, last).max()) / RECORD["record.control"].bound,
    }
    worst = max(parts, key=lambda name: np.nan_to_num(parts[name], nan=np.inf))
    return RECORD["record.last_row"].judge(parts[worst], f"{worst}, of what is accepted of them")
