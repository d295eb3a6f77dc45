"""Θ in full blocks: the paper's own variables, dim × dim for each player and each player it sees.

The library computes with reduced gains, one number a block. Here every block is free, so a direction may rotate or
shear; by symmetry a reduced critical point is critical here too, but only the full Hessian says that it is a minimum.
Gradients are eq:errgradient; Θ is divided by the number of axes, so at reduced gains it is the reduced Θ.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import Floats
from tadcore.scenario.model import Scenario

from .criterion import chosen, held
from .matrices import Matrices


class FullObjective:
    """Θ₁ or Θ₂ at one instant and one network, over the blocks of the players that are seen.

    Parameters
    ----------
    sc : Scenario
        The game.
    m : Matrices
        Its matrices.
    values : ndarray, shape (parties, N, N)
        Value matrices at the instant.
    adjacency : ndarray of bool, shape (m, N)
        𝒜.
    dim : int, optional
        Axes of the blocks; the scenario's by default, 1 for the reduced problem.
    team : bool
        Whether rows are held at the equilibrium where the scenario's criterion says so: they are no unknowns then.
    """

    def __init__(
        self,
        sc: Scenario,
        m: Matrices,
        values: Floats,
        adjacency: NDArray[np.bool_],
        dim: int | None = None,
        *,
        team: bool = False,
    ) -> None:
        self.dim = sc.dim if dim is None else dim
        self.first = sc.interaction == "I1"
        self.limited, self.size = adjacency.shape
        self.seen = np.argwhere(chosen(sc, adjacency) if team else adjacency)
        self.unknowns = len(self.seen) * self.dim**2
        self.gamma = np.array(sc.synthesis_weights)
        eye = np.eye(self.dim)
        fixed = np.zeros((self.limited, self.size))
        if team:
            fixed = np.where(held(sc, adjacency)[:, None], m.rows(values)[: self.limited], fixed)
        self.fixed = np.kron(fixed, eye)
        self.R = np.repeat(m.r[: self.limited], self.dim)[:, None]
        P = [np.kron(p, eye) for p in (values if self.first else values[1:])]
        rows = self.limited * self.dim
        self.BP = [p[:rows] for p in P]
        self.constant = P[0][:rows].T @ (P[0][:rows] / self.R)
        self.weight = (
            self.gamma[3]
            if self.first
            else np.repeat([self.gamma[1], self.gamma[2]], [rows - self.dim, self.dim])[:, None]
        )

    def rows(self, x: Floats) -> Floats:
        """G = K𝓘 without rows that are held, shape (…, m·dim, N·dim), of blocks x with `unknowns` entries each."""
        blocks = x.reshape(*x.shape[:-1], len(self.seen), self.dim, self.dim)
        G = np.zeros((*x.shape[:-1], self.limited, self.dim, self.size, self.dim))
        for s, (i, j) in enumerate(self.seen):
            G[..., i, :, j, :] += blocks[..., s, :, :]
            if i != j:
                G[..., i, :, i, :] -= blocks[..., s, :, :]
        return G.reshape(*x.shape[:-1], self.limited * self.dim, self.size * self.dim)

    def pull(self, inner: Floats) -> Floats:
        """The transpose of `rows`: from a gradient in G to one in the blocks."""
        lead = inner.shape[:-2]
        four = inner.reshape(*lead, self.limited, self.dim, self.size, self.dim)
        out = np.empty((*lead, len(self.seen), self.dim, self.dim))
        for s, (i, j) in enumerate(self.seen):
            out[..., s, :, :] = four[..., i, :, j, :] - (four[..., i, :, i, :] if i != j else 0.0)
        return out.reshape(*lead, self.unknowns)

    def blocks(self, reduced: Floats) -> Floats:
        """The unknowns of reduced rows (m, N): each block its number times the identity."""
        eye = np.eye(self.dim).ravel()
        parts = []
        for i, j in self.seen:
            own = reduced[i].sum() if i == j else reduced[i, j]  # z_i carries minus every other block
            parts.append(own * eye)
        return np.concatenate(parts) if parts else np.zeros(0)

    def errors(self, G: Floats) -> tuple[Floats, list[Floats]]:
        """S and every ΔQ^Ad of eq:perfindex or eq:perfmatzsg, multiplied out."""
        quadratic = G.T @ (self.R * G)
        if not self.first:
            return self.R * G - self.BP[0], [self.constant - quadratic]
        S = self.BP[0] + self.R * G
        across = [-(BP.T @ (S / self.R)) for BP in self.BP[1:]]
        return S, [quadratic - self.constant, *(X + X.T for X in across)]

    def theta(self, x: Floats) -> float:
        """Θ over the number of axes."""
        return self.theta_of(self.rows(x) + self.fixed)

    def theta_of(self, G: Floats) -> float:
        """Θ of joint rows G, over the number of axes."""
        S, dQ = self.errors(G)
        total = sum(g * float(np.sum(X * X)) for g, X in zip(self.gamma, dQ, strict=False))
        return float(total + np.sum(self.weight * S * S)) / self.dim

    def gradient(self, x: Floats) -> Floats:
        """∇Θ in the blocks (eq:errgradient), over the number of axes."""
        return self.pull(self.inner(self.rows(x) + self.fixed)) / self.dim

    def inner(self, G: Floats) -> Floats:
        """The gradient of Θ in G, before it is pulled back to the blocks."""
        S, dQ = self.errors(G)
        sign = 1.0 if self.first else -1.0
        inner = 4.0 * sign * self.gamma[0] * (self.R * G) @ dQ[0] + 2.0 * self.weight * self.R * S
        for g, BP, X in zip(self.gamma[1:], self.BP[1:], dQ[1:], strict=False):
            inner = inner - 4.0 * g * BP @ X
        return np.asarray(inner)

    def gradient_scale(self, x: Floats) -> float:
        """The size of the products that cancel in the gradient: what its rounding and its smallness are relative to."""
        G = self.rows(x) + self.fixed
        S, _ = self.errors(G)
        norm = np.linalg.norm
        largest = float(norm(self.BP[0])) + float(norm(self.R * G))
        total = 4.0 * self.gamma[0] * norm(self.R * G) * (norm(G.T @ (self.R * G)) + norm(self.constant))
        total += 2.0 * norm(self.weight * self.R) * largest
        for g, BP in zip(self.gamma[1:], self.BP[1:], strict=False):
            total += 8.0 * g * norm(BP) ** 2 * (largest + norm(S)) / float(self.R.min())
        return float(total) / self.dim

    def hessian_product(self, x: Floats, v: Floats) -> Floats:
        """∇²Θ(x) v for directions v of shape (…, unknowns), exactly."""
        return self.curve(self.rows(x) + self.fixed, v)

    def curve(self, G: Floats, v: Floats) -> Floats:
        """The same at joint rows G of any kind, for directions in the blocks."""
        V = self.rows(v)
        _, dQ = self.errors(G)
        sign = 1.0 if self.first else -1.0
        change = np.swapaxes(V, -1, -2) @ (self.R * G)
        change = sign * (change + np.swapaxes(change, -1, -2))
        inner = 4.0 * sign * self.gamma[0] * (self.R * (V @ dQ[0] + G @ change))
        inner += 2.0 * self.weight * self.R**2 * V
        for g, BP in zip(self.gamma[1:], self.BP[1:], strict=False):
            moved = BP.T @ V
            inner += 4.0 * g * BP @ (moved + np.swapaxes(moved, -1, -2))
        return self.pull(inner) / self.dim
