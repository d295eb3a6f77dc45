"""Motion and costs of a record: every step from its own row, by the exact solution under zero-order hold.

Checking each step by itself, and not the whole path, keeps the bounds tight in games whose states grow or shrink by
many orders of magnitude.
"""

from __future__ import annotations

import numpy as np

from tadcore._shared.arrays import Floats
from tadcore.simulation.run import Run
from tadcore.verification.oracle.matrices import Matrices
from tadcore.verification.oracle.sampled_data import DOUBT, sampled_steps, stiffness
from tadcore.verification.report import Check, number

from .claims import RECORD
from .ending import TINY

_EPS = float(np.finfo(np.float64).eps)


def closed_loops(m: Matrices, rows: Floats) -> Floats:
    """ż = Cz over every step, with the attacker's displacement as last state, shape (L, N + 1, N + 1)."""
    length, size = len(rows) - 1, m.size
    loop = np.zeros((length, size + 1, size + 1))
    loop[:, :size, :size] = m.B @ rows[:-1]
    loop[:, size, :size] = rows[:-1, -1]
    return loop


def check_motion(run: Run, m: Matrices, rows: Floats) -> list[Check]:
    """Check motion relative to the attacker, and the attacker's own path.

    Parameters
    ----------
    run : Run
        The run, of at least one step.
    m : Matrices
        Its matrices.
    rows : ndarray, shape (L + 1, n + 2, N)
        Feedback rows of every player in every row of the record.

    Returns
    -------
    list of Check
        ``record.motion`` and ``record.attacker``; each names the first instant that a step does not lead to.
    """
    loop, step = closed_loops(m, rows), run.scenario.horizon / run.scenario.steps
    transition, _ = sampled_steps(loop, step)
    at, size = run.position, m.size
    z = at[:, :-1] - at[:, -1:]
    reach = np.abs(at).max(axis=(1, 2))
    extent = np.abs(z).max(axis=(1, 2))
    gain = 1.0 + np.abs(transition).sum(axis=2).max(axis=1)
    # positions are stored rounded, far from the origin more than relative ones
    rounded = 4.0 * _EPS * (gain * reach[:-1] + reach[1:])
    doubt = DOUBT * np.maximum(stiffness(loop, step), 1.0)
    moved = transition[:, :, :size] @ z[:-1]
    if run.course is not None:
        shock = run.course.displacement[:-1]
        moved[:, :size] += shock[:, :-1] - shock[:, -1:]
        moved[:, size] += shock[:, -1]
    found = []
    for name, off in (
        ("record.motion", np.abs(z[1:] - moved[:, :size]).max(axis=(1, 2))),
        ("record.attacker", np.abs(at[1:, -1] - at[:-1, -1] - moved[:, size]).max(axis=1)),
    ):
        claim = RECORD[name]
        scale = np.maximum(np.maximum(extent[:-1], extent[1:]) + rounded / claim.bound, TINY)
        value = off / scale
        beyond = np.flatnonzero(value - doubt * gain > claim.bound)
        k = int(beyond[0]) if len(beyond) else int(np.argmax(value))  # where it first goes astray
        where = f"t = {run.times[k + 1]:.6g}"
        found.append(claim.judge(float(value[k]), where, doubt=float(doubt[k] * gain[k])))
    return found


def check_costs(run: Run, m: Matrices, rows: Floats) -> Check:
    """How far J of any party is from its objective along the record, relative to the sum of the absolute terms."""
    claim = RECORD["record.costs"]
    groups = ("defenders", "target", "attacker") if run.scenario.interaction == "I1" else ("team",)
    wanted = f"a number each for {', '.join(groups)}"
    named = isinstance(run.costs, dict) and set(run.costs) == set(groups)
    if not named or not all(isinstance(cost, float) for cost in run.costs.values()):
        return claim.judge(1.0, f"costs are not {wanted}")
    # all are objectives in I1; in I2 the attacker minimises J
    kept = [0, 1, 2] if run.scenario.interaction == "I1" else [m.parties.index("attacker")]
    Q, F, effort, G = m.Q[kept], m.F[kept], m.effort[kept], rows[:-1]
    loop, step = m.B @ G, run.scenario.horizon / run.scenario.steps
    # the integrands, and the size of what cancels in them
    both = ((Q, effort), (np.abs(Q), np.abs(effort)))
    weights = [q + np.swapaxes(G, 1, 2) @ (e[:, None] * G) for Qs, es in both for q, e in zip(Qs, es, strict=True)]
    _, gramian = sampled_steps(loop, step, np.stack(weights))
    z = run.position[:, :-1] - run.position[:, -1:]
    running = 0.5 * np.einsum("kix,pkij,kjx->p", z[:-1], gramian, z[:-1], optimize=True)
    terminal = 0.5 * np.einsum("ix,pij,jx->p", z[-1], np.concatenate([F, np.abs(F)]), z[-1])
    cost, scale = (running + terminal).reshape(2, -1)
    recorded = np.array([run.costs[group] for group in groups])
    off = np.where(np.isfinite(recorded), np.abs(recorded - cost) / np.maximum(scale, TINY), 1.0)
    p = int(np.argmax(off))
    doubt = DOUBT * max(float(stiffness(loop, step).max(initial=0.0)), 1.0)
    return claim.judge(float(off[p]), f"J of the {groups[p]} = {number(float(cost[p]))}", doubt=doubt)
