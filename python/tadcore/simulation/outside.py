"""A network from outside: a function of the caller's, asked at every instant of a recorded run."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import Floats
from tadcore.errors import ScenarioError

Network: TypeAlias = Callable[[int, float, Floats, NDArray[np.bool_]], NDArray[np.bool_]]
"""``f(k, t, positions, sight)``: the network in use at instant k, bool (m, N), in the place of what is seen."""


def as_network(network: object) -> Network | None:
    """A function, or none."""
    if network is not None and not callable(network):
        rule = "a function f(k, t, positions, sight) that returns a bool array of shape (m, N)"
        raise ScenarioError("network", network, rule)
    return network
