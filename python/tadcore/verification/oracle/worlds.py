"""A trial of a world by NumPy and SciPy: failures, links and disturbances from (seed, trial), and who is told what.

`docs/theory/worlds.md` has the laws and the layout of the random numbers. Nothing here asks the compiled core.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtri

from tadcore._shared.arrays import Floats
from tadcore.scenario.model import Scenario
from tadcore.scenario.worlds import World

Bits = NDArray[np.bool_]

_SENSOR, _EDGE, _LINK, _PLANE, _SPACE = range(1, 6)  # purposes
_LOW = np.uint64(0xFFFFFFFF)
_BITS = np.uint64(32)
_NEVER = 2**31


def blocks(seed: int, trial: int, purpose: int, entity: ArrayLike, index: ArrayLike) -> tuple[Floats, Floats]:
    """The two numbers in (0, 1) of Philox4x32-10 at key ``seed`` and counter (index, entity, trial, purpose)."""
    entity, index = np.broadcast_arrays(np.asarray(entity, dtype=np.uint64), np.asarray(index, dtype=np.uint64))
    low, high = np.uint64(trial & 0xFFFFFFFF), np.uint64((purpose << 24) + (trial >> 32))
    x0, x1, x2, x3 = index, entity, np.full_like(entity, low), np.full_like(entity, high)
    key = [seed & 0xFFFFFFFF, seed >> 32]
    for _ in range(10):
        one, two = x0 * np.uint64(0xD2511F53), x2 * np.uint64(0xCD9E8D57)
        x0, x2 = (two >> _BITS) ^ x1 ^ np.uint64(key[0]), (one >> _BITS) ^ x3 ^ np.uint64(key[1])
        x1, x3 = two & _LOW, one & _LOW
        key = [(key[0] + 0x9E3779B9) & 0xFFFFFFFF, (key[1] + 0xBB67AE85) & 0xFFFFFFFF]

    def number(first: NDArray[np.uint64], second: NDArray[np.uint64]) -> Floats:
        bits = (second << _BITS | first) >> np.uint64(12)
        return bits.astype(np.float64) * 2.0**-52 + 2.0**-53

    return number(x0, x1), number(x2, x3)


@dataclass(frozen=True)
class Draws:
    """One trial of a world over a whole grid of K + 1 instants."""

    sensor_up: Bits
    """(K + 1, m)."""
    edge_up: Bits
    """(K + 1, m, N)."""
    link_up: Bits | None
    """(K + 1, m, m), the diagonal of no meaning; None without links."""
    displacement: Floats
    """(K + 1, n + 2, dim); that of the last row belongs to no step."""


def draws_of(sc: Scenario, world: World, seed: int, trial: int) -> Draws:
    """What a trial draws."""
    m, N, K = len(sc.constrained), sc.n + 1, sc.steps
    each = np.arange(m)
    key = seed, trial
    working = _Chains(world.mean_time_to_failure, world.mean_time_to_repair, world.stationary, _SENSOR, each)
    sensors = working.played(sc, key)
    of = np.repeat(each, N)
    detected = world.mean_time_detected[of], world.mean_time_missed[of], world.stationary[of]
    edges = _Chains(*detected, _EDGE, np.arange(m * N)).played(sc, key).reshape(K + 1, m, N)
    links = None
    if world.link_mean_time_up is not None and world.link_mean_time_down is not None:
        of = np.tile(each, m)  # the speaker
        talk = world.link_mean_time_up[of], world.link_mean_time_down[of], np.full(m * m, world.link_stationary)
        links = _Chains(*talk, _LINK, np.arange(m * m)).played(sc, key).reshape(K + 1, m, m)
    return Draws(sensors, edges, links, _displacements(sc, world, key))


@dataclass(frozen=True)
class _Chains:
    """On/off chains: mean times up and down, whether they begin stationary, and where their numbers are drawn."""

    up: Floats
    down: Floats
    stationary: Bits
    purpose: int
    entity: NDArray[np.int_]

    def played(self, sc: Scenario, key: tuple[int, int]) -> Bits:
        """Whether each is up, (K + 1, entities): its flips one after another, by inversion."""
        K, step, many = sc.steps, sc.horizon / sc.steps, len(self.entity)
        a, b = 1.0 / self.up, 1.0 / self.down
        total = np.where(a + b > 0.0, a + b, 1.0)
        moved = -np.expm1(-(a + b) * step)
        leave = np.stack([b / total * moved, a / total * moved])  # from down, from up
        first = self._numbers(key, 0) < b / total
        state = np.where(self.stationary & (a > 0.0), first, True)
        start = state.copy()
        flips = np.zeros((K + 2, many), dtype=np.int64)
        at, flip = np.zeros(many, dtype=np.int64), 0
        while (at <= K).any():
            flip += 1
            p = leave[state.astype(int), np.arange(many)]
            with np.errstate(divide="ignore", invalid="ignore"):
                held = np.log(self._numbers(key, flip)) / np.log1p(-p)
            held = np.where(p > 0.0, np.minimum(held, float(_NEVER)), float(_NEVER))
            at = np.minimum(at + 1 + held.astype(np.int64), K + 1)
            np.add.at(flips, (at, np.arange(many)), 1)
            state = ~state
        return np.asarray(start ^ (np.cumsum(flips[: K + 1], axis=0) % 2 == 1))

    def _numbers(self, key: tuple[int, int], index: int) -> Floats:
        return blocks(*key, self.purpose, self.entity, index)[0]


def _displacements(sc: Scenario, world: World, key: tuple[int, int]) -> Floats:
    player, k = np.meshgrid(np.arange(sc.n + 2), np.arange(sc.steps + 1))
    numbers = [*blocks(*key, _PLANE, player, k), blocks(*key, _SPACE, player, k)[0]][: sc.dim]
    size = world.disturbance * np.sqrt(sc.horizon / sc.steps)
    return np.asarray(size[None, :, None] * ndtri(np.stack(numbers, axis=-1)))


def told(seen: Bits, heard: Bits, *, relays: int | None, common: bool) -> Bits:
    """What everyone may use, (rows, m, N), from what each sees, (rows, m, N), and hears, (rows, m, m)."""
    rows, m, N = seen.shape
    both = np.concatenate([seen.reshape(rows, -1), heard.reshape(rows, -1)], axis=1)
    kinds, which = np.unique(both, axis=0, return_inverse=True)
    answers = [_told(k[: m * N].reshape(m, N), k[m * N :].reshape(m, m), relays, common=common) for k in kinds]
    return np.stack(answers)[which.reshape(-1)]


def _told(seen: Bits, heard: Bits, relays: int | None, *, common: bool) -> Bits:
    m, N = seen.shape
    reports = np.eye(m, dtype=bool)
    for _ in range(m if relays is None else min(relays + 1, m)):
        reports = reports | (reports.astype(int) @ heard.astype(int) > 0)
    sees = np.zeros((m, N + 1), dtype=bool)  # the attacker's column last
    sees[:, :N], sees[:, N] = seen, np.diagonal(seen)
    sees[np.arange(m), np.arange(m)] = False
    used = np.zeros((m, N), dtype=bool)
    for i in range(m):
        graph = np.eye(N + 1, dtype=int)
        graph[:m] += sees * reports[i][:, None]
        if common:
            graph[i, :m] += reports[i]
        graph += graph.T
        component = np.arange(N + 1) == i
        for _ in range(N + 1):
            component = graph @ component > 0
        used[i] = component[:N]
        used[i, i] = component[N]
    return used
