"""Theorems fbne and zero:sum:game: the feedback is a Nash equilibrium of the game in which everyone sees everything.

Two questions, each by SciPy and from the scenario's weights alone.

*Does P solve the Riccati equation?* Every P(t_{k+1}) is carried one step back by DOP853 and compared with P(t_k).

*Does anyone gain by deviating?* With the others' feedback frozen, G_j for j ≠ p, party p faces a problem of its own,

    minimise ½‖z(T)‖²_{F_p} + ½∫(‖z‖²_{W} + ‖u_p‖²_{R_p})dt,   ż = (Σ_{j≠p} B_j G_j) z + B_p u_p,

whose exact answer is one single-player Riccati equation for Π (Engwerda, LQ Dynamic Optimization and Differential
Games, section 5.1); what it pays when it keeps its own G_p is one Lyapunov equation for Λ. The regret
½z₀ᵀ(Λ - Π)z₀ is never negative, for any feedback, and zero exactly for an equilibrium. A party whose own problem has
no solution on [0, T] can win without bound: its regret is infinite.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import make_interp_spline

from tadcore.equilibrium import solve_equilibrium

from ._flow import TooStiffError, riccati_within
from ._matrices import FeedbackSolution, Floats, Matrices, matrices_of, stacked_rows
from .report import Check, Measurement, VerificationReport

if TYPE_CHECKING:
    from tadcore.scenario import Scenario

__all__ = ["BestResponse", "best_responses", "check_equilibrium", "riccati_defect"]

_RTOL = 1e-12
_ESCAPED = 1e9
_MOST_CALLS = 50_000
_FEWEST = 800
_DEFECT, _TERMINAL, _FEEDBACK, _REGRET = 1e-10, 1e-14, 1e-12, 1e-9


@dataclass(frozen=True)
class BestResponse:
    """What one party could gain by leaving the profile.

    Attributes
    ----------
    party : str
        ``"defenders"``, ``"target"``, ``"attacker"`` in I1; ``"team"``, ``"attacker"`` in I2.
    cost : float
        J of the party when everyone keeps the profile (for the team -J: it maximises).
    best : float
        J of its best response; -inf where it can win without bound.
    converged : bool
        Whether the integration reached its tolerance and two tolerances agree.
    scale : float
        Sum of the absolute terms of the cost, which may cancel in it: what errors are relative to.
    """

    party: str
    cost: float
    best: float
    converged: bool
    scale: float

    @property
    def regret(self) -> float:
        """What the best response saves; zero at an equilibrium."""
        return self.cost - self.best


def riccati_defect(sc: Scenario, equilibrium: FeedbackSolution) -> dict[str, Floats]:
    """How far P(t_k) is from P(t_{k+1}) carried back one step, by party.

    Parameters
    ----------
    sc : Scenario
        The game.
    equilibrium : Equilibrium
        P on the grid.

    Returns
    -------
    dict of str to ndarray, shape (K,)
        Largest entry of the difference at every step, relative to the largest of the party's P on it; inf
        throughout where the flow breaks down.
    """
    m = matrices_of(sc)
    values = m.values(equilibrium.P)
    found = riccati_within(m, values[:, 1:], sc.horizon / sc.steps)
    if found is None:
        return {party: np.full(sc.steps, np.inf) for party in m.parties}
    off = np.abs(found[1] - values[:, :-1]).max(axis=(2, 3))
    scale = np.maximum(np.abs(values[:, :-1]).max(axis=(2, 3)), np.abs(values[:, 1:]).max(axis=(2, 3)))
    relative = np.divide(off, scale, out=np.where(off > 0, np.inf, 0.0), where=scale > 0)
    return dict(zip(m.parties, relative, strict=True))


def best_responses(sc: Scenario, feedback: Floats) -> tuple[BestResponse, ...]:
    """The exact best response of each party to the others' frozen feedback, from the scenario's own start.

    Parameters
    ----------
    sc : Scenario
        The game and its initial state.
    feedback : ndarray, shape (K + 1, n + 2, N)
        Rows of u = Gz on the grid for d1 … dn, target, attacker; between instants their quintic spline is played.

    Returns
    -------
    tuple of BestResponse
        One for each party, in the order of `BestResponse.party`.
    """
    m = matrices_of(sc)
    spline = _spline(sc, feedback)
    smooth = _interpolation_error(sc, feedback) ** 2 <= 0.1 * _REGRET  # a regret is quadratic in the gains' error
    z = sc.positions[:-1] - sc.positions[-1]
    found = []
    for p in range(len(m.parties)):
        tight, loose = (_respond(sc, m, p, spline, z, rtol) for rtol in (_RTOL, 100.0 * _RTOL))
        stable = _agree(tight.cost, loose.cost, tight.scale) and _agree(tight.best, loose.best, tight.scale)
        found.append(replace(tight, converged=tight.converged and loose.converged and smooth and stable))
    return tuple(found)


def _agree(one: float, other: float, scale: float) -> bool:
    """Whether the tighter of two tolerances a hundredfold apart is well within a bound of the answer.

    An expanding game can amplify rounding without bound: then it is not.
    """
    return one == other or abs(one - other) <= 3.0 * _REGRET * scale


def _spline(sc: Scenario, feedback: Floats) -> Callable[[Any], Any]:
    times = np.linspace(0.0, sc.horizon, len(feedback))
    odd: Callable[[Any], Any] = make_interp_spline(times, feedback, k=min(5, (len(feedback) - 2) // 2 * 2 + 1), axis=0)
    return odd


def _interpolation_error(sc: Scenario, feedback: Floats) -> float:
    """Relative error of the spline between instants, from the spline through every second one (order 6)."""
    if len(feedback) < 13:
        return np.inf
    kept = feedback[: (len(feedback) - 1) // 2 * 2 + 1]
    shorter = sc.horizon * (len(kept) - 1) / (len(feedback) - 1)
    coarse = make_interp_spline(np.linspace(0.0, shorter, len(kept) // 2 + 1), kept[::2], k=5, axis=0)
    skipped = np.linspace(0.0, shorter, len(kept))[1::2]
    return float(np.abs(coarse(skipped) - kept[1::2]).max() / max(np.abs(kept).max(), 1e-300)) / 64.0


def _respond(sc: Scenario, m: Matrices, p: int, spline: Callable[[Any], Any], z: Floats, rtol: float) -> BestResponse:
    """Integrate Λ (the profile's cost) and Π (the best response's) of one party, backward from T."""
    own, size = m.members[p], m.size
    Bp = m.B[:, own]
    S = Bp @ np.diag(1.0 / m.r[own]) @ Bp.T
    limit = _ESCAPED * max(1.0, float(np.abs(m.F[p]).max()), float(np.abs(m.Q[p]).max()))

    calls = iter(range(_MOST_CALLS))

    def backward(s: float, y: Floats) -> Floats:
        if next(calls, None) is None:
            raise TooStiffError
        kept, best = y.reshape(2, size, size)
        G = np.asarray(spline(sc.horizon - s))
        C = m.B @ G
        paid = m.Q[p] + G.T @ (m.effort[p][:, None] * G)
        others = G.copy()
        others[own] = 0.0
        A = m.B @ others
        free = m.Q[p] + others.T @ (m.effort[p][:, None] * others)
        kept_C, best_A = kept @ C, best @ A
        up = kept_C + kept_C.T + paid
        down = best_A + best_A.T - best @ S @ best + free
        return np.concatenate([up.ravel(), down.ravel()])

    def escaped(_s: float, y: Floats) -> float:
        return limit - float(np.abs(y).max())

    escaped.terminal = True  # type: ignore[attr-defined]
    scale = max(float(np.abs(m.F[p]).max()), float(np.abs(m.Q[p]).max()) * sc.horizon)
    start = np.concatenate([m.F[p].ravel(), m.F[p].ravel()])
    try:
        found = solve_ivp(
            backward, (0.0, sc.horizon), start, method="DOP853", rtol=rtol, atol=rtol * scale, events=escaped
        )
    except TooStiffError:
        return BestResponse(m.parties[p], np.nan, np.nan, False, np.nan)
    kept, best = found.y[:, -1].reshape(2, size, size)
    cost = 0.5 * float(np.sum(z * (kept @ z)))
    scale = 0.5 * float(np.sum(np.abs(z) * (np.abs(kept) @ np.abs(z))))
    if found.status == 1:
        return BestResponse(m.parties[p], cost, -np.inf, True, scale)
    return BestResponse(m.parties[p], cost, 0.5 * float(np.sum(z * (best @ z))), bool(found.success), scale)


def check_equilibrium(sc: Scenario, equilibrium: FeedbackSolution | None = None) -> VerificationReport:
    """Check that a Riccati solution solves its equations and that its feedback is a Nash equilibrium.

    Parameters
    ----------
    sc : Scenario
        The game and its initial state.
    equilibrium : Equilibrium, optional
        What to check; `tadcore.solve_equilibrium` of the scenario by default.

    Returns
    -------
    VerificationReport
        Riccati defect and terminal value, feedback rows, and the regret of each party relative to what it pays.
    """
    eq = solve_equilibrium(sc) if equilibrium is None else equilibrium
    m = matrices_of(sc)
    values = m.values(eq.P)
    rows = stacked_rows(eq.feedback, sc.players)
    theorem = "thm:fbne" if sc.interaction == "I1" else "thm:zero:sum:game"
    riccati, law = ("eq:Riccati", "eq:1d") if sc.interaction == "I1" else ("eq:RDE", "eq:zero_sum_control1, 2")
    checks = []
    for party, defect in riccati_defect(sc, eq).items():
        k = int(np.argmax(defect))
        remedy = "P does not solve its equation there: solve the equilibrium again, and report this scenario"
        where = f"t = {float(eq.times[k]):.6g}"
        value = float(defect[k])
        checks.append(Check(f"fne.riccati.{party}", value, _DEFECT, value < np.inf, remedy, riccati, where))
    terminal = float(np.abs(values[:, -1] - m.F).max() / np.abs(m.F).max())
    remedy = "P(T) must be the terminal weights"
    checks.append(Check("fne.terminal", terminal, _TERMINAL, True, remedy, f"{theorem}, P(T) = F"))
    off = np.abs(rows - m.rows(values)).max(axis=(1, 2))
    own = float(off.max() / max(np.abs(rows).max(), 1e-300))
    remedy = "the feedback must be that of P, u = -R⁻¹BᵀPz"
    checks.append(Check("fne.feedback", own, _FEEDBACK, True, remedy, law, f"t = {eq.times[int(off.argmax())]:.6g}"))
    measured = []
    fine = sc
    if equilibrium is None and sc.steps < _FEWEST:  # the same equilibrium at more instants, to play between them
        fine = sc.replace(step=sc.horizon / (sc.steps * -(-_FEWEST // sc.steps)))
        rows = stacked_rows(solve_equilibrium(fine).feedback, sc.players)
    for found in best_responses(fine, rows):
        relative = found.regret / max(found.scale, 1e-300) if found.regret else 0.0
        if not np.isfinite(found.best):
            relative = np.inf
        remedy = f"{found.party} gain by deviating: this feedback is no equilibrium of this game"
        name = f"fne.regret.{found.party}"
        checks.append(Check(name, abs(relative), _REGRET, found.converged, remedy, theorem, f"J = {found.cost:.6g}"))
        measured.append(
            Measurement(f"fne.J.{found.party}", found.cost, "cost of the equilibrium from this start, to T")
        )
    return VerificationReport(f"equilibrium of {sc!r}", tuple(checks), tuple(measured))
