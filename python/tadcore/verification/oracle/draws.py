"""Random numbers that are a function of a seed and of what they are drawn for."""

from __future__ import annotations

from typing import Any

import numpy as np

from tadcore._shared.arrays import as_seed


def generator(seed: Any, draw: int) -> np.random.Generator:
    """Philox keyed by the seed and the number of the draw, 0 … 2⁶⁴ - 1."""
    return np.random.Generator(np.random.Philox(key=np.array([as_seed(seed), draw], dtype=np.uint64)))
