"""Theorem consistency: where everyone sees everyone, Θ = 0 and the control is that of the feedback Nash equilibrium.

Where they do not, Θ says how far the indices J^Ad are from the players' own, term by term: the difference of the two is
½∫(‖z‖²_{ΔQ} - 2u_dᵀS₁z)dt in I1 (eq:Jbs) and ½∫(‖z‖²_{ΔQ} + 2u_dᵀS₂z + 2u_τᵀS₃z)dt in I2 (eq:obj:zero_sum_stru).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tadcore._shared.arrays import Floats
from tadcore.game.recorded import scalar_gains
from tadcore.game.synthesis import synthesize, theta_terms
from tadcore.simulation.run import Run
from tadcore.verification.oracle.criterion import held
from tadcore.verification.oracle.matrices import FeedbackSolution, stacked_rows
from tadcore.verification.report import Check, Measurement, VerificationReport

if TYPE_CHECKING:
    import xarray


_ROWS, _THETA = 1e-9, 1e-16
_SOURCE = "thm:consistency"


def index_distance(run: Run) -> xarray.Dataset:
    """How far the indices are from the players' own over time: Θ and each of its terms.

    Parameters
    ----------
    run : Run
        The run.

    Returns
    -------
    xarray.Dataset
        ``theta`` over time, ``term`` the unweighted squared norms (reduced) over (time, term), ``share`` the part of
        Θ that each weighed term makes up (0 where Θ = 0), and ``everyone`` whether everyone sees everyone.
    """
    import xarray as xr

    weighed = run.theta_terms * np.array(run.scenario.synthesis_weights)
    total = weighed.sum(axis=1, keepdims=True)
    share = np.divide(weighed, total, out=np.zeros_like(weighed), where=total > 0)
    return xr.Dataset(
        {
            "theta": ("time", run.theta),
            "term": (("time", "name"), run.theta_terms),
            "share": (("time", "name"), share),
            "everyone": ("time", run.adjacency.all(axis=(1, 2))),
        },
        coords={"time": run.times, "name": list(theta_terms(run.scenario.interaction))},
    )


def _team(run: Run, own: Floats, scale: float) -> Check:
    """How far the rows of players that know everything are from the equilibrium, under the team criterion."""
    length = len(own[: len(run.times) - 1])
    whole = held(run.scenario, run.adjacency[:length])
    off = np.where(whole, np.abs(scalar_gains(run)[:length] - own[:length]).max(axis=2), 0.0) / scale
    k, i = np.unravel_index(int(np.argmax(off)), off.shape)
    remedy = "who knows everything must play its row of the equilibrium: the paper's criterion was used"
    where = f"{np.count_nonzero(whole)} rows" + (
        f", {run.scenario.players[i]} at t = {run.times[k]:.6g}" if off[k, i] else ""
    )
    return Check("consistency.team", float(off[k, i]), _ROWS, run.converged, remedy, _SOURCE, where)


def check_consistency(run: Run, equilibrium: FeedbackSolution) -> VerificationReport:
    """Check Theorem consistency along a run, and at three instants whatever the run's networks.

    Parameters
    ----------
    run : Run
        The run.
    equilibrium : Equilibrium
        The scenario's Riccati solution.

    Returns
    -------
    VerificationReport
        Θ, gains and controls where everyone sees everyone.
    """
    sc = run.scenario
    m, length = len(sc.constrained), len(run.times) - 1
    rows = stacked_rows(equilibrium.feedback, sc.players)
    own, scale = rows[:, :m], float(np.abs(rows).max())
    largest = max(float(np.abs(P).max()) for P in equilibrium.P.values()) ** 4
    remedy = "with full sight the gains must be those of the equilibrium: the synthesis missed its minimum"

    gain = theta = 0.0
    converged = True
    for k in sorted({0, sc.steps // 2, sc.steps}):
        found = synthesize(sc, step=k, adjacency=np.ones((m, sc.n + 1), dtype=bool))
        gain = max(gain, float(np.abs(found.rows - own[k]).max()) / scale)
        theta = max(theta, found.theta / largest)
        converged &= found.converged
    where = "t = 0, T/2, T"
    checks = [
        Check("consistency.synthesis", gain, _ROWS, converged, remedy, _SOURCE, where),
        Check("consistency.theta", theta, _THETA, converged, remedy, _SOURCE, where),
    ]
    measured, notes = [], []
    full = np.flatnonzero(run.adjacency[:length].all(axis=(1, 2)))
    if len(full):
        z = run.position[full, :-1] - run.position[full, -1:]
        expected = own[full] @ z
        rounded = 4.0 * float(np.finfo(np.float64).eps) / _ROWS * float(np.abs(run.position).max())
        size = scale * max(float(np.abs(z).max()) + rounded, 1e-300)
        off = float(np.abs(scalar_gains(run)[full] - own[full]).max()) / scale
        control = float(np.abs(run.control[full, :m] - expected).max()) / size
        where = f"{len(full)} of {length} instants"
        least = float(run.theta[full].max()) / largest
        checks += [
            Check("consistency.run.gains", off, _ROWS, run.converged, remedy, _SOURCE, where),
            Check("consistency.run.theta", least, _THETA, run.converged, remedy, _SOURCE, where),
            Check("consistency.run.control", control, _ROWS, run.converged, remedy, _SOURCE, where),
        ]
    elif sc.criterion != "component":
        notes.append("in this run nowhere does everyone see everyone: consistency is checked off the run only")
    if sc.criterion == "component":
        checks.append(_team(run, own, scale))
    limited = np.setdiff1d(np.arange(length), full)
    if len(limited):
        mean = float(run.theta[limited].mean())
        measured.append(Measurement("consistency.theta.mean", mean, "mean Θ where someone does not see someone"))
        price = run.theta_price
        k = int(np.argmax(price))
        meaning = (
            f"mean Θ under the team criterion less Θ under the paper's, there; {price[k]:.6g} at t = {run.times[k]:.6g}"
        )
        measured.append(Measurement("consistency.price.mean", float(price[limited].mean()), meaning))
        for name, values in zip(theta_terms(sc.interaction), run.theta_terms[limited].T, strict=True):
            measured.append(
                Measurement(f"consistency.{name}.mean", float(values.mean()), f"mean ‖{name}‖², unweighted")
            )
    return VerificationReport("consistency", tuple(checks), tuple(measured), tuple(notes))
