"""Multilevel splitting: the probability that a score of standard normal numbers is at least 0, be it 1e-8.

An event {S ≥ 0} is reached by levels L₁ < … < L_m, the last just below 0: P = P(S > L₁) · P(S > L₂ | S > L₁) ⋯. Of N
points the share above L₁ is counted; those above begin chains of c states each, N/c chains, which stay above L₁ and
leave the normal law given that unchanged; and so on.

==============  ==================================  =======================================================
symbol          here                                meaning
==============  ==================================  =======================================================
u               a row of points                     independent standard normal numbers
c               ``Ladder.lengths``                  states of a chain
L               ``Ladder.levels``                   S > L: above the level
ρ, √(1 − ρ²)    ``Ladder.strides`` (the second)     u' = ρ u + √(1 − ρ²) ξ, taken where S(u') > L
p_i             ``Climb.rates``                     share of the points above level i among those above i − 1
==============  ==================================  =======================================================

A *pilot* chooses levels, each with a tenth of the points above, strides by how many moves are taken, and the lengths
of chains. *Production* keeps all three: then the product of the shares is unbiased whatever they are, since each state
of a chain has the law of its first, and every point above a level begins, in the mean, as many chains as any other
(Del Moral, Feynman-Kac Formulae, 2004; Au and Beck, Probabilistic Engineering Mechanics 16, 2001). Chains as long as it
takes to have N states again would not do: where few points are above they are longer and forget more, which at P = 1e-8
with N = 1,000 is a bias of 2 %. Replications are independent, each with a Philox key of its own, played side by side.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import Floats, Integers

Score = Callable[[Floats], tuple[Floats, Integers]]
"""Scores of points (M, d), and a code of how each ended."""

LAST = -5e-324
"""The last level: a score is above it exactly where it is at least 0."""
SHARE = 0.1
"""Share of the points above the next level, in the pilot."""
_TAKEN = 0.4  # share of the moves that should be taken
_STRIDES = 0.02, 1.0
_LONGEST = 20  # states of a chain
_RAREST = 1e-30  # beyond it quantiles of doubles say nothing
_MOST_LEVELS = 60


@dataclass(frozen=True)
class Ladder:
    """What the pilot chose."""

    levels: Floats
    """L₁ < … < L_m."""
    strides: Floats
    """√(1 − ρ²) of the chains above each level but the last."""
    lengths: Integers
    """States of each of these chains."""
    inflation: float
    """Σ_i (1 − p_i)/p_i times what the correlation within chains adds: the squared relative error of one point."""
    probability: float
    """The pilot's own estimate, of which nothing is said but its size."""


class StuckError(Exception):
    """The pilot gets no further; ``above`` is the share of the law that it reached."""

    def __init__(self, above: float, *, tied: bool) -> None:
        super().__init__(above)
        self.above, self.tied = above, tied


@dataclass(frozen=True)
class Climb:
    """Replications of the production."""

    rates: Floats
    """Share of the points above each level, (R, m); 0 from where none were."""
    ended: list[Integers]
    """Of each replication the codes of the points that reached the event."""
    estimates: Floats
    """One for each replication."""


class _Points(NamedTuple):
    """Points of one replication after another."""

    owner: Integers
    """Which replication."""
    u: Floats
    score: Floats
    code: Integers

    def take(self, rows: NDArray[Any]) -> _Points:
        return _Points(*(array[rows] for array in self))


def pilot(
    score: Score, rng: np.random.Generator, u: Floats, scores: Floats, count: int
) -> Generator[int, None, Ladder]:
    """Choose levels and strides, from points of the law with their scores; yields how many games a move has played."""
    levels: list[float] = []
    strides: list[float] = []
    lengths: list[int] = []
    above, spread, stride, length = 1.0, 0.0, 0.8, 1
    now = _Points(np.zeros(len(u), dtype=np.int64), u, scores, np.zeros(len(u), dtype=np.int64))
    while True:
        level = _next_level(now.score, above)
        hit = now.score > level
        rate = float(hit.mean())
        spread += _spread(hit.reshape(length, -1), rate)
        above *= rate
        levels.append(level)
        if level == LAST:
            return Ladder(np.array(levels), np.array(strides), np.array(lengths), spread, above)
        if above < _RAREST or len(levels) >= _MOST_LEVELS:
            raise StuckError(above, tied=False)
        length = min(max(round(1.0 / rate), 2), _LONGEST)
        chains = round(count / length)
        state = now.take(np.flatnonzero(hit)[_seeds(rng, int(hit.sum()), chains)])
        kept = [state]
        for move in range(1, length):
            state, taken = _moved(score, state, level, stride, [rng])
            kept.append(state)
            stride = float(np.clip(stride * math.exp((taken - _TAKEN) / math.sqrt(move)), *_STRIDES))
            yield chains
        strides.append(stride)
        lengths.append(length)
        now = _Points(*(np.concatenate(arrays) for arrays in zip(*kept, strict=True)))


