"""Gains that turn, aI + bJ, in the paper's own 2 x 2 blocks: Theta, its gradient, the lowest that descents find, a run.

Complex rows g stand for the blocks Re(g) I + Im(g) J, J the quarter turn. Everything is multiplied out with Kronecker
products; nothing here computes with complex numbers but to store them.
"""

import numpy as np
from scipy.linalg import expm
from scipy.optimize import minimize

from .network import adjacency, information
from .theta import gradients, joint, theta

TURN = np.array([[0.0, -1.0], [1.0, 0.0]])


def blocks(rows):
    """(m, N) complex rows as the 2m x 2N matrix of blocks."""
    return np.kron(np.real(rows), np.eye(2)) + np.kron(np.imag(rows), TURN)


def chosen(A, held):
    """The entries of A that are unknowns: those of players who are not held."""
    free = np.array(A, dtype=bool)
    free[list(held)] = False
    return free


def own_gains(x, A, held=()):
    """The players' K from one complex number for each player seen, in the order of np.argwhere(A).

    `held` has the rows g_i of players who are given theirs and see everyone; their K_i follow from g_i = K_i I_i.
    """
    K = np.zeros(A.shape, dtype=complex)
    K[chosen(A, held)] = x
    for i in held:
        K[i] = np.linalg.solve(information(A[i], i, 1).T, held[i])
    return [blocks(row[None, :]) for row in K]


def slope(game, P, x, A, held=()):
    """Theta and its gradient with respect to the real and the imaginary parts of x, interleaved, over the axes."""
    K = own_gains(x, A, held)
    whole = [g.reshape(2, -1, 2) for g in gradients(game, P, K, A)]
    parts = [(np.trace(whole[i][:, j]), np.sum(whole[i][:, j] * TURN)) for i, j in np.argwhere(chosen(A, held))]
    return theta(game, P, joint(K, A)) / 2.0, np.ravel(parts) / 2.0


def lowest(game, P, A, starts, rng, held=()):
    """The lowest Theta of BFGS from random complex gains, the paper's full matrices P, and where it is."""
    count, best = int(chosen(A, held).sum()), (np.inf, None)

    def of(y):
        return slope(game, P, y[::2] + 1j * y[1::2], A, held)

    if not count:
        return float(of(np.empty(0))[0]), np.empty(0)
    for start in range(starts):
        y = rng.normal(scale=0.3 if start % 2 else 1.0, size=2 * count)
        end = minimize(of, y, jac=True, method="BFGS", options={"gtol": 1e-9})
        if end.fun < best[0]:
            best = float(end.fun), end.x[::2] + 1j * end.x[1::2]
    return best


def play(game, start, gains, rows_of, sight_of=None, course=None):
    """(kind, defender, step), positions and networks of a game whose limited players use `gains(k, A)`, complex (m, N).

    `rows_of(k)` are those of the equilibrium: d1…dn, target, attacker, (N + 1, N). `sight_of(k, positions)` is the
    sight, the paper's rule by default; `course` is a trial of a world (see worlds), from the sight on.
    """
    positions, networks = [np.array(start.positions)], []
    while (end := _end(game, start, positions[-1], len(networks))) is None:
        X, k = positions[-1], len(networks)
        A = adjacency(X, start.zeta) if sight_of is None else sight_of(k, X)
        networks.append(A if course is None else course.network(k, X, start.zeta, sight=A)[0])
        rows = rows_of(k).astype(complex)
        rows[: game.m] = gains(k, networks[-1])
        feedback = blocks(rows)
        # X' = u, and u is a function of X_j - X_a: the positions themselves are the state.
        whole = np.hstack([feedback, -feedback.reshape(len(feedback), -1, 2).sum(axis=1)])
        moved = (expm(whole * game.step) @ X.ravel()).reshape(-1, 2)
        positions.append(moved if course is None else moved + course.shock(k))
    return end, positions, networks


def _end(game, start, X, k):
    """How a game ends at the positions X of instant k, if it does."""
    near = np.linalg.norm(X[:-1] - X[-1], axis=1)
    caught = np.flatnonzero(near[: game.n] <= start.sigma[: game.n])
    if len(caught):
        return "intercepted", int(caught[np.argmin(near[caught])]), k
    if near[game.n] <= start.sigma[game.n]:
        return "captured", None, k
    return ("timeout", None, k) if k == game.steps else None
