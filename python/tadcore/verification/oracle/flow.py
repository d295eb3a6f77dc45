"""Continuous time on the grid: Gauss nodes in every step, the Riccati flow and the state at them.

A step [t_k, t_k + δ] carries q Gauss-Legendre nodes. The state is propagated by Gauss collocation with those nodes
(order 2q; Hairer, Nørsett and Wanner, Solving ODEs I, section II.7): quadrature at the same nodes has matching order.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from scipy.integrate import solve_ivp

from tadcore._shared.arrays import Floats

from .matrices import Matrices

NODES = 5
"""Gauss nodes in a step: order 10."""
_CHUNK_BYTES = 64 * 2**20
_MOST_CALLS = 600


class TooStiffError(Exception):
    """An integration took more evaluations than any solution that exists needs."""


@cache
def gauss(q: int = NODES) -> tuple[Floats, Floats, Floats]:
    """Nodes c, weights b and collocation matrix a on [0, 1]."""
    x, w = np.polynomial.legendre.leggauss(q)
    c: Floats = 0.5 * (x + 1.0)
    powers = np.arange(q)
    # a integrates every polynomial of degree below q exactly: Σ_j a_ij c_j^m = c_i^(m+1) / (m+1)
    at, integrals = c[:, None] ** powers, c[:, None] ** (powers + 1) / (powers + 1)
    a = np.asarray(np.linalg.solve(at.T, integrals.T).T, dtype=np.float64)
    return c, np.asarray(0.5 * w, dtype=np.float64), a


def riccati_within(m: Matrices, right: Floats, step: float, *, rtol: float = 1e-12) -> tuple[Floats, Floats] | None:
    """P inside steps, from the values at their right ends, by SciPy's DOP853.

    Parameters
    ----------
    m : Matrices
        The game.
    right : ndarray, shape (parties, k, N, N)
        Value matrices at the right ends of k steps.
    step : float
        δ.
    rtol : float
        Relative tolerance.

    Returns
    -------
    nodes : ndarray, shape (parties, k, q, N, N)
        At the Gauss nodes, in order of time.
    left : ndarray, shape (parties, k, N, N)
        At the left ends. None is returned in place of both where the integration breaks down.
    """
    parties, count, size, _ = right.shape
    chunk = max(_CHUNK_BYTES // (8 * 16 * parties * size * size), 1)
    nodes = np.empty((parties, count, NODES, size, size))
    left = np.empty_like(right)
    for first in range(0, count, chunk):
        at = _back_one_step(m, right[:, first : first + chunk], step, rtol)
        if at is None:
            return None
        nodes[:, first : first + chunk] = at[:, :, -2::-1]
        left[:, first : first + chunk] = at[:, :, -1]
    return nodes, left


def _back_one_step(m: Matrices, right: Floats, step: float, rtol: float) -> Floats | None:
    """P from right ends to left ends: at the nodes, last first, and at the left ends; None where it breaks down."""
    calls = iter(range(_MOST_CALLS))

    def backward(_s: float, y: Floats) -> Floats:
        if next(calls, None) is None:
            raise TooStiffError
        return -m.slope(y.reshape(right.shape)).ravel()

    asked = np.append(1.0 - gauss()[0][::-1], 1.0) * step
    small = rtol * max(float(np.abs(right).max()), 1e-300)
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            found = solve_ivp(
                backward, (0.0, step), right.ravel(), method="DOP853", t_eval=asked, rtol=rtol, atol=small
            )
    except TooStiffError:
        return None
    if not found.success or not np.isfinite(found.y).all():
        return None
    return np.asarray(np.moveaxis(found.y.reshape(*right.shape, -1), -1, 2), dtype=np.float64)


def propagate(loop: Callable[[slice], Floats], count: int, start: Floats, step: float) -> tuple[Floats, Floats]:
    """The state at every node and every end of a linear system ż = C(t)z.

    Parameters
    ----------
    loop : callable
        C at the nodes of a slice of steps, shape (k, q, D, D).
    count : int
        Number of steps.
    start : ndarray, shape (D, c)
        The state at the first instant.
    step : float
        δ.

    Returns
    -------
    nodes : ndarray, shape (count, q, D, c)
    ends : ndarray, shape (count + 1, D, c)
    """
    _, b, a = gauss()
    q, size = len(b), len(start)
    chunk = max(_CHUNK_BYTES // (8 * 3 * (q * size) ** 2), 1)
    nodes = np.empty((count, q, *start.shape))
    ends = np.empty((count + 1, *start.shape))
    ends[0] = start
    initial = np.tile(np.eye(size), (q, 1))
    for first in range(0, count, chunk):
        C = loop(slice(first, min(first + chunk, count)))
        system = np.eye(q * size) - step * np.einsum("ij,kjab->kiajb", a, C).reshape(len(C), q * size, q * size)
        stages = np.linalg.solve(system, np.broadcast_to(initial, (len(C), q * size, size)))
        stages = stages.reshape(len(C), q, size, size)
        through = np.eye(size) + step * np.einsum("j,kjab->kab", b, C @ stages)
        for k in range(len(C)):
            nodes[first + k] = stages[k] @ ends[first + k]
            ends[first + k + 1] = through[k] @ ends[first + k]
    return nodes, ends


def integral(values: Floats, step: float) -> float:
    """∫ over all steps of something known at the nodes, shape (count, q)."""
    return float(step * np.sum(values @ gauss()[1]))
