"""Interaction I1 in NumPy and SciPy, in the paper's own blocks: what a careful reader of it would write.

`axes` = 2 gives the paper's 2N × 2N matrices, `axes` = 1 one Kronecker factor of them: the formulas are the same.
Whatever an instant alone determines is computed once, and an unseen player is no variable: nothing slows the peers
down on purpose.
"""

import _side
import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares, minimize


def riccati_data(game: _side.Game, axes: int) -> tuple[np.ndarray, np.ndarray]:
    """S and Q of defenders, target and attacker; F = Q here."""
    n, N = game.n, game.n + 1
    S, Q = np.zeros((3, N, N)), np.zeros((3, N, N))
    S[0, :n, :n] = np.diag(1 / np.array(game.r_d))
    S[1, n, n] = 1 / game.r_tau
    S[2] = 1 / game.r_a
    Q[0, :n, :n] = np.eye(n)
    Q[1, n, n] = -1.0
    Q[2] = np.diag([-1.0] * n + [1.0])
    return np.kron(S, np.eye(axes)), np.kron(Q, np.eye(axes))


def riccati(game: _side.Game, axes: int, tolerance: float = 1e-12) -> np.ndarray:
    """eq:Riccati backward from T by SciPy's DOP853: P on the grid, (3, K+1, N axes, N axes).

    Symmetrised at every evaluation: without it rounding alone costs four digits at n = 30.
    """
    S, Q = riccati_data(game, axes)

    def backward(_, y):
        P = y.reshape(Q.shape)
        P = (P + P.swapaxes(1, 2)) / 2
        SP = S @ P
        half = P @ (SP / 2 - (SP[0] + SP[1] + SP[2]))
        return (Q + half + half.swapaxes(1, 2)).ravel()

    nodes = np.linspace(0.0, game.horizon, game.steps + 1)
    solution = solve_ivp(
        backward, (0.0, game.horizon), Q.ravel(), method="DOP853", rtol=tolerance, atol=tolerance, t_eval=nodes
    )
    return solution.y.T.reshape(-1, *Q.shape)[::-1].swapaxes(0, 1)


