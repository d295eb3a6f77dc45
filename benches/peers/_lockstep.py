"""The Monte Carlo in compiled Python, trial after trial, with a (step, topology) table; lockstep is `_lockstep3`.

Both fill the table with `_numba.newton` where an entry is missing, and keep it. States are arrays of trials; a topology
of three defenders is a number of twelve bits and indexes its step's row of the table.
"""

import _numba
import _side
import numpy as np
from numba import njit


@njit(cache=True)
def _transition(gains, P, r_tau, r_a, step):
    """exp(Cδ) of the frozen loop, by a Taylor series (‖C‖δ is some hundredths)."""
    N = P.shape[1]
    C = np.empty((N, N))
    C[: N - 1] = gains
    C[N - 1] = -P[1, N - 1] / r_tau
    C -= np.sum(P[2], axis=0) / r_a
    E, term = np.eye(N), np.eye(N)
    for k in range(1, 14):
        term = np.dot(term, C) * (step / k)
        E += term
    return E


@njit(cache=True)
def _solve(key, P, r, r_tau, r_a, step, gamma):
    """The transition at one (instant, topology)."""
    n, N = r.size, r.size + 1
    seen = np.zeros((n, N), np.bool_)
    for i in range(n):
        for j in range(N):
            seen[i, j] = (key >> (i * N + j)) & 1
    column = r.reshape(n, 1)
    fne = -P[0, :n] / column
    W = P[1:, :, :n].copy()
    M = np.dot(fne.T, column * fne)
    return _transition(_numba.newton(fne, column, M, W, seen, gamma), P, r_tau, r_a, step)


@njit(cache=True)
def _observe(z, sight, capture):
    """Code of the outcome (-1 none, -2 captured, else the defender) and the topology of one trial."""
    N = z.shape[0]
    n = N - 1
    key, nearest, caught = 0, np.inf, -1
    for i in range(N):
        own = z[i, 0] * z[i, 0] + z[i, 1] * z[i, 1]
        if i < n:
            if own <= capture[i] and own < nearest:
                nearest, caught = own, i
            if own <= sight[i]:
                key |= 1 << (i * N + i)
        elif own <= capture[n] and caught < 0:
            caught = -2
        for j in range(i):
            dx, dy = z[i, 0] - z[j, 0], z[i, 1] - z[j, 1]
            d = dx * dx + dy * dy
            if i < n and d <= sight[i]:
                key |= 1 << (i * N + j)
            if d <= sight[j]:
                key |= 1 << (j * N + i)
    return caught, key


@njit(cache=True)
def _advance(z, E, before):
    """z ← E z; `before` is scratch of the same shape."""
    N = z.shape[0]
    for a in range(N):
        before[a, 0], before[a, 1] = z[a, 0], z[a, 1]
    for a in range(N):
        x = y = 0.0
        for b in range(N):
            x += E[a, b] * before[b, 0]
            y += E[a, b] * before[b, 1]
        z[a, 0], z[a, 1] = x, y


@njit(cache=True)
def one_by_one(z, sight, capture, P, r, r_tau, r_a, step, gamma, index, table, filled):
    """Play trial after trial; otherwise as `_lockstep3.lockstep3`."""
    trials, steps, scratch = z.shape[0], index.shape[0], np.empty(z.shape[1:])
    ends, instants = np.full(trials, -1), np.full(trials, steps)
    for t in range(trials):
        for k in range(steps + 1):
            caught, key = _observe(z[t], sight, capture)
            if caught != -1 or k == steps:
                ends[t], instants[t] = caught, k
                break
            if index[k, key] < 0:
                table[filled] = _solve(key, P[k], r, r_tau, r_a, step, gamma)
                index[k, key] = filled
                filled += 1
            _advance(z[t], table[index[k, key]], scratch)
    return ends, instants, filled


class Memo:
    """The table of one game, which the compiled loops fill."""

    def __init__(self, game: _side.Game, entries: int) -> None:
        self.game = game
        self.P = np.ascontiguousarray(_numba.riccati_of(game).swapaxes(0, 1))
        self.index = np.full((game.steps, 1 << (game.n * (game.n + 1))), -1, np.int32)
        self.table = np.empty((entries, game.n + 1, game.n + 1))
        self.filled = 0

    def play(self, loop, positions, sight, capture):
        """Outcome codes, defenders and final times of the trials, as a batch of tadcore has them."""
        z = positions[:, :-1] - positions[:, -1:]
        g = self.game
        fixed = (self.P, np.array(g.r_d), g.r_tau, g.r_a, g.step, _side.GAMMA)
        ends, instants, self.filled = loop(z, sight**2, capture**2, *fixed, self.index, self.table, self.filled)
        kind = np.select([ends == -1, ends == -2], [0, 1], 2)
        return kind, np.where(ends >= 0, ends, -1), instants * g.step
