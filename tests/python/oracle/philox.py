"""Philox4x32-10 (Salmon, Moraes, Dror and Shaw, SC 2011) and the numbers that a world draws from it.

The layout is that of docs/theory/worlds.md. Counters are arrays or numbers, so that many draws are one call.
"""

import numpy as np

MULTIPLIERS = (0xD2511F53, 0xCD9E8D57)
WEYL = (0x9E3779B9, 0xBB67AE85)
LOW = np.uint64(0xFFFFFFFF)
HALF = np.uint64(32)

SENSOR, EDGE, LINK, SHOCK, SHOCK_THIRD = 1, 2, 3, 4, 5
"""Purposes; of a disturbance two axes come from one block, the third from another."""


def philox(counter, key):
    """Four words from four words of a counter and two of a key, all arrays that broadcast."""
    c = [np.asarray(word, dtype=np.uint64) for word in counter]
    k = [np.asarray(word, dtype=np.uint64) for word in key]
    for _ in range(10):
        first, second = c[0] * np.uint64(MULTIPLIERS[0]), c[2] * np.uint64(MULTIPLIERS[1])
        c = [(second >> HALF) ^ c[1] ^ k[0], second & LOW, (first >> HALF) ^ c[3] ^ k[1], first & LOW]
        k = [(word + np.uint64(step)) & LOW for word, step in zip(k, WEYL, strict=True)]
    return c


def uniforms(seed, trial, purpose, entity, index):
    """The two numbers in (0, 1) of one block."""
    trial = np.asarray(trial, dtype=np.uint64)
    counter = (index, entity, trial & LOW, np.uint64(purpose << 24) + (trial >> HALF))
    w = philox(counter, (seed & 0xFFFFFFFF, seed >> 32))

    def number(low, high):
        return ((high << HALF | low) >> np.uint64(12)).astype(float) * 2.0**-52 + 2.0**-53

    return number(w[0], w[1]), number(w[2], w[3])
