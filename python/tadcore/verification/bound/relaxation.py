"""β(Y) and the semidefinite program for its largest value; `tadcore.verification.bound.bounds` says what they are."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse
from scipy.linalg import LinAlgError, cho_factor, cho_solve
from scipy.sparse.csgraph import connected_components

from tadcore._shared.arrays import Floats
from tadcore.verification.oracle.objective import FullObjective

_POLISH = 12
_SHIFTS = (0.0, *(10.0**e for e in range(-15, 3)))


class Form:
    """Θ as γ₁‖Σ_i r_i g_iᵀg_i - M‖² + ‖Ax - b‖² with orthonormal unknowns in every row.

    With `blocks` also the form of gains that turn, DJ with J antisymmetric: ‖X + Xᵀ‖² of eq:perfindex is ‖X - Xᵀ‖²
    there.
    """

    def __init__(self, objective: FullObjective, blocks: bool = False) -> None:
        m, N = objective.limited, objective.size
        self.gamma, self.r = float(objective.gamma[0]), objective.R[:, 0]
        self.M = objective.constant
        directions = objective.rows(np.eye(objective.unknowns)).reshape(-1, m, N)
        owner = objective.seen[:, 0]
        parts = [(i, np.linalg.qr(directions[owner == i, i].T)[0].T) for i in np.unique(owner).tolist()]
        self.owner = np.concatenate([np.full(len(q), i) for i, q in parts]).astype(int) if parts else owner
        self.V = np.concatenate([q for _, q in parts]) if parts else np.zeros((0, N))
        self.size = len(self.V)
        self.b = -self._residual(objective, np.zeros((m, N)))
        self.A, turning = np.zeros((2, len(self.b), self.size))
        for v in range(self.size):
            G = np.zeros((m, N))
            G[self.owner[v]] = self.V[v]
            self.A[:, v] = self._residual(objective, G) + self.b
            turning[:, v] = self._turning(objective, G)
        self.h = self.A.T @ self.b
        self.H0 = self.A.T @ self.A
        self.turning = turning.T @ turning if blocks and len(objective.BP) > 1 else None
        self.same = self.owner[:, None] == self.owner
        self.scale = float(self.b @ self.b) + self.gamma * float(np.sum(self.M**2))

    @staticmethod
    def _residual(objective: FullObjective, G: Floats) -> Floats:
        """What Θ squares apart from its first term, weighed."""
        S, dQ = objective.errors(G)
        parts = [
            np.sqrt(objective.weight) * S,
            *(np.sqrt(g) * X for g, X in zip(objective.gamma[1:], dQ[1:], strict=False)),
        ]
        return np.concatenate([np.ravel(part) for part in parts])

    @staticmethod
    def _turning(objective: FullObjective, G: Floats) -> Floats:
        """The same for gains GJ, without what does not depend on them."""
        across = [np.sqrt(g) * (BP.T @ G) for g, BP in zip(objective.gamma[1:], objective.BP[1:], strict=False)]
        parts = [np.sqrt(objective.weight) * objective.R * G, *(X - X.T for X in across)]
        return np.concatenate([np.ravel(part) for part in parts])

    def D(self, Y: Floats) -> Floats:
        """2γ₁D(Y)."""
        form: Floats = 2.0 * self.gamma * np.where(self.same, self.r[self.owner], 0.0) * (self.V @ Y @ self.V.T)
        return form

    def value(self, Y: Floats) -> tuple[float, Floats | None]:
        """β(Y) and the x at which the quadratic function is that small; -inf where a form is not positive definite."""
        form = self.D(Y)
        try:
            x = cho_solve(cho_factor(self.H0 + form), self.h)
            if self.turning is not None:
                cho_factor(self.turning + form)
        except LinAlgError:
            return -np.inf, None
        rest = float(self.b @ self.b) - float(self.h @ x)
        return rest - self.gamma * float(np.sum(Y * (2.0 * self.M + Y))), x

    def best(self, Y: Floats) -> tuple[float, Floats]:
        """The largest β near Y: towards the identity where H is not positive definite, then by Newton's method.

        Where the largest β lies on the rim of the positive definite matrices, the steps stop short of it.
        """
        if not np.isfinite(Y).all():
            return -np.inf, Y
        unit = max(float(np.abs(Y).max()), float(np.abs(self.M).max())) * np.eye(len(Y))
        value, x, Y = max(((*self.value(Z), Z) for Z in (Y + s * unit for s in _SHIFTS)), key=lambda found: found[0])
        for _ in range(_POLISH):
            if x is None:
                break
            step = self._ascent(Y, x)
            trials = ((*self.value(Z), Z) for Z in (Y + 0.5**i * step for i in range(8)))
            higher = next((found for found in trials if found[0] > value), None)
            if higher is None:
                break
            value, x, Y = higher
        return value, Y

    def _ascent(self, Y: Floats, x: Floats) -> Floats:
        """Newton's step for β: its slope along E is xᵀH'x - 2γ₁⟨Y + M, E⟩, H' = 2γ₁D(E), and x moves by -H⁻¹H'x."""
        E = np.stack([unit for _, unit in _symmetric(len(Y))])
        pushed = np.stack([self.D(e) @ x for e in E])
        slope = pushed @ x - 2.0 * self.gamma * np.tensordot(E, Y + self.M, axes=2)
        curve = 2.0 * self.gamma * np.tensordot(E, E, axes=([1, 2], [1, 2]))
        curve = curve + 2.0 * pushed @ cho_solve(cho_factor(self.H0 + self.D(Y)), pushed.T)
        step: Floats = np.tensordot(np.linalg.solve(curve, slope), E, axes=1)
        return step


def _symmetric(size: int) -> list[tuple[tuple[int, int], Floats]]:
    """The entries of a symmetric matrix and the matrix that has ones there."""
    found = []
    for b in range(size):
        for a in range(b + 1):
            E = np.zeros((size, size))
            E[a, b] = E[b, a] = 1.0
            found.append(((a, b), E))
    return found


def solve(form: Form) -> tuple[Floats, str, int]:
    """Y of the largest β: minimise γ₁‖Y‖² + 2γ₁⟨Y, M⟩ + Σt over [[t, hᵀ], [h, H(Y)]] ⪰ 0, block by block."""
    import clarabel

    N = len(form.M)
    basis = _symmetric(N)
    pairs = [pair for pair, _ in basis]
    unit = max(float(np.linalg.norm(form.M)), 1e-300)  # of Y; that of x makes D(Y) as large as Y, that of Θ is `scale`
    length = np.sqrt(unit / float(form.r.max()))
    _, block = connected_components(sparse.csr_matrix((form.H0 != 0.0) | form.same), directed=False)
    count = int(block.max()) + 1

    weight = np.array([1.0 if a == b else 2.0 for a, b in pairs])
    P = sparse.diags(np.append(2.0 * form.gamma * unit**2 / form.scale * weight, np.zeros(count)), format="csc")
    q = np.append(2.0 * form.gamma * unit / form.scale * weight * [form.M[a, b] for a, b in pairs], np.ones(count))
    slopes = [form.D(unit * E) * length**2 / form.scale for _, E in basis]
    H0, h = form.H0 * length**2 / form.scale, form.h * length / form.scale
    rows, right, cones = [], [], []
    for c in range(count):
        own = np.flatnonzero(block == c)
        size = len(own) + 1
        head = np.zeros((size, size))
        head[0, 0] = 1.0
        fixed = np.zeros((size, size))
        fixed[0, 1:] = fixed[1:, 0] = h[own]
        fixed[1:, 1:] = H0[np.ix_(own, own)]
        columns = [np.pad(slope[np.ix_(own, own)], ((1, 0), (1, 0))) for slope in slopes]
        columns += [head if other == c else 0.0 * head for other in range(count)]
        rows.append(-np.stack([_triangle(X) for X in columns], axis=1))
        right.append(_triangle(fixed))
        cones.append(clarabel.PSDTriangleConeT(size))
    if form.turning is not None:
        columns = [*slopes, *[0.0 * H0] * count]
        rows.append(-np.stack([_triangle(X) for X in columns], axis=1))
        right.append(_triangle(form.turning * length**2 / form.scale))
        cones.append(clarabel.PSDTriangleConeT(form.size))
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-10
    settings.max_threads = 1
    problem: Any = clarabel.DefaultSolver(
        P, q, sparse.csc_matrix(np.vstack(rows)), np.concatenate(right), cones, settings
    )
    found = problem.solve()
    Y = np.zeros((N, N))
    for (a, b), y in zip(pairs, found.x, strict=False):
        Y[a, b] = Y[b, a] = unit * y
    return Y, str(found.status), int(found.iterations)


def _triangle(X: Floats) -> Floats:
    """The upper triangle by columns, off-diagonal entries times √2: the solver's form of a symmetric matrix."""
    a, b = np.tril_indices(len(X))
    scaled: Floats = X[b, a] * np.where(a == b, 1.0, np.sqrt(2.0))
    return scaled
