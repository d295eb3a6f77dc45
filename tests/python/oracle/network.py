"""Who sees whom: Ad, Phi, the augmented adjacency and the information matrices (eq:limob to eq:infomatrix)."""

from functools import cache

import numpy as np


def distances(positions):
    """Distances between all players, (n+2, n+2)."""
    return np.linalg.norm(positions[:, None] - positions[None], axis=-1)


def adjacency(positions, zeta):
    """The augmented adjacency, one row for each limited player: entry j sees player j, entry i sees the attacker."""
    m, N = len(zeta), len(positions) - 1
    far = distances(positions)
    A = np.zeros((m, N), dtype=bool)
    for i in range(m):
        for j in range(N):
            other = N if j == i else j
            A[i, j] = far[i, other] <= zeta[i]
    return A


def from_parts(Ad, phi_a, phi_tau):
    """eq:extadj for the defenders: [Phi_a + Ad, Phi_tau]."""
    return np.hstack([np.diag(phi_a) + Ad, np.reshape(phi_tau, (-1, 1))])


def information(row, i, axes=2):
    """I_i of eq:infomatrix as printed; `row` is row i of the augmented adjacency."""
    return _information(tuple(bool(x) for x in row), i, axes)


@cache
def _information(row, i, axes):
    N = len(row)
    e = np.eye(N)[:, [i]]
    out = np.kron(np.diag(row).astype(float) @ (np.eye(N) - np.kron(e.T, np.ones((N, 1)) - e)), np.eye(axes))
    out.setflags(write=False)
    return out


def team_information(A, axes=2):
    """col{I_1, …}: the information of all limited players stacked, (m N axes, N axes)."""
    return np.vstack([information(row, i, axes) for i, row in enumerate(A)])


def edges(A):
    """The network as a set of pairs of player numbers (d1…dn, target n, attacker n + 1)."""
    N = A.shape[1]
    return {(int(i), N if i == j else int(j)) for i, j in np.argwhere(A)}


def number(A):
    """The network as one number: bit m N - 1 - (i N + j) is entry (i, j)."""
    return int("".join("1" if x else "0" for x in np.asarray(A).ravel()), 2)


def from_number(code, m, N):
    """The inverse of `number`."""
    return np.array([c == "1" for c in format(code, f"0{m * N}b")]).reshape(m, N)
