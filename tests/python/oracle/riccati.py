"""eq:Riccati and eq:RDE on the grid, in full 2N x 2N matrices; the reduced Hamiltonian form of I2; the escape time.

Time runs backward: s = T - t. Every term is formed as printed, products of a matrix and of its transpose included.
"""

from functools import cache

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from .model import GROUPS

LARGE = 1e9


class EscapeError(Exception):
    """The solution leaves every bound before t = 0."""

    def __init__(self, backward_time):
        super().__init__(f"no solution beyond T - t = {backward_time!r}")
        self.backward_time = backward_time


def derivative(game, P, mats):
    """Return dP/dt of every group, as printed. `P` has shape (groups, size, size)."""
    _, _, S, Q, _ = mats
    if game.interaction == "I2":
        (p,) = P
        return np.array([-Q["team"] + p @ (S["a"] - S["dtau"]) @ p])
    Pd, Pt, Pa = P
    Sd, St, Sa = S["d"], S["tau"], S["a"]
    return np.array(
        [
            Pd @ Sd @ Pd + Pd @ St @ Pt + Pd @ Sa @ Pa + Pt @ St @ Pd + Pa @ Sa @ Pd - Q["d"],
            Pt @ Sd @ Pd + Pt @ St @ Pt + Pt @ Sa @ Pa + Pd @ Sd @ Pt + Pa @ Sa @ Pt - Q["tau"],
            Pa @ Sd @ Pd + Pa @ St @ Pt + Pa @ Sa @ Pa + Pd @ Sd @ Pa + Pt @ St @ Pa - Q["a"],
        ]
    )


def integrate(game, *, axes=2, times=None, horizon=None, rtol=1e-13):
    """Integrate from T backward by DOP853; return P at `times` (default: the grid), (times, groups, size, size).

    Raises EscapeError with the backward time of the pole if the solution does not reach the far end.
    """
    mats = game.matrices(axes)
    F = np.array([mats[4][p] for p in (("d", "tau", "a") if game.interaction == "I1" else ("team",))])
    horizon = game.horizon if horizon is None else horizon
    nodes = horizon - (game.times if times is None else np.asarray(times))

    def backward(_, y):
        return -derivative(game, y.reshape(F.shape), mats).ravel()

    def escapes(_, y):
        return np.linalg.norm(y) - LARGE

    escapes.terminal = True
    order = np.argsort(nodes)
    # Where stiff weights keep the error estimate above the tightest tolerance for rounding alone, the next is taken.
    for tolerance in (rtol, 10 * rtol, 100 * rtol):
        with np.errstate(over="ignore", invalid="ignore"):
            solution = solve_ivp(
                backward,
                (0.0, horizon),
                F.ravel(),
                method="DOP853",
                rtol=tolerance,
                atol=tolerance * max(1.0, np.abs(F).max()),
                t_eval=np.clip(nodes[order], 0.0, horizon),
                dense_output=True,
                events=escapes,
            )
        end = solution.sol.t_max
        if solution.status == 1 or (solution.status < 0 and np.linalg.norm(solution.sol(end)) > np.sqrt(LARGE)):
            raise EscapeError(_pole(solution.sol, backward))
        if solution.status == 0:
            break
    else:
        raise RuntimeError(f"DOP853 stops at T - t = {end!r} where the solution is not large")
    out = np.empty((len(nodes), *F.shape))
    out[order] = solution.y.T.reshape(out.shape)
    return out


def hamiltonian(game, times=None, horizon=None):
    """I2 in closed form: P = Y X^-1 with [X; Y]' = H [X; Y] and X(T) = I, Y(T) = F; reduced, (times, 1, N, N)."""
    _, _, S, Q, F = game.matrices(1)
    N = game.N
    horizon = game.horizon if horizon is None else horizon
    H = np.block([[np.zeros((N, N)), S["dtau"] - S["a"]], [-Q["team"], np.zeros((N, N))]])
    out = []
    for t in game.times if times is None else times:
        XY = expm(-H * (horizon - t)) @ np.vstack([np.eye(N), F["team"]])
        P = np.linalg.solve(XY[:N].T, XY[N:].T).T
        out.append([(P + P.T) / 2])
    return np.array(out)


def escape_time(game, longest, rtol=1e-13):
    """Backward time at which the solution escapes, or None if it lives up to `longest`."""
    try:
        integrate(game, axes=1, times=[0.0], horizon=longest, rtol=rtol)
    except EscapeError as pole:
        return pole.backward_time
    return None


def _pole(solution, backward):
    """Where ‖P‖ = C (s* - s)^-α ends, from ‖P‖/‖P‖' = (s* - s)/α on the last stretch.

    Exact in I2, where α = 1. In I1 this is a few digits at best: see the module escape.
    """
    end = solution.t_max

    def lag(s):
        y = solution(s)
        return (y @ y) / (y @ backward(s, y))

    s = end - np.array([3.0, 1.0]) * lag(end)
    slope, value = np.polyfit(s - end, [lag(x) for x in s], 1)
    return float(end - value / slope)


@cache
def equilibrium(game):
    """Reduced P on the grid, (K+1, groups, N, N), from the full equations: every other row and column of the blocks."""
    P = integrate(game, axes=2)[..., ::2, ::2]
    P = (P + P.swapaxes(-1, -2)) / 2
    P.setflags(write=False)
    return P


def feedback(game, P):
    """FNE feedback rows of d1…dn, target, attacker for reduced P of shape (groups, N, N)."""
    B, R, _, _, _ = game.matrices(1)
    gain = {p: np.linalg.inv(R[p]) @ B[p].T for p in B}
    if game.interaction == "I1":
        return np.vstack([-gain[p] @ P[i] for i, p in enumerate(("d", "tau", "a"))])
    return np.vstack([gain["dtau"] @ P[0], -gain["a"] @ P[0]])


def groups(game):
    return GROUPS[game.interaction]
