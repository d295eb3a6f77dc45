"""Where the draws of a study come from: streams by counter, and points of the unit cube by design.

A study is cut into chunks of `CHUNK` trials, whatever its length, and everything drawn for a chunk is a function of
(seed, chunk, purpose) alone:

* **random**: one Philox stream for each varied quantity, ``Philox(key=(seed, chunk), counter=(0, 0, 0, purpose))``.
  Streams with different keys are independent, so adjacent seeds or chunks share nothing; streams of one key are 2¹⁹²
  blocks apart. What one quantity draws does not depend on which others vary.
* **sobol**: one Sobol' sequence through all chunks, scrambled by the seed (`scipy.stats.qmc.Sobol`), moved to the
  middle of its cells of width 2⁻³², so that no point lies on the faces of the cube.
* **latin**: a Latin hypercube of its own for each chunk (`scipy.stats.qmc.LatinHypercube`). A chunk is always drawn
  whole and then cut, so a study of 1,000 trials is the beginning of one of 10,000; it is stratified chunk by chunk.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from .base import HIGHEST, LOWEST

CHUNK = 8192
"""Trials in a chunk; a constant, since the draws depend on it."""

STREAM = 1
"""Version of the streams; another version draws other numbers from the same seed."""

Design: TypeAlias = Literal["random", "sobol", "latin"]
DESIGNS: tuple[str, ...] = get_args(Design)

_SOBOL_BITS = 32  # the most that SciPy can skip through


def generator(seed: int, chunk: int, purpose: int) -> np.random.Generator:
    """The stream of one quantity in one chunk."""
    words = {"key": [seed, chunk], "counter": [0, 0, 0, purpose]}
    return np.random.Generator(np.random.Philox(**{k: np.array(v, dtype=np.uint64) for k, v in words.items()}))


def unit_points(design: Design, seed: int, chunk: int, layout: Sequence[tuple[int, int]]) -> list[NDArray[np.float64]]:
    """Points of the open unit cube for one chunk.

    Parameters
    ----------
    design : {"random", "sobol", "latin"}
        The kind of points.
    seed, chunk : int
        Which study, and which of its chunks.
    layout : sequence of (purpose, coordinates)
        The quantities that draw, in the order of the axes of the cube.

    Returns
    -------
    list of ndarray, each of shape (CHUNK, coordinates)
        One array for each entry of the layout.
    """
    if design == "random":
        drawn = [generator(seed, chunk, purpose).random((CHUNK, wanted)) for purpose, wanted in layout]
        return [np.maximum(points, LOWEST) for points in drawn]
    axes = sum(wanted for _, wanted in layout)
    if not axes:
        return [np.empty((CHUNK, 0)) for _ in layout]
    cube = (_sobol if design == "sobol" else _latin)(axes, seed, chunk)
    ends = np.cumsum([wanted for _, wanted in layout])
    return np.split(cube, ends[:-1].tolist(), axis=1)


def _sobol(axes: int, seed: int, chunk: int) -> NDArray[np.float64]:
    from scipy.stats import qmc

    engine = qmc.Sobol(axes, scramble=True, bits=_SOBOL_BITS, rng=_scrambler(seed))
    if chunk:
        engine.fast_forward(chunk * CHUNK)
    points: NDArray[np.float64] = engine.random(CHUNK)
    return points + 0.5 ** (_SOBOL_BITS + 1)


def _latin(axes: int, seed: int, chunk: int) -> NDArray[np.float64]:
    from scipy.stats import qmc

    points: NDArray[np.float64] = qmc.LatinHypercube(axes, rng=_scrambler(seed, chunk)).random(CHUNK)
    return np.clip(points, LOWEST, HIGHEST)


def _scrambler(seed: int, *chunk: int) -> np.random.Generator:
    """SciPy's engines spawn from a seed sequence, which a keyed Philox does not have."""
    return np.random.Generator(np.random.Philox(np.random.SeedSequence(seed, spawn_key=chunk)))
