"""Next to no weight on S: Θ is then the floor of a valley, and what is called converged is the lowest point known."""

import numpy as np
import pytest
from scipy.optimize import least_squares

import tadcore
from samples import random_game, scenario


class Residuals:
    """Θ as a sum of squares over orthonormal coordinates of what each player may use; nothing of its value cancels."""

    def __init__(self, sc, k, seen):
        P = [p[k] for p in tadcore.solve_equilibrium(sc).P.values()]
        (m, N), gamma, first = seen.shape, sc.synthesis_weights, sc.interaction == "I1"
        self.r = np.array([d.control_weight for d in sc.defenders] + ([] if first else [sc.target.control_weight]))
        self.F = (-1.0 if first else 1.0) * P[0][:m] / self.r[:, None]
        self.M, self.first, self.coupled = self.F.T @ (self.r[:, None] * self.F), np.sqrt(gamma[0]), []
        weights = np.full(m, gamma[3]) if first else np.append(np.full(m - 1, gamma[1]), gamma[2])
        self.weight = np.sqrt(weights)[:, None] * self.r[:, None]
        self.coupled = [np.sqrt(g) * p[:, :m] for g, p in zip(gamma[1:3], P[1:], strict=False)]
        basis = []
        for i in range(m):
            free = np.eye(N)[[j for j in range(N) if (seen[i, i] if j == i else seen[i, j])]]
            free = free if seen[i, i] else free - np.eye(N)[i]
            for row in np.linalg.qr(free.T)[0].T if len(free) else ():
                basis.append(np.zeros((m, N)))
                basis[-1][i] = row
        self.basis = np.array(basis)

    def rows(self, x):
        return np.tensordot(x, self.basis, 1)

    def values(self, x):
        G = self.rows(x)
        both = [W @ (G - self.F) for W in self.coupled]
        parts = [
            self.first * (G.T @ (self.r[:, None] * G) - self.M),
            *(X + X.T for X in both),
            self.weight * (G - self.F),
        ]
        return np.concatenate([part.ravel() for part in parts])

    def slopes(self, x):
        G, columns = self.rows(x), []
        for direction in self.basis:
            X = G.T @ (self.r[:, None] * direction)
            both = [W @ direction for W in self.coupled]
            parts = [self.first * (X + X.T), *(Y + Y.T for Y in both), self.weight * direction]
            columns.append(np.concatenate([part.ravel() for part in parts]))
        return np.array(columns).T

    def theta(self, rows):
        return float(np.sum(self.values(np.tensordot(self.basis, rows, 2)) ** 2))

    def descend(self, rows):
        """Levenberg and Marquardt's method by orthogonal factors, which a flat valley does not stop."""
        x = np.tensordot(self.basis, rows, 2)
        found = least_squares(
            self.values, x, self.slopes, x_scale="jac", ftol=1e-15, xtol=1e-15, gtol=1e-15, max_nfev=300
        )
        return 2.0 * found.cost


@pytest.mark.parametrize("interaction", ["I1", "I2"])
def test_what_is_called_converged_is_the_lowest_point_known(interaction):
    rng = np.random.default_rng(20 + (interaction == "I2"))
    faint, converged = [1e-14, 1e-11, 1e-8, 1e-6, 1e-4], []
    for _ in range(3):
        sc = scenario(random_game(rng, interaction, int(rng.integers(2, 4)), horizon=1.0, step=0.1))
        shape, k = (len(sc.constrained), sc.n + 1), int(rng.integers(0, 9))
        seen = rng.random(shape) < 0.6
        seen[0, 0], seen[-1] = True, rng.random(shape[1]) < 0.5

        def solved(weight, sc=sc, seen=seen, k=k):
            sc = sc.replace(synthesis_weights=(1.0, 0.0, 0.0, weight) if interaction == "I1" else (1.0, weight, weight))
            return Residuals(sc, k, seen), tadcore.synthesize(sc, step=k, adjacency=seen)

        starts = [solved(weight)[1].rows for weight in (0.0, 1e-3)]
        for weight in faint:
            of, gains = solved(weight)
            if gains.converged:
                converged.append(weight)
                own = of.theta(gains.rows)
                assert own == pytest.approx(gains.theta, rel=1e-6, abs=1e-28)
                best = min(map(of.descend, [*starts, gains.rows]))
                assert own <= best * (1.0 + 1e-5) + 1e-28, (weight, k)
    assert len(converged) >= 12
    assert set(converged) >= set(faint[1:])