class Theta:
    """Θ₁ at one instant, its printed gradient (eq:errgradient) and, for `axes` = 1, its residuals.

    Unknowns are the blocks of K_i on the players that i sees (`seen`, the augmented adjacency); K_i 𝓘_i has K_ij in
    column j and K_ii − Σ_j K_ij in its own. The value is divided by `axes`, so that it is the same for both forms.
    """

    def __init__(self, game: _side.Game, P: np.ndarray, axes: int):
        self.n, self.N, self.axes = game.n, game.n + 1, axes
        self.r = np.repeat(game.r_d, axes)[:, None]
        Pd, *others = np.kron(P, np.eye(axes))
        size = self.n * axes
        self.fne = -Pd[:size] / self.r
        self.M = self.fne.T @ (self.r * self.fne)
        self.W = [p[:, :size] for p in others]  # P_p B_d

    def rows(self, x: np.ndarray, seen: np.ndarray) -> np.ndarray:
        """K_d 𝓘_d from the unknowns."""
        n, N, a = self.n, self.N, self.axes
        K = np.zeros((n, N, a, a))
        K[seen] = x.reshape(-1, a, a)
        i = np.arange(n)
        K[i, i] = 2 * K[i, i] - K.sum(axis=1)
        return K.transpose(0, 2, 1, 3).reshape(n * a, N * a)

    def unknowns(self, G: np.ndarray, seen: np.ndarray) -> np.ndarray:
        """The unknowns of rows that use only what is seen: the inverse of `rows`."""
        n, N, a = self.n, self.N, self.axes
        K = G.reshape(n, a, N, a).transpose(0, 2, 1, 3).copy()
        i = np.arange(n)
        K[i, i] = K.sum(axis=1)
        return K[seen].ravel()

    def canonical(self, seen: np.ndarray) -> np.ndarray:
        """The projection of the FNE rows on what each player may use."""
        a = self.axes
        G = self.fne[::a, ::a].copy()
        for i, row in enumerate(seen):
            use = row.copy()
            use[i] = True
            if not row[i]:
                G[i] -= G[i, use].mean()
            G[i, ~use] = 0.0
            if not row.any():
                G[i] = 0.0
        return self.unknowns(np.kron(G, np.eye(a)), seen)

    def __call__(self, x: np.ndarray, seen: np.ndarray) -> tuple[float, np.ndarray]:
        G = self.rows(x, seen)
        RG, D = self.r * G, G - self.fne
        dQd, S1 = G.T @ RG - self.M, self.r * D
        value = np.sum(dQd * dQd) + np.sum(S1 * S1)
        gradient = 4 * RG @ dQd + 2 * self.r * S1
        for W in self.W:
            X = W @ D
            X = X + X.T  # −ΔQ_p
            value += np.sum(X * X)
            gradient += 4 * W.T @ X
        n, N, a = self.n, self.N, self.axes
        blocks = gradient.reshape(n, a, N, a).transpose(0, 2, 1, 3)
        i = np.arange(n)
        blocks = blocks - blocks[i, i][:, None]
        blocks[i, i] = gradient.reshape(n, a, N, a)[i, :, i]
        return _side.GAMMA * value / a, _side.GAMMA * blocks[seen].ravel() / a

    def bfgs(self, seen: np.ndarray, x: np.ndarray | None = None) -> np.ndarray:
        """The paper's way: quasi-Newton on the blocks; returns the unknowns."""
        x = self.canonical(seen) if x is None else x
        if x.size == 0:
            return x
        return minimize(self, x, args=(seen,), method="BFGS", jac=True, options={"gtol": 1e-9, "maxiter": 5000}).x

    def prepare_residuals(self) -> None:
        """The constant part of the Jacobian of the residuals with respect to the rows, upper triangles of ΔQ only."""
        n, N, r, eye = self.n, self.N, self.r[:, 0], np.eye(self.N)
        self.triangle = np.triu_indices(N)
        self.scale = np.sqrt(_side.GAMMA) * np.where(self.triangle[0] == self.triangle[1], 1.0, np.sqrt(2.0))
        u, v = self.triangle
        coupled = [
            self.scale[:, None, None] * (W[u][:, :, None] * eye[v][:, None] + W[v][:, :, None] * eye[u][:, None])
            for W in self.W
        ]
        close = np.sqrt(_side.GAMMA) * np.kron(np.diag(r), eye)
        self.constant = np.vstack([*(c.reshape(-1, n * N) for c in coupled), close])
        self.offset = self.constant @ self.fne.ravel()

    def lm(self, seen: np.ndarray) -> np.ndarray:
        """MINPACK's Levenberg-Marquardt on the reduced residuals, exact Jacobian; returns the unknowns."""
        x = self.canonical(seen)
        if x.size == 0:
            return x
        n, N, r, (u, v), eye = self.n, self.N, self.r[:, 0], self.triangle, np.eye(self.N)
        columns = np.array([self.rows(e, seen).ravel() for e in np.eye(x.size)]).T
        constant, linear = self.constant @ columns, self.constant
        right, left = eye[u][:, None], eye[v][:, None]

        def residuals(x):
            G = self.rows(x, seen)
            E = G.T @ (r[:, None] * G) - self.M
            return np.concatenate([self.scale * E[self.triangle], linear @ G.ravel() - self.offset])

        def jacobian(x):
            RG = (r[:, None] * self.rows(x, seen)).T
            J = self.scale[:, None, None] * (RG[v][:, :, None] * right + RG[u][:, :, None] * left)
            return np.vstack([J.reshape(-1, n * N) @ columns, constant])

        tight = {"ftol": 1e-13, "xtol": 1e-13, "gtol": 1e-13}
        return least_squares(residuals, x, jacobian, method="lm", max_nfev=3000, **tight).x
