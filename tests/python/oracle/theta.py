"""Theta_1 and Theta_2, their terms and the gradients of eq:errgradient, in 2 x 2 blocks as printed.

`K` is the list of the players' own gain matrices, each (axes, N axes): the diagonal blocks of K_d (eq:kdm), and in
I2 K_tau last. `P` holds the *full* matrices of the groups. With axes = 1 the same formulas are the reduced problem.
"""

import numpy as np

from .network import information


def joint(K, A, axes=2):
    """K_d I_d (and K_tau I_tau below it): the rows that multiply z."""
    return np.vstack([k @ information(A[i], i, axes) for i, k in enumerate(K)])


def errors(game, P, G, axes=2):
    """eq:perfindex or eq:perfmatzsg for joint rows G: the matrices whose norms Theta weighs, in its order."""
    B, R, _, _, _ = game.matrices(axes)
    if game.interaction == "I1":
        Pd, Pt, Pa = P
        Ri = np.linalg.inv(R["d"])
        S1 = B["d"].T @ Pd + R["d"] @ G
        dQt = -Pt @ B["d"] @ Ri @ S1 - S1.T @ Ri @ B["d"].T @ Pt
        dQd = -Pd @ B["d"] @ Ri @ B["d"].T @ Pd + G.T @ R["d"] @ G
        dQa = -Pa @ B["d"] @ Ri @ S1 - S1.T @ Ri @ B["d"].T @ Pa
        return dQd, dQt, dQa, S1
    (p,) = P
    size = game.n * axes
    Gd, Gt = G[:size], G[size:]
    dQ = p @ B["d"] @ np.linalg.inv(R["d"]) @ B["d"].T @ p + p @ B["tau"] @ np.linalg.inv(R["tau"]) @ B["tau"].T @ p
    dQ = dQ - Gd.T @ R["d"] @ Gd - Gt.T @ R["tau"] @ Gt
    return dQ, R["d"] @ Gd - B["d"].T @ p, R["tau"] @ Gt - B["tau"].T @ p


def terms(game, P, G, axes=2):
    """The squared Frobenius norms, unweighted."""
    return np.array([np.sum(X * X) for X in errors(game, P, G, axes)])


def theta(game, P, G, axes=2):
    return float(game.gammas @ terms(game, P, G, axes))


def gradients(game, P, K, A, axes=2):
    """eq:errgradient: the gradient of Theta with respect to every player's own K."""
    B, R, _, _, _ = game.matrices(axes)
    g = game.gammas
    G = joint(K, A, axes)
    parts = errors(game, P, G, axes)
    size = game.n * axes
    if game.interaction == "I1":
        dQd, dQt, dQa, S1 = parts
        inner = (
            4 * g[0] * R["d"] @ G @ dQd
            - 4 * g[1] * B["d"].T @ P[1] @ dQt
            - 4 * g[2] * B["d"].T @ P[2] @ dQa
            + 2 * g[3] * R["d"] @ S1
        )
    else:
        dQ, S2, S3 = parts
        inner = np.vstack(
            [
                -4 * g[0] * R["d"] @ G[:size] @ dQ + 2 * g[1] * R["d"] @ S2,
                -4 * g[0] * R["tau"] @ G[size:] @ dQ + 2 * g[2] * R["tau"] @ S3,
            ]
        )
    return [inner[i * axes : (i + 1) * axes] @ information(A[i], i, axes).T for i in range(len(K))]


def full(P, axes=2):
    """Reduced matrices multiplied out with the identity."""
    return np.array([np.kron(p, np.eye(axes)) for p in P])
