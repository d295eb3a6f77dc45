"""The team criterion: who knows everything plays its row of the equilibrium, and Θ is least over the other rows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from tadcore.scenario.model import Scenario


def held(sc: Scenario, adjacency: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whose row is held at the equilibrium, (…, m) for networks (…, m, N); nobody's under the paper's criterion."""
    whole: NDArray[np.bool_] = np.asarray(np.all(adjacency, axis=-1))
    return whole if sc.criterion == "component" else np.zeros_like(whole)


def chosen(sc: Scenario, adjacency: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The entries of 𝒜 that leave something to choose, of the same shape."""
    return np.asarray(adjacency & ~held(sc, adjacency)[..., None])
