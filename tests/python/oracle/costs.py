"""The objectives of eq:fullobj and eq:obj:zero_sum along a run, exactly: Van Loan's block exponential on every step."""

import numpy as np
from scipy.linalg import expm


def running(C, W, z, step):
    """∫ z(t)' W z(t) dt over a step of ż = C z, summed over the axes; z is (N, axes)."""
    N = len(C)
    block = expm(np.block([[-C.T, W], [np.zeros((N, N)), C]]) * step)
    integral = block[N:, N:].T @ block[:N, N:]
    return float(np.sum(z * (integral @ z)))


def costs(game, run):
    """J_d, J_tau, J_a in I1, J in I2, up to the end of the run, the terminal term taken there."""
    _, _, _, Q, F = game.matrices(1)
    names = ("d", "tau", "a") if game.interaction == "I1" else ("team",)
    r = np.array([*game.r_d, game.r_tau, game.r_a])
    N, n = game.N, game.n
    if game.interaction == "I1":
        weights = [np.r_[r[:n], 0, 0], np.r_[np.zeros(n), r[n], 0], np.r_[np.zeros(N), r[N]]]
    else:
        weights = [np.r_[-r[:N], r[N]]]
    total = np.zeros(len(names))
    for k, rows in enumerate(run.loops):
        z = run.positions[k][:N] - run.positions[k][N]
        for p, name in enumerate(names):
            total[p] += running(rows[:N] - rows[N], Q[name] + rows.T @ np.diag(weights[p]) @ rows, z, game.step)
    z = run.positions[-1][:N] - run.positions[-1][N]
    return 0.5 * (total + [np.sum(z * (F[name] @ z)) for name in names])
