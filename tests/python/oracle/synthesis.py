"""The global minimiser of Theta at one (instant, network), by more means than the procedure under test has."""

from dataclasses import dataclass
from itertools import product

import numpy as np

from . import search
from .network import information
from .riccati import feedback

SAME = 1e-9
ROUNDS = 4000  # just before an escape, valleys are narrow and curved, and some 600 steps lead through
MANY = 12


@dataclass(frozen=True)
class Found:
    """The best gains found, and what the canonical routes alone would have given."""

    rows: np.ndarray
    theta: float
    newton: float
    """Theta of Newton's method from the canonical start (steps 1 and 2 of the procedure)."""
    procedure: float
    """The same with the second look in complex gains (steps 1 to 3)."""
    gradient: float
    lowest: float
    """The lowest eigenvalue of the Hessian at the minimum."""

    @property
    def second_look(self):
        return self.procedure < self.newton * (1 - SAME) - 1e-14

    @property
    def missed(self):
        return self.theta < self.procedure * (1 - SAME) - 1e-14


class Problem:
    """Theta in the variables x, coordinates of the rows in orthonormal bases of what each player may use."""

    def __init__(self, game, P, A):
        A = np.asarray(A, dtype=bool)
        m, N = A.shape
        B, _, _, _, _ = game.matrices(1)
        self.shape = (m, N)
        self.r = game.r
        self.start = np.ascontiguousarray(feedback(game, P)[:m])
        self.M = self.start.T @ np.diag(self.r) @ self.start
        g = game.gammas
        if game.interaction == "I1":
            weight, self.c = np.full(m, g[3]), g[1:3].copy()
            self.C = np.array([P[1] @ B["d"], P[2] @ B["d"]])
        else:
            weight, self.c = np.array([g[1]] * game.n + [g[2]]), np.zeros(0)
            self.C = np.zeros((0, N, m))
        self.w = weight * self.r**2
        self.g = float(g[0])
        columns = []
        for i in range(m):
            W = information(A[i], i, 1)[A[i]]
            if len(W):
                block = np.zeros((m, N, len(W)))
                block[i] = np.linalg.qr(W.T)[0]
                columns.append(block.reshape(m * N, -1))
        self.basis = np.ascontiguousarray(np.hstack(columns)) if columns else np.zeros((m * N, 0))
        self.size = self.basis.shape[1]
        self.canonical = self.basis.T @ self.start.ravel()
        self.scale = max(1e-3, np.linalg.norm(self.start))

    @property
    def data(self):
        return self.basis, self.shape, self.r, self.start, self.M, self.w, self.C, self.c, self.g

    def rows(self, x):
        return (self.basis @ x).reshape(self.shape)

    def value(self, x):
        return search.real_model(np.asarray(x, dtype=float), *self.data)[0]

    def real(self, x, largest=np.inf, rounds=ROUNDS):
        return search.minimise(np.ascontiguousarray(x), False, 0.1 * self.scale, largest, rounds, *self.data)

    def complex(self, x, y, largest):
        """Descend in complex gains from x + iy in short steps, then in real ones from the real part."""
        z, *_ = search.minimise(np.concatenate([x, y]), True, largest, largest, ROUNDS, *self.data)
        return self.real(z[: self.size])

    def zero(self):
        value = self.g * np.sum(self.M**2) + np.sum(self.w[:, None] * self.start**2)
        for c, C in zip(self.c, self.C, strict=True):
            X = C @ self.start
            value += c * np.sum((X + X.T) ** 2)
        return float(value)


def tilt(size):
    """A fixed direction without a pattern that a symmetric game could share."""
    return np.cos(1.0 + 2.0 * np.arange(size))


def deterministic(problem, thorough):
    """Starts without chance: the canonical rows with one row's sign changed or one row left out.

    A sign change of a row keeps the quartic term, which is why minima lie near; the thorough form changes all signs.
    """
    m = problem.shape[0]
    signs = [np.where(np.arange(m) == i, value, 1.0) for i in range(m) for value in (-1.0, 0.0)]
    if thorough and m <= 5:
        signs += [np.array(s) for s in product((1.0, -1.0), repeat=m) if s.count(-1.0) > 1]
    nudge = 1e-6 * problem.scale * tilt(problem.size)
    for sign in signs:
        yield problem.basis.T @ (problem.start * sign[:, None]).ravel() + nudge


def random(problem, rng, count):
    """Random starts: disturbed sign changes of the canonical rows, and Gaussian ones."""
    for j in range(count):
        if j % 2 == 0:
            sign = rng.choice([-1.0, 1.0], size=(problem.shape[0], 1))
            yield problem.basis.T @ (problem.start * sign).ravel() + 0.05 * problem.scale * rng.normal(
                size=problem.size
            )
        else:
            yield problem.scale * rng.uniform(0.2, 1.5) * rng.normal(size=problem.size) / np.sqrt(problem.size)


def solve(game, P, A, *, count=6, warm=(), seed=0):
    """Search from the canonical start, in complex gains, from `warm` rows, changed signs and `count` random starts.

    The canonical result is kept unless another is lower by more than rounding.
    """
    problem = Problem(game, P, A)
    if problem.size == 0:
        theta = problem.zero()
        return Found(np.zeros(problem.shape), theta, theta, theta, 0.0, np.inf)
    best = problem.real(problem.canonical)
    newton = best[1]
    if newton <= 1e-16 * problem.zero():  # nothing lies below zero
        return Found(problem.rows(best[0]), *map(float, (newton, newton, newton, best[2], best[3])))

    def keep(candidate):
        return candidate if candidate[1] < best[1] * (1 - SAME) - 1e-14 else best

    size = 1e-3 * problem.scale
    best = keep(problem.complex(problem.canonical, size * tilt(problem.size), 0.1 * problem.scale))
    procedure = best[1]
    for rows in warm:
        best = keep(problem.real(problem.basis.T @ rows.ravel()))
    if count:
        best = keep(problem.complex(problem.canonical, problem.scale * tilt(problem.size), 0.5 * problem.scale))
        for x in deterministic(problem, thorough=count >= MANY):
            best = keep(problem.real(x))
    rng = np.random.default_rng([seed, problem.size])
    for j, x in enumerate(random(problem, rng, count)):
        if j % 3 == 2:
            y = problem.scale * rng.normal(size=problem.size) / np.sqrt(problem.size)
            best = keep(problem.complex(x, y, 0.3 * problem.scale))
        else:
            best = keep(problem.real(x))
    return Found(problem.rows(best[0]), *map(float, (best[1], newton, procedure, best[2], best[3])))
