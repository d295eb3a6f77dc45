"""A run on the grid: termination, network, gains, and the exact solution of the frozen closed loop over a step."""

from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import expm

from .network import adjacency, distances
from .riccati import equilibrium, feedback
from .synthesis import solve
from .worlds import margin


@dataclass
class Run:
    """`changes` holds (step, adjacency), the initial network first; rows of `positions` end with the terminal state."""

    kind: str = "timeout"
    defender: int | None = None
    step: int = 0
    time: float = 0.0
    positions: list = field(default_factory=list)
    networks: list = field(default_factory=list)
    seen: list = field(default_factory=list)
    """What was seen before anyone was told; only where a world was played."""
    found: list = field(default_factory=list)
    loops: list = field(default_factory=list)
    """Feedback rows of d1…dn, target, attacker in force over each step."""
    changes: list = field(default_factory=list)
    margin: float = np.inf
    """The smallest distance to a threshold that was met: how much rounding the outcome and the times bear."""


class Gains:
    """The gains of one game by (step, network), each found once.

    The rows found at earlier instants under the same network are further starts, so that a low branch, once found,
    is followed. A full search is made on the first sight of a network and at every tenth instant.
    """

    def __init__(self, game, *, few=2, many=12):
        self.game, self.few, self.many = game, few, many
        self.P = equilibrium(game)
        self.entries, self.last = {}, {}

    def __call__(self, k, A):
        key = (k, A.tobytes())
        if key not in self.entries:
            warm = self.last.get(key[1], ())
            count = self.many if not warm or k % 10 == 0 else self.few
            found = solve(self.game, self.P[k], A, count=count, warm=warm, seed=k)
            self.entries[key] = found
            self.last[key[1]] = (found.rows,)
        return self.entries[key]

    def loop(self, k, A):
        """Feedback rows of all players, d1…dn, target, attacker."""
        found = self(k, A)
        rows = feedback(self.game, self.P[k])
        rows[: len(found.rows)] = found.rows
        return found, rows


def ended(positions, sigma):
    """Return (kind, defender) if the game is over in this state."""
    far = distances(positions)[:, -1]
    n = len(positions) - 2
    within = [i for i in range(n) if far[i] <= sigma[i]]
    if within:
        return "intercepted", min(within, key=lambda i: far[i])
    return ("captured", None) if far[n] <= sigma[n] else None


def transition(rows, step):
    """exp of the closed loop of z, with the attacker's own position as a last row: (N+1, N+1)."""
    N = rows.shape[1]
    C = np.zeros((N + 1, N + 1))
    C[:N, :N] = rows[:N] - rows[N]
    C[N, :N] = rows[N]
    return expm(C * step)


class Remembering:
    """Edges with hysteresis and a dwell time, kept as the full history of every edge."""

    def __init__(self, zeta, hysteresis, dwell, step):
        self.zeta, self.band, self.dwell, self.step = zeta, hysteresis, dwell, step
        self.history = []

    def __call__(self, positions):
        near = adjacency(positions, self.zeta)
        if self.history:
            wide = adjacency(positions, self.zeta + self.band)
            past = np.array(self.history)
            near = np.where(past[-1], wide, near)
            now = len(past)
            for i, j in np.ndindex(near.shape):
                changes = [k for k in range(1, now) if past[k, i, j] != past[k - 1, i, j]]
                if changes and (now - changes[-1]) * self.step < self.dwell - 1e-9:
                    near[i, j] = past[-1, i, j]
        self.history.append(near)
        return near


def simulate(game, start, gains=None, look=None, course=None):
    """Play the game once from `start`; `look` gives the sight of positions, the paper's rule by default.

    `course` is a trial of a world (see worlds): what fails, who is told, what displaces the players.
    """
    gains = gains or Gains(game)
    look = look or (lambda positions: adjacency(positions, start.zeta))
    positions = np.array(start.positions, dtype=float)
    run = Run()
    for k in range(game.steps + 1):
        run.positions.append(positions)
        far = distances(positions)[:, -1]
        run.margin = min(run.margin, np.min(np.abs(far[:-1] - start.sigma)))
        run.step, run.time = k, k * game.step
        over = ended(positions, start.sigma)
        if over:
            run.kind, run.defender = over
            break
        if k == game.steps:
            break
        A = look(positions)
        if course is not None:
            A, seen = course.network(k, positions, start.zeta, sight=A)
            run.seen.append(seen)
            run.margin = min(run.margin, margin(course.world, positions, game.m))
        for reach in (start.zeta, start.zeta + getattr(look, "band", 0.0)):
            gap = np.abs(distances(positions)[: game.m] - reach[:, None])
            run.margin = min(run.margin, np.min(gap[np.isfinite(gap)], initial=np.inf))
        if not run.networks or np.any(run.networks[-1] != A):
            run.changes.append((k, A))
        found, rows = gains.loop(k, A)
        run.networks.append(A)
        run.found.append(found)
        run.loops.append(rows)
        moved = transition(rows, game.step) @ np.vstack([positions[:-1] - positions[-1], positions[-1]])
        positions = np.vstack([moved[:-1] + moved[-1], moved[-1]])
        if course is not None:
            positions = positions + course.shock(k)
    return run
