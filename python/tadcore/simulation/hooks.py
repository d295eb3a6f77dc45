"""What a caller may give to a run: a seed, a trial, and a function that decides the network."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import Floats, as_index
from tadcore.errors import ScenarioError

Network: TypeAlias = Callable[[int, float, Floats, NDArray[np.bool_]], NDArray[np.bool_]]
"""``f(k, t, positions, sight)``: the network in use at instant k, bool (m, N), in the place of what is seen."""

MOST_SEED, MOST_TRIAL = 2**64 - 1, 2**56 - 1


def as_seed(seed: object) -> int:
    """A whole number that fits the key of the generator."""
    return as_index("seed", seed, MOST_SEED)


def as_trial(field: str, trial: object) -> int:
    """A whole number that fits its counter."""
    return as_index(field, trial, MOST_TRIAL)


def as_network(network: object) -> Network | None:
    """A function, or none."""
    if network is not None and not callable(network):
        rule = "a function f(k, t, positions, sight) that returns a bool array of shape (m, N)"
        raise ScenarioError("network", network, rule)
    return network
