"""What a play in continuous time moves along: the closed loops of a step, and the circles that end or change it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from tadcore._shared.arrays import Floats
from tadcore.game.equilibrium import solve_equilibrium
from tadcore.game.synthesis import synthesize
from tadcore.scenario.model import Scenario
from tadcore.verification.oracle.matrices import matrices_of

_DEGREE = 16


class Loops:
    """C on a step by network: the mean of the closed loops at both ends."""

    def __init__(self, sc: Scenario) -> None:
        self.sc, self.m = sc, matrices_of(sc)
        self.rows = self.m.rows(self.m.values(solve_equilibrium(sc).P))
        self.kept: dict[tuple[int, bytes], Floats] = {}

    def __call__(self, k: int, network: NDArray[np.bool_]) -> Floats:
        """C at an instant under a network, computed once."""
        key = (k, network.tobytes())
        if key not in self.kept:
            rows = 0.5 * (self.rows[k] + self.rows[k + 1])
            ends = [synthesize(self.sc, step=i, adjacency=network).rows for i in (k, k + 1)]
            rows[: len(network)] = 0.5 * (ends[0] + ends[1])
            self.kept[key] = self.m.B @ rows
        return self.kept[key]


class Circles:
    """The circles of one game: who is watched from where, and at which radius; then the capture circles.

    Two players of the same radius see each other across one and the same circle: its edges change as one.
    """

    def __init__(self, sc: Scenario) -> None:
        m, size = len(sc.constrained), sc.n + 1
        shared: dict[tuple[int, int, float], list[tuple[int, int]]] = {}
        for i in range(m):
            for j in range(size) if np.isfinite(sc.visibility_radii[i]) else ():
                one, other = (min(i, j), max(i, j)) if i != j else (i, size)
                shared.setdefault((one, other, float(sc.visibility_radii[i])), []).append((i, j))
        self.edges = list(shared.values())
        # one row for each circle: w = row @ z; the own column of 𝒜 stands for the attacker, at the origin
        self.rows = np.zeros((len(self.edges) + size, size))
        for s, ((i, j), *_) in enumerate(self.edges):
            self.rows[s, i] = 1.0
            if i != j:
                self.rows[s, j] = -1.0
        self.rows[len(self.edges) :] = np.eye(size)
        self.square = np.array([*(radius for _, _, radius in shared), *map(float, sc.capture_radii)]) ** 2
        self.where = [tuple(np.array(pairs).T) for pairs in self.edges]
        """Indices of the circle's edges in 𝒜."""

    def values(self, z: Floats) -> Floats:
        """F of every circle."""
        w = self.rows @ z
        values: Floats = np.sum(w * w, axis=1) - self.square
        return values

    def slopes(self, z: Floats, C: Floats) -> Floats:
        """F' of every circle under ż = Cz."""
        slopes: Floats = 2.0 * np.sum((self.rows @ z) * (self.rows @ (C @ z)), axis=1)
        return slopes


def flow(C: Floats, z: Floats, h: float) -> Callable[[float], Floats]:
    """exp(Cs)z as a function of s in [0, h]: its Taylor series, or the exponential where that is too long."""
    if np.abs(C).sum(axis=1).max() * h > 0.5:
        return lambda s: np.asarray(expm(C * s) @ z)
    terms = [z]
    for j in range(1, _DEGREE):
        terms.append(C @ terms[-1] / j)
    series, powers = np.stack(terms), np.arange(_DEGREE)
    return lambda s: np.tensordot(s**powers, series, axes=1)