def climb(
    score: Score, dim: int, ladder: Ladder, rngs: Sequence[np.random.Generator], count: int
) -> Generator[int, None, Climb]:
    """So many points for each generator, a replication; yields how many games a move has played."""
    u = np.concatenate([rng.standard_normal((count, dim)) for rng in rngs])
    now = _Points(np.repeat(np.arange(len(rngs)), count), u, *score(u))
    yield len(u)
    rates = np.zeros((len(rngs), len(ladder.levels)))
    points = count
    for i, level in enumerate(ladder.levels):
        now = now.take(now.score > level)
        above = np.bincount(now.owner, minlength=len(rngs))
        rates[:, i] = above / points
        if level == LAST or not len(now.u):
            break
        length = int(ladder.lengths[i])
        chains = max(round(count / length), 1)
        points = chains * length
        first = np.cumsum(above) - above
        seeds = [at + _seeds(rng, many, chains) for at, many, rng in zip(first, above, rngs, strict=True) if many]
        state = now.take(np.concatenate(seeds))
        kept = [state]
        for _ in range(1, length):
            state, _ = _moved(score, state, level, float(ladder.strides[i]), rngs)
            kept.append(state)
            yield len(state.u)
        now = _joined(kept)
    return Climb(rates, [now.code[now.owner == r] for r in range(len(rngs))], np.prod(rates, axis=1))


def _seeds(rng: np.random.Generator, many: int, chains: int) -> Integers:
    """Where so many chains begin, each of the points as often as any other in the mean."""
    whole, rest = divmod(chains, many)
    return np.concatenate([np.tile(np.arange(many), whole), rng.permutation(many)[:rest]])


def _moved(
    score: Score, state: _Points, level: float, stride: float, rngs: Sequence[np.random.Generator]
) -> tuple[_Points, float]:
    """Every chain one move on, and the share of the moves that were taken."""
    many = np.bincount(state.owner, minlength=len(rngs))
    noise = [rng.standard_normal((n, state.u.shape[1])) for n, rng in zip(many, rngs, strict=True) if n]
    u = math.sqrt(1.0 - stride * stride) * state.u + stride * np.concatenate(noise)
    new = _Points(state.owner, u, *score(u))
    taken = new.score > level
    moved = (np.where(taken[:, None] if a.ndim > 1 else taken, a, b) for a, b in zip(new, state, strict=True))
    return _Points(*moved), float(taken.mean())


def _joined(kept: list[_Points]) -> _Points:
    """All states, those of each replication together."""
    all_of = _Points(*(np.concatenate(arrays) for arrays in zip(*kept, strict=True)))
    return all_of.take(np.argsort(all_of.owner, kind="stable"))


def _next_level(scores: Floats, above: float) -> float:
    """The level that a tenth of the scores is above, or the last; where scores tie, one that some are above."""
    falling = np.sort(scores)[::-1]
    level = float(falling[min(round(SHARE * len(falling)), len(falling) - 1)])
    if level >= 0.0:
        return LAST
    if falling[0] > level:
        return level
    lower = falling[falling < level]
    if not len(lower):
        raise StuckError(above, tied=True)
    return float(lower[0])


def _spread(hit: NDArray[np.bool_], rate: float) -> float:
    """(1 − p)/p, times how much more the mean of a chain (a column) varies than that of as many independent points."""
    if rate >= 1.0:
        return 0.0
    length, chains = hit.shape
    more = length * float(hit.mean(axis=0).var()) / (rate * (1.0 - rate)) if min(length, chains) > 1 else 1.0
    return (1.0 - rate) / rate * max(more, 1.0)
