"""A search for the lowest Θ of one (instant, network) that shares nothing with the library's: no start, no solver.

Θ is built from its definition as ``γ₁‖GᵀRG − M‖² + (g − f)ᵀQ(g − f)`` over orthonormal coordinates of what each player
may use. Descents are damped Newton's with dense matrices, compiled by Numba. They start from

- random gains of several sizes;
- the equilibrium's rows mixed by a random rotation of √R·G, which leaves GᵀRG as it is, or exchanged between players
  with random signs;
- the best point known with one or two rows drawn anew, mixed or exchanged.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit

if TYPE_CHECKING:
    import tadcore

    Array = np.ndarray[Any, np.dtype[Any]]

STEPS = 200
"""Newton steps of a descent."""
LOWER = 1e-7
"""How much lower, relatively, a descent must end to count."""


class Pair:
    """Θ of one (instant, network): `P` holds the Riccati matrices of the instant, in the order of the groups."""

    def __init__(self, sc: tadcore.Scenario, P: Array, seen: Array) -> None:
        seen = np.asarray(seen, dtype=bool)
        m, N = seen.shape
        gamma, first = sc.synthesis_weights, sc.interaction == "I1"
        r = np.array([d.control_weight for d in sc.defenders] + ([] if first else [sc.target.control_weight]))
        F = (-1.0 if first else 1.0) * P[0][:m] / r[:, None]
        weight = np.full(m, gamma[3]) if first else np.append(np.full(m - 1, gamma[1]), gamma[2])
        residuals = [np.diag(np.repeat(np.sqrt(weight) * r, N))]
        for g, matrix in zip(gamma[1:3], P[1:], strict=False):
            columns = []
            for i, a in np.ndindex(m, N):
                X = np.outer(matrix[:, i], np.eye(N)[a])
                columns.append(np.sqrt(g) * (X + X.T).ravel())
            residuals.append(np.array(columns).T)
        stacked = np.vstack(residuals)
        basis, owner = [], []
        for i in range(m):
            directions = [
                np.eye(N)[j] - (0.0 if seen[i, i] else np.eye(N)[i])
                for j in range(N)
                if (seen[i, i] if j == i else seen[i, j])
            ]
            for column in np.linalg.qr(np.array(directions).T)[0].T if directions else ():
                row = np.zeros((m, N))
                row[i] = column
                basis.append(row.ravel())
                owner.append(i)
        self.rows_shape = (m, N)
        self.basis = np.array(basis).reshape(-1, m * N)
        self.F, self.r = np.ascontiguousarray(F), r
        M, Q = F.T @ (r[:, None] * F), stacked.T @ stacked
        in_basis = self.basis @ Q @ self.basis.T
        self.data = (self.basis, np.array(owner, dtype=np.int64), r, self.F, M, Q, in_basis, float(gamma[0]))
        self.scale = gamma[0] * float(np.sum(M * M)) + float(F.ravel() @ Q @ F.ravel())

    def theta(self, rows: Array) -> float:
        """Θ of gain rows."""
        _, _, r, F, M, Q, _, g = self.data
        X, D = rows.T @ (r[:, None] * rows) - M, (rows - F).ravel()
        return float(g * np.sum(X * X) + D @ Q @ D)

    def lowest(self, rows: Array, starts: int, rng: np.random.Generator) -> tuple[float, Array]:
        """The lowest Θ found from `rows` on by `starts` descents, and its rows."""
        if not len(self.basis):
            return self.theta(rows), rows
        x, value = _search(self.basis @ rows.ravel(), starts, rng, *self.data)
        return float(value), (x @ self.basis).reshape(self.rows_shape)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _value(x, basis, owner, r, F, M, Q, g):  # type: ignore[no-untyped-def]
    """Θ, its gradient in the coordinates, G and X."""
    m, N = F.shape
    G = np.zeros((m, N))
    for v in range(len(x)):
        i = owner[v]
        for a in range(N):
            G[i, a] += x[v] * basis[v, i * N + a]
    X = -M.copy()
    for i in range(m):
        for a in range(N):
            for b in range(N):
                X[a, b] += r[i] * G[i, a] * G[i, b]
    D = (G - F).copy().reshape(-1)
    QD = Q @ D
    Y, GX = 2.0 * QD.reshape(m, N), G @ X
    gradient = np.zeros(len(x))
    for v in range(len(x)):
        i = owner[v]
        for a in range(N):
            gradient[v] += (Y[i, a] + 4.0 * g * r[i] * GX[i, a]) * basis[v, i * N + a]
    return g * np.sum(X * X) + np.dot(D, QD), gradient, G, X


@njit(cache=True)  # type: ignore[untyped-decorator]
def _hessian(G, X, basis, owner, r, in_basis, g):  # type: ignore[no-untyped-def]
    m, N = G.shape
    d = len(owner)
    H, inner = 2.0 * in_basis, G @ G.T
    along, through = np.zeros((d, m)), np.zeros((d, N))
    for v in range(d):
        row = basis[v, owner[v] * N : (owner[v] + 1) * N]
        for j in range(m):
            along[v, j] = np.sum(row * G[j])
        for b in range(N):
            through[v, b] = np.sum(row * X[:, b])
    for v in range(d):
        i = owner[v]
        for u in range(v + 1):
            j = owner[u]
            other = basis[u, j * N : (j + 1) * N]
            s = r[i] * np.sum(through[v] * other) if i == j else 0.0
            product = np.sum(basis[v, i * N : (i + 1) * N] * other)
            s += r[i] * r[j] * (along[v, j] * along[u, i] + inner[i, j] * product)
            H[v, u] += 4.0 * g * s
            H[u, v] = H[v, u]
    return H


@njit(cache=True)  # type: ignore[untyped-decorator]
def _solve(H, damping, b, L):  # type: ignore[no-untyped-def]
    """(H + damping I)⁻¹ b by Cholesky, and whether the matrix is positive definite."""
    d = len(b)
    x = b.copy()
    for i in range(d):
        for j in range(i + 1):
            s = H[i, j] + (damping if i == j else 0.0)
            for k in range(j):
                s -= L[i, k] * L[j, k]
            if i == j:
                if not s > 1e-15 * abs(H[i, i] + damping):
                    return x, False
                L[i, i] = np.sqrt(s)
            else:
                L[i, j] = s / L[j, j]
        for k in range(i):
            x[i] -= L[i, k] * x[k]
        x[i] /= L[i, i]
    for i in range(d - 1, -1, -1):
        for k in range(i + 1, d):
            x[i] -= L[k, i] * x[k]
        x[i] /= L[i, i]
    return x, True


@njit(cache=True)  # type: ignore[untyped-decorator]
def _descend(x, basis, owner, r, F, M, Q, in_basis, g):  # type: ignore[no-untyped-def]
    """Damped Newton from x: the end point and its Θ."""
    value, gradient, G, X = _value(x, basis, owner, r, F, M, Q, g)
    L, damping = np.zeros((len(x), len(x))), 0.0
    slope = np.sqrt(np.sum(gradient * gradient))
    for _ in range(STEPS):
        if slope == 0.0:
            break
        H = _hessian(G, X, basis, owner, r, in_basis, g)
        largest = np.max(np.abs(np.diag(H)))
        moved = last = False
        for _ in range(60):
            step, definite = _solve(H, damping, -gradient, L)
            if not definite:
                damping = max(4.0 * damping, 1e-3 * largest, 1e-300)
                continue
            predicted = 0.5 * (damping * np.sum(step * step) - np.dot(step, gradient))
            last = predicted <= 1e-14 * abs(value)
            trial = _value(x + step, basis, owner, r, F, M, Q, g)
            actual, flatter = value - trial[0], np.sqrt(np.sum(trial[1] * trial[1]))
            if actual > 1e-4 * predicted or (last and flatter < slope):
                damping = 0.125 * damping if actual > 0.75 * predicted else damping
                damping = damping if damping >= 1e-6 * largest else 0.0
                x, (value, gradient, G, X), slope, moved = x + step, trial, flatter, True
                break
            if last:
                break
            damping = max(8.0 * damping, 1e-2 * largest)
        if last or not moved:
            break
    return x, value


@njit(cache=True)  # type: ignore[untyped-decorator]
def _search(x0, starts, rng, basis, owner, r, F, M, Q, in_basis, g):  # type: ignore[no-untyped-def]
    (m, N), d = F.shape, len(owner)
    size = np.sqrt(np.sum(F * F))
    best, lowest = x0.copy(), _value(x0, basis, owner, r, F, M, Q, g)[0]
    for start in range(starts):
        # The first half sets out from the equilibrium's rows, the second from the best point.
        rows = F.copy() if 2 * start < starts else np.zeros((m, N))
        if 2 * start >= starts:
            for v in range(d):
                rows[owner[v]] += best[v] * basis[v, owner[v] * N : (owner[v] + 1) * N]
        kind = start % 4
        mixed = np.zeros((m, N))
        if kind == 1:
            players = rng.permutation(m)
            for i in range(m):
                sign = 1.0 if rng.random() < 0.5 else -1.0
                mixed[i] = sign * np.sqrt(r[players[i]] / r[i]) * rows[players[i]]
        elif kind == 2:
            rotation = np.ascontiguousarray(np.linalg.qr(rng.normal(0.0, 1.0, (m, m)))[0])
            for i in range(m):
                for j in range(m):
                    mixed[i] += rotation[i, j] * np.sqrt(r[j] / r[i]) * rows[j]
            mixed *= rng.uniform(0.8, 1.5)
        elif kind == 3:
            mixed += rows
            for i in (rng.integers(0, m), rng.integers(0, m)):
                mixed[i] = rng.normal(0.0, 1.0, N) * size / np.sqrt(m * N) * rng.uniform(0.3, 3.0)
        x = basis @ mixed.copy().reshape(-1)
        shake = rng.uniform(0.2, 1.5) if kind == 0 else 0.02 if kind == 1 else 0.0
        x += rng.normal(0.0, 1.0, d) * shake * size / np.sqrt(d)
        x, value = _descend(x, basis, owner, r, F, M, Q, in_basis, g)
        if value < lowest * (1.0 - LOWER):
            best, lowest = x, value
    return best, lowest
