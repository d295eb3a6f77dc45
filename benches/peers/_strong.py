"""The gains of three defenders in I1 as fast as compiled Python gives them: everything by hand, nothing allocated.

Newton with the exact Hessian from the canonical start, as `_numba.newton`, written out for N = 4: loops of constant
length over arrays that are made once, Cholesky by hand, no call of a library. One descent: it does not look for lower
minima, and says nothing of whether its own is the lowest; tadcore does both.
"""

import numpy as np
from numba import njit

N, ROWS, ALL = 4, 3, 12


@njit(cache=True)
def scratch():
    """Everything that `entry` writes to: F, G, W, E, X, Δ, the Hessian twice, its factor, vectors, matrices."""
    rows, square = (ROWS, N), (N, N)
    vectors = np.zeros(ALL), np.zeros(ALL), np.zeros(rows), np.zeros((ROWS, ROWS))
    matrices = np.zeros((ALL, ALL)), np.zeros((ALL, ALL)), np.zeros((ALL, ALL))
    terms = np.zeros((2, N, N)), np.zeros(square), np.zeros((2, N, N)), np.zeros(rows)
    return (
        np.zeros(rows),
        np.zeros(rows),
        *terms,
        *matrices,
        *vectors,
        np.zeros(square),
        np.zeros(square),
        np.zeros(square),
    )


@njit(cache=True, error_model="numpy", fastmath=True)
def _evaluate(G, fne, r, M, W, E, X, D):
    """Θ / γ; E = GᵀRG − M, X_p = W_pΔ + (·)ᵀ."""
    value = 0.0
    for a in range(N):
        for b in range(N):
            e = -M[a, b]
            for i in range(ROWS):
                e += r[i] * G[i, a] * G[i, b]
            E[a, b] = e
            value += e * e
    for i in range(ROWS):
        for b in range(N):
            D[i, b] = G[i, b] - fne[i, b]
            value += (r[i] * D[i, b]) ** 2
    for p in range(2):
        for a in range(N):
            for b in range(N):
                x = 0.0
                for i in range(ROWS):
                    x += W[p, a, i] * D[i, b] + W[p, b, i] * D[i, a]
                X[p, a, b] = x
                value += x * x
    return value


@njit(cache=True, error_model="numpy", fastmath=True)
def _derive(G, r, W, gram, E, X, D, slope, H):
    """The gradient and the Hessian of Θ / γ with respect to all gains."""
    for i in range(ROWS):
        for a in range(N):
            g = 2.0 * r[i] * r[i] * D[i, a]
            for b in range(N):
                g += 4.0 * (r[i] * G[i, b] * E[b, a] + W[0, b, i] * X[0, b, a] + W[1, b, i] * X[1, b, a])
            slope[i, a] = g
    for i in range(ROWS):
        for j in range(i + 1):
            inner = 0.0
            for b in range(N):
                inner += G[i, b] * G[j, b]
            f = 4.0 * r[i] * r[j]
            same = f * inner + 4.0 * gram[i, j] + (2.0 * r[i] * r[i] if i == j else 0.0)
            for p in range(N):
                for q in range(N):
                    h = f * G[i, q] * G[j, p] + 4.0 * (W[0, q, i] * W[0, p, j] + W[1, q, i] * W[1, p, j])
                    if i == j:
                        h += 4.0 * r[i] * E[p, q]
                    if p == q:
                        h += same
                    H[N * i + p, N * j + q] = h
                    H[N * j + q, N * i + p] = h


