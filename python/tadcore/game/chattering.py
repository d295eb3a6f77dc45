"""Chattering: stretches of a run in which an edge flips at almost every instant.

Where the control with an edge drives two players apart and the control without it brings them back, the edge flips at
almost every instant: a sliding mode of the continuous game. The number of flips is a property of δ; that it slides is
not. `tadcore.verification.sliding_study` compares a run with its continuous limit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .network import Edge, edges_of
from .recorded import Recorded

_FEWEST_FLIPS = 6
_LONGEST_PAUSE = 5


@dataclass(frozen=True)
class Chatter:
    """A stretch in which one edge flips at almost every instant.

    Attributes
    ----------
    edge : tuple of str
        Who sees whom.
    start, end : float
        Instants of the first and the last flip.
    flips : int
        How many.
    """

    edge: Edge
    start: float
    end: float
    flips: int


def chatter(run: Recorded) -> tuple[Chatter, ...]:
    """Find the stretches of a run in which an edge flips at almost every instant; the same as ``run.chattering``.

    Parameters
    ----------
    run : Run
        The run.

    Returns
    -------
    tuple of Chatter
        Stretches of at least six flips of one edge, never more than five steps apart, in order of time; none after the
        game diverged.
    """
    length = len(run.times) - 1 if run.diverged is None else int(np.searchsorted(run.times, run.diverged.time))
    flips = run.adjacency[1:length] != run.adjacency[: length - 1]
    found = []
    for i, j in np.argwhere(flips.any(axis=0)).tolist():
        at = np.flatnonzero(flips[:, i, j]) + 1
        single = np.zeros(run.adjacency.shape[1:], dtype=np.bool_)
        single[i, j] = True
        (edge,) = edges_of(single, run.scenario.players)
        for part in np.split(at, np.flatnonzero(np.diff(at) > _LONGEST_PAUSE) + 1):
            if len(part) >= _FEWEST_FLIPS:
                found.append(Chatter(edge, float(run.times[part[0]]), float(run.times[part[-1]]), len(part)))
    return tuple(sorted(found, key=lambda c: (c.start, c.edge)))
