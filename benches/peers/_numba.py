"""What a strong user reaches in compiled Python: DOP853 with dense output, and Newton with the exact Hessian.

Both work on one Kronecker factor. The coefficients are SciPy's own. The first call of each compiles (some ten seconds).
"""

import _side
import numpy as np
from numba import njit
from scipy.integrate._ivp import dop853_coefficients as dop

A, B, C, E3, E5, D = (np.ascontiguousarray(getattr(dop, name)) for name in ("A", "B", "C", "E3", "E5", "D"))
STAGES = dop.N_STAGES


@njit
def _backward(y, out, r, r_tau, r_a, n):
    """dP/ds of the three groups for unit weights, S_p as the row selections that they are; symmetrises y."""
    N = n + 1
    P, F = y.reshape(3, N, N), out.reshape(3, N, N)
    own = np.zeros((3, N, N))
    for p in range(3):
        for i in range(N):
            for j in range(i):
                P[p, i, j] = P[p, j, i] = (P[p, i, j] + P[p, j, i]) / 2
    for i in range(n):
        own[0, i] = P[0, i] / r[i]
    own[1, n] = P[1, n] / r_tau
    for i in range(N):
        own[2, 0] += P[2, i] / r_a
    for i in range(1, N):
        own[2, i] = own[2, 0]
    closed = own[0] + own[1] + own[2]
    for p in range(3):
        half = np.dot(P[p], own[p] / 2 - closed)
        for i in range(N):
            for j in range(N):
                F[p, i, j] = half[i, j] + half[j, i]
    for i in range(n):
        F[0, i, i] += 1.0
        F[2, i, i] -= 1.0
    F[1, n, n] -= 1.0
    F[2, n, n] += 1.0


@njit
def riccati(r, r_tau, r_a, T, nodes, tolerance):
    """P on the grid of `nodes` (backward time), as SciPy's DOP853 would compute it: (nodes, 3, N, N)."""
    n, N, size = r.size, r.size + 1, 3 * (r.size + 1) ** 2
    y, s, h, k, refused = np.zeros(size), 0.0, 1e-3, 1, False
    F = y.reshape(3, N, N)
    for i in range(n):
        F[0, i, i], F[2, i, i] = 1.0, -1.0
    F[1, n, n], F[2, n, n] = -1.0, 1.0
    out, K = np.empty((nodes.size, size)), np.zeros((A.shape[0], size))
    out[0] = y
    _backward(y, K[0], r, r_tau, r_a, n)
    dense = np.empty((7, size))
    while s < T:
        h = min(h, T - s)
        for j in range(1, STAGES):
            _backward(y + h * np.dot(A[j, :j], K[:j]), K[j], r, r_tau, r_a, n)
        new = y + h * np.dot(B, K[:STAGES])
        _backward(new, K[STAGES], r, r_tau, r_a, n)
        scale = tolerance * (1.0 + np.maximum(np.abs(y), np.abs(new)))
        e5 = np.sum((np.dot(E5, K[: STAGES + 1]) / scale) ** 2)
        e3 = np.sum((np.dot(E3, K[: STAGES + 1]) / scale) ** 2)
        error = h * e5 / np.sqrt((e5 + 0.01 * e3) * size) if e5 > 0.0 else 0.0
        factor = 0.9 * error ** (-1.0 / 8.0) if error > 0.0 else 10.0
        if error >= 1.0:
            h, refused = h * max(0.2, factor), True
            continue
        last = s + h >= T
        if k < nodes.size and (last or nodes[k] <= s + h):
            for j in range(STAGES + 1, A.shape[0]):
                _backward(y + h * np.dot(A[j, :j], K[:j]), K[j], r, r_tau, r_a, n)
            move = new - y
            dense[0], dense[1], dense[2] = move, h * K[0] - move, 2 * move - h * (K[STAGES] + K[0])
            dense[3:] = h * np.dot(D, K)
            while k < nodes.size and (last or nodes[k] <= s + h):
                x = (nodes[k] - s) / h
                for e in range(size):
                    value = 0.0
                    for i in range(7):
                        value = (value + dense[6 - i, e]) * (x if i % 2 == 0 else 1.0 - x)
                    out[k, e] = y[e] + value
                k += 1
        s, y, K[0] = (T if last else s + h), new, K[STAGES]
        h *= min(10.0, factor) if not refused else min(1.0, factor)
        refused = False
    return out.reshape(nodes.size, 3, N, N)