@njit(cache=True, error_model="numpy", fastmath=True)
def entry(key, P, r, r_tau, r_a, step, gamma, out, s):
    """Write exp(Cδ) at one (instant, topology) into ``out``, row after row."""
    fne, G, W, E, X, D, full, H, L, b, x, slope, gram, M, C, term = s
    trial = slope  # rewritten by `_derive` before it is read as a gradient
    at, own = np.empty(ALL, np.int64), np.empty(ALL, np.int64)
    size = 0
    for i in range(ROWS):
        for a in range(N):
            fne[i, a] = -P[0, i, a] / r[i]
            W[0, a, i], W[1, a, i] = P[1, a, i], P[2, a, i]
    for a in range(N):
        for c in range(N):
            m = 0.0
            for i in range(ROWS):
                m += r[i] * fne[i, a] * fne[i, c]
            M[a, c] = m
    for i in range(ROWS):
        for j in range(ROWS):
            g = 0.0
            for a in range(N):
                g += W[0, a, i] * W[0, a, j] + W[1, a, i] * W[1, a, j]
            gram[i, j] = g
        sees = (key >> (i * N + i)) & 1
        total, count = 0.0, 0
        for j in range(N):
            if j == i or (key >> (i * N + j)) & 1:
                total += fne[i, j]
                count += 1
        for j in range(N):
            seen = (key >> (i * N + j)) & 1
            G[i, j] = (fne[i, j] - (0.0 if sees else total / count)) if (seen or j == i) else 0.0
            if seen:
                at[size], own[size] = N * i + j, (-1 if sees else N * i + i)
                size += 1
    value = _evaluate(G, fne, r, M, W, E, X, D)
    kept = 0.0
    for _ in range(200):
        _derive(G, r, W, gram, E, X, D, slope, full)
        norm, largest = 0.0, 0.0
        for u in range(size):
            g = slope[at[u] // N, at[u] % N]
            if own[u] >= 0:
                g -= slope[own[u] // N, own[u] % N]
            b[u] = -gamma * g
            norm += b[u] * b[u]
            for v in range(u + 1):
                h = full[at[u], at[v]]
                if own[v] >= 0:
                    h -= full[at[u], own[v]]
                if own[u] >= 0:
                    h -= full[own[u], at[v]]
                    if own[v] >= 0:
                        h += full[own[u], own[v]]
                H[u, v] = gamma * h
            largest = max(largest, abs(H[u, u]))
        if size == 0 or np.sqrt(norm) <= 1e-12 * (1.0 + gamma * value):
            break
        better, last, damping = False, False, 0.0
        for _ in range(60):
            fine = True
            for i in range(size):
                y = b[i]
                for j in range(i):
                    h = H[i, j]
                    for k in range(j):
                        h -= L[i, k] * L[j, k]
                    L[i, j] = h * L[j, j]  # the diagonal holds reciprocals
                    y -= L[i, j] * x[j]
                h = H[i, i] + damping
                for k in range(i):
                    h -= L[i, k] * L[i, k]
                if h <= 1e-14:
                    fine = False
                    break
                L[i, i] = 1.0 / np.sqrt(h)
                x[i] = y * L[i, i]
            if fine:
                for i in range(size - 1, -1, -1):
                    x[i] *= L[i, i]
                    for k in range(i):
                        x[k] -= L[i, k] * x[i]
                gain = 0.0
                for i in range(ROWS):
                    for a in range(N):
                        trial[i, a] = G[i, a]
                for u in range(size):
                    gain += b[u] * x[u]
                    trial[at[u] // N, at[u] % N] += x[u]
                    if own[u] >= 0:
                        trial[own[u] // N, own[u] % N] -= x[u]
                last = gain <= 1e-13 * gamma * value
                reached = _evaluate(trial, fne, r, M, W, E, X, D)
                if reached < value or last:
                    better, kept, value = True, damping / 8, reached
                    break
            damping = max(4 * damping, kept, 1e-3 * largest)
        if not better:
            break
        for i in range(ROWS):
            for a in range(N):
                G[i, a] = trial[i, a]
        if last:
            break
    _exponential(G, P, r_tau, r_a, step, out, C, term, E)


@njit(cache=True, error_model="numpy", fastmath=True)
def _exponential(G, P, r_tau, r_a, step, out, C, term, next_term):
    """exp(Cδ) by a Taylor series until its terms vanish."""
    for j in range(N):
        h = (P[2, 0, j] + P[2, 1, j] + P[2, 2, j] + P[2, 3, j]) / r_a
        for i in range(ROWS):
            C[i, j] = step * (G[i, j] - h)
        C[ROWS, j] = step * (-P[1, ROWS, j] / r_tau - h)
    for i in range(N):
        for j in range(N):
            term[i, j] = out[N * i + j] = 1.0 if i == j else 0.0
    for k in range(1, 14):
        most = 0.0
        for i in range(N):
            for j in range(N):
                t = 0.0
                for a in range(N):
                    t += term[i, a] * C[a, j]
                next_term[i, j] = t / k
                most = max(most, abs(t))
        for i in range(N):
            for j in range(N):
                term[i, j] = next_term[i, j]
                out[N * i + j] += term[i, j]
        if most < 1e-18:
            break
