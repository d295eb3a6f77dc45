"""Weights and matrices of the game (section 2 of the paper), and the eight runs of its section 6."""

from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cache

import numpy as np

GROUPS = {"I1": ("defenders", "target", "attacker"), "I2": ("team",)}


@dataclass(frozen=True)
class Game:
    """Everything but positions and radii. Arrays over defenders are tuples, so that a game can be hashed."""

    interaction: str
    horizon: float
    step: float
    r_d: tuple
    r_tau: float
    r_a: float
    q_da: tuple
    f_da: tuple
    q_ad: tuple
    f_ad: tuple
    q_taua: float = 1.0
    f_taua: float = 1.0
    q_atau: float = 1.0
    f_atau: float = 1.0
    evasion: float = 1.0
    gamma: tuple = ()

    @property
    def n(self):
        return len(self.r_d)

    @property
    def N(self):
        return self.n + 1

    @property
    def m(self):
        """Number of players whose sight is limited: the defenders, and in I2 the target."""
        return self.n if self.interaction == "I1" else self.n + 1

    @property
    def steps(self):
        return round(self.horizon / self.step)

    @property
    def times(self):
        return np.array([float(Fraction(self.horizon) * k / self.steps) for k in range(self.steps + 1)])

    @property
    def gammas(self):
        return np.array(self.gamma or ((0.25,) * 4 if self.interaction == "I1" else (1 / 3,) * 3), dtype=float)

    @property
    def r(self):
        """Control weights of the players whose sight is limited."""
        return np.array(self.r_d if self.interaction == "I1" else (*self.r_d, self.r_tau), dtype=float)

    def matrices(self, axes=2):
        """B, R, S, Q and F of every group, multiplied out with the identity of `axes` axes (1: reduced)."""
        return _matrices(self, axes)


@cache
def _matrices(game, axes):
    n, N = game.n, game.N
    B = {"d": np.vstack([np.eye(n), np.zeros((1, n))]), "tau": np.eye(N)[:, n:], "a": -np.ones((N, 1))}
    R = {"d": np.diag(game.r_d), "tau": np.diag([game.r_tau]), "a": np.diag([game.r_a])}
    if game.interaction == "I1":
        lam, pad = game.evasion, np.zeros(n)
        Q = {
            "d": np.diag([*game.q_da, 0.0]),
            "tau": np.diag([*pad, -game.q_taua]),
            "a": np.diag([*(-lam * np.array(game.q_ad)), game.q_atau]),
        }
        F = {
            "d": np.diag([*game.f_da, 0.0]),
            "tau": np.diag([*pad, -game.f_taua]),
            "a": np.diag([*(-lam * np.array(game.f_ad)), game.f_atau]),
        }
    else:
        B["dtau"] = np.hstack([B["d"], B["tau"]])
        R["dtau"] = np.diag([*game.r_d, game.r_tau])
        Q = {"team": np.diag([*(-np.array(game.q_ad)), game.q_atau])}
        F = {"team": np.diag([*(-np.array(game.f_ad)), game.f_atau])}
    S = {p: B[p] @ np.linalg.inv(R[p]) @ B[p].T for p in B}
    eye = np.eye(axes)
    return tuple({p: np.kron(X, eye) for p, X in part.items()} for part in (B, R, S, Q, F))


@dataclass(frozen=True)
class Start:
    """Positions d1…dn, target, attacker; visibility radii of the limited players; capture radii d1…dn, attacker."""

    positions: np.ndarray
    zeta: np.ndarray
    sigma: np.ndarray


def uniform(interaction, r_d, r_tau, r_a, *, horizon, step=0.005, **weights):
    """Make a game whose q and f are all 1 unless named in `weights`."""
    ones = (1.0,) * len(r_d)
    base = Game(interaction, horizon, step, tuple(r_d), r_tau, r_a, ones, ones, ones, ones)
    return replace(base, **weights)


@dataclass(frozen=True)
class Case:
    """One run of section 6 with what the specification of this project says it gives."""

    name: str
    game: Game
    start: Start
    kind: str
    defender: int | None
    time: float
    changes: tuple | None = None
    known: dict = field(default_factory=dict)


def paper_cases():
    """The eight runs; the times of I2 are the computed ones, which differ from the printed ones."""
    first = np.array([[0, 0], [1, 1.5], [-1, 0], [0, 1], [-2, 2]], dtype=float)
    second = np.array([[-1, 0], [-3, 1], [1, 2.5], [0.5, 1], [-2.75, 2.5]])
    sigma = np.full(4, 0.1)
    inf, sight = np.full(3, np.inf), np.array([5, 2.25, 1.25])
    i1 = uniform("I1", (1, 1, 1), 1.2, 0.8, horizon=6.0)
    i1_suicidal = replace(i1, evasion=0.0)
    i2 = uniform("I2", (1, 1, 1), 1.2, 0.8, horizon=6.0)
    later = (0.16, 0.49, 0.575, 0.915, 0.96)
    return [
        Case("I1 full", i1, Start(first, inf, sigma), "captured", None, 2.66, ()),
        Case("I1 limited", i1, Start(first, sight, sigma), "intercepted", 0, 1.395, later),
        Case("I1 suicidal full", i1_suicidal, Start(first, inf, sigma), "intercepted", 1, 2.375, ()),
        Case(
            "I1 suicidal limited",
            i1_suicidal,
            Start(first, sight, sigma),
            "intercepted",
            0,
            1.67,
            (0.17, 0.23, 0.485, 0.56, 0.87),
        ),
        Case("I2 full", i2, Start(second, np.full(4, np.inf), sigma), "intercepted", 0, 3.275, ()),
        Case("I2 far target", i2, Start(second, np.array([5, 3, 0.3, 10]), sigma), "captured", None, 3.925),
        Case(
            "I2 near target",
            i2,
            Start(second, np.array([5, 3, 0.3, 2.5]), sigma),
            "intercepted",
            0,
            3.54,
            (0.5, 1.005, 1.055, 1.31),
        ),
        Case(
            "I2 wider d3",
            i2,
            Start(second, np.array([5, 3, 0.6, 2.5]), sigma),
            "intercepted",
            0,
            3.495,
            known={"first_edge_of_d3": 1.405},
        ),
    ]