@njit
def _solve(H, damping, b):
    """Cholesky of H + damping I and the solution, or False where it is not positive definite."""
    L, x = H.copy(), b.copy()
    for i in range(b.size):
        L[i, i] += damping
        for j in range(i + 1):
            for k in range(j):
                L[i, j] -= L[i, k] * L[j, k]
            if i == j:
                if L[i, i] <= 1e-14:
                    return False, x
                L[i, i] = np.sqrt(L[i, i])
            else:
                L[i, j] /= L[j, j]
        for k in range(i):
            x[i] -= L[i, k] * x[k]
        x[i] /= L[i, i]
    for i in range(b.size - 1, -1, -1):
        x[i] /= L[i, i]
        for k in range(i):
            x[k] -= L[i, k] * x[i]
    return True, x


@njit
def _value(G, fne, r, M, W, gamma):
    """Θ, with E = GᵀRG − M, Δ = G − FNE and X_p = W_pΔ + (·)ᵀ."""
    Delta = G - fne
    E = np.dot(G.T, r * G) - M
    X = np.empty((2, *M.shape))
    value = np.sum(E * E) + np.sum((r * Delta) ** 2)
    for p in range(2):
        Y = np.dot(W[p], Delta)
        X[p] = Y + Y.T
        value += np.sum(X[p] ** 2)
    return gamma * value, E, X, Delta


@njit
def newton(fne, r, M, W, seen, gamma):
    """Damped Newton from the canonical start; variables e_j, less e_i where row i does not see the attacker."""
    n, N = seen.shape
    G = np.zeros((n, N))
    entry, own, size = np.empty((n * N, 2), np.int64), np.zeros(n * N), 0
    for i in range(n):
        use = seen[i].copy()
        use[i] = True
        mean = 0.0 if seen[i, i] else np.sum(fne[i] * use) / np.sum(use)
        G[i] = (fne[i] - mean) * use
        for j in range(N):
            if seen[i, j]:
                entry[size, 0], entry[size, 1], own[size] = i, j, 0.0 if seen[i, i] else 1.0
                size += 1
    gram = np.dot(W[0].T, W[0]) + np.dot(W[1].T, W[1])
    value, E, X, Delta = _value(G, fne, r, M, W, gamma)
    H, b, kept = np.empty((size, size)), np.empty(size), 0.0
    for _ in range(200):
        slope = 4 * np.dot(r * G, E) + 2 * r * r * Delta + 4 * (np.dot(W[0].T, X[0]) + np.dot(W[1].T, X[1]))
        inner = np.dot(G, G.T)
        for u in range(size):
            i, a = entry[u]
            b[u] = -gamma * (slope[i, a] - own[u] * slope[i, i])
            for v in range(u + 1):
                j, c = entry[v]
                total = 0.0
                for s in range(2 if own[u] else 1):
                    p = a if s == 0 else i
                    for t in range(2 if own[v] else 1):
                        q, sign = (c if t == 0 else j), (1.0 if s == t else -1.0)
                        h = 4 * r[i, 0] * r[j, 0] * G[i, q] * G[j, p]
                        h += 4 * (W[0, q, i] * W[0, p, j] + W[1, q, i] * W[1, p, j])
                        if i == j:
                            h += 4 * r[i, 0] * E[p, q]
                        if p == q:
                            h += 4 * (r[i, 0] * r[j, 0] * inner[i, j] + gram[i, j])
                            h += 2 * r[i, 0] ** 2 if i == j else 0.0
                        total += sign * h
                H[u, v] = gamma * total
        norm = np.sqrt(np.sum(b * b))
        if size == 0 or norm <= 1e-12 * (1.0 + value):
            break
        better, last, damping = False, False, 0.0
        for _ in range(60):
            fine, x = _solve(H, damping, b)
            if fine:
                trial = G.copy()
                for u in range(size):
                    trial[entry[u, 0], entry[u, 1]] += x[u]
                    trial[entry[u, 0], entry[u, 0]] -= own[u] * x[u]
                last = np.dot(b, x) <= 1e-13 * value  # the decrease is lost in rounding
                next_value, next_E, next_X, next_Delta = _value(trial, fne, r, M, W, gamma)
                if next_value < value or last:
                    better, kept = True, damping / 8
                    break
            damping = max(4 * damping, kept, 1e-3 * np.max(np.abs(np.diag(H))))
        if not better:
            break
        G, value, E, X, Delta = trial, next_value, next_E, next_X, next_Delta
        if last:
            break
    return G


def riccati_of(game: _side.Game, tolerance: float = 1e-12) -> np.ndarray:
    """P on the grid, (3, K+1, N, N)."""
    nodes = np.linspace(0.0, game.horizon, game.steps + 1)
    return riccati(np.array(game.r_d), game.r_tau, game.r_a, game.horizon, nodes, tolerance)[::-1].swapaxes(0, 1)
