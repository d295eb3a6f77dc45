"""The exact best response of a party to the frozen feedback of the others, and what it would save.

With G_j for j ≠ p frozen, party p faces a problem of its own,

    minimise ½‖z(T)‖²_{F_p} + ½∫(‖z‖²_{W} + ‖u_p‖²_{R_p})dt,   ż = (Σ_{j≠p} B_j G_j) z + B_p u_p,

whose exact answer is one single-player Riccati equation for Π (Engwerda, LQ Dynamic Optimization and Differential
Games, section 5.1); what it pays when it keeps its own G_p is one Lyapunov equation for Λ. The regret
½z₀ᵀ(Λ - Π)z₀ is never negative, for any feedback, and zero exactly for an equilibrium. A party whose own problem has
no solution on [0, T] can win without bound: its regret is infinite.

Both matrices are made symmetric wherever they are used. The form PA + AᵀP reads a rounding asymmetry W of P as
WA - AᵀW, which the closed loop does not damp: over a long horizon it takes over, in games whose closed loop is stable.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import make_interp_spline

from tadcore._shared.arrays import Floats
from tadcore.scenario.model import Scenario

from .flow import TooStiffError
from .matrices import Matrices, matrices_of

REGRET = 1e-9
"""The largest regret, relative to its scale, that counts as none."""
_RTOL = 1e-12
_ESCAPED = 1e9
_MOST_CALLS = 50_000


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

    @property
    def relative(self) -> float:
        """The regret relative to the scale."""
        if not np.isfinite(self.best):
            return np.inf
        return self.regret / max(self.scale, 1e-300) if self.regret else 0.0


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
    spline, smooth = _spline(sc, feedback), is_smooth(sc, feedback)
    z = sc.positions[:-1] - sc.positions[-1]
    found = []
    for p in range(len(m.parties)):
        tight = _respond(sc, m, p, spline, z, _RTOL)
        decided = smooth and tight.converged
        if decided:
            loose = _respond(sc, m, p, spline, z, 100.0 * _RTOL)
            decided = loose.converged and _agree(tight, loose)
        found.append(replace(tight, converged=decided))
    return tuple(found)


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
        kept, best = 0.5 * (kept + kept.T), 0.5 * (best + best.T)
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


def _agree(tight: BestResponse, loose: BestResponse) -> bool:
    """Whether two tolerances a hundredfold apart say the same of the regret.

    Not of cost and best response, whose errors are one and the same: they are integrated together, step by step.
    """
    return tight.regret == loose.regret or abs(tight.regret - loose.regret) <= REGRET * tight.scale


def is_smooth(sc: Scenario, feedback: Floats) -> bool:
    """Whether the grid is fine enough to play between its instants: a regret is quadratic in the gains' error."""
    return _interpolation_error(sc, feedback) ** 2 <= 0.1 * REGRET


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
