"""The lockstep Monte Carlo for three defenders in the plane, written out for the compiler: the strongest form in Numba.

States are eight contiguous rows, one for each coordinate of z, so that the loop over trials that looks at distances has
no branch and no call in it and is vectorised. Trials that end are replaced by the last one: the rest stay contiguous.
A block of trials is as large as the second-level cache; the table is one flat array, 16 numbers an entry, indexed by
(step, topology). Nothing is allocated inside the loops. Missing entries are solved by `_strong.entry`.
"""

import _strong
import numpy as np
from numba import njit

BLOCK = 2048


@njit(cache=True, error_model="numpy")
def _look(z, count, s0, s1, s2, c0, c1, c2, c3, keys, over):
    """Topology of every trial, and whether anything ends it."""
    x0, y0, x1, y1, x2, y2, x3, y3 = z[0], z[1], z[2], z[3], z[4], z[5], z[6], z[7]
    for a in range(count):
        d0 = x0[a] * x0[a] + y0[a] * y0[a]
        d1 = x1[a] * x1[a] + y1[a] * y1[a]
        d2 = x2[a] * x2[a] + y2[a] * y2[a]
        d3 = x3[a] * x3[a] + y3[a] * y3[a]
        u, v = x1[a] - x0[a], y1[a] - y0[a]
        d01 = u * u + v * v
        u, v = x2[a] - x0[a], y2[a] - y0[a]
        d02 = u * u + v * v
        u, v = x3[a] - x0[a], y3[a] - y0[a]
        d03 = u * u + v * v
        u, v = x2[a] - x1[a], y2[a] - y1[a]
        d12 = u * u + v * v
        u, v = x3[a] - x1[a], y3[a] - y1[a]
        d13 = u * u + v * v
        u, v = x3[a] - x2[a], y3[a] - y2[a]
        d23 = u * u + v * v
        # entry (i, j) of the augmented adjacency is bit 4 i + j
        first = (d0 <= s0) * 1 + (d01 <= s0) * 2 + (d02 <= s0) * 4 + (d03 <= s0) * 8
        second = (d01 <= s1) * 16 + (d1 <= s1) * 32 + (d12 <= s1) * 64 + (d13 <= s1) * 128
        third = (d02 <= s2) * 256 + (d12 <= s2) * 512 + (d2 <= s2) * 1024 + (d23 <= s2) * 2048
        keys[a] = first + second + third
        over[a] = (d0 <= c0) | (d1 <= c1) | (d2 <= c2) | (d3 <= c3)


@njit(cache=True, error_model="numpy")
def _who(z, a, capture):
    """Who ended trial a: the nearest defender within its own reach, or -2 for the attacker."""
    nearest, caught = np.inf, -2
    for i in range(3):
        d = z[2 * i, a] * z[2 * i, a] + z[2 * i + 1, a] * z[2 * i + 1, a]
        if d <= capture[i] and d < nearest:
            nearest, caught = d, i
    return caught


@njit(cache=True, error_model="numpy")
def _advance(z, entries, table, count):
    """z ← E z for every trial."""
    x0, y0, x1, y1, x2, y2, x3, y3 = z[0], z[1], z[2], z[3], z[4], z[5], z[6], z[7]
    for a in range(count):
        e = 16 * entries[a]
        p, q, r, s = x0[a], x1[a], x2[a], x3[a]
        x0[a] = table[e] * p + table[e + 1] * q + table[e + 2] * r + table[e + 3] * s
        x1[a] = table[e + 4] * p + table[e + 5] * q + table[e + 6] * r + table[e + 7] * s
        x2[a] = table[e + 8] * p + table[e + 9] * q + table[e + 10] * r + table[e + 11] * s
        x3[a] = table[e + 12] * p + table[e + 13] * q + table[e + 14] * r + table[e + 15] * s
        p, q, r, s = y0[a], y1[a], y2[a], y3[a]
        y0[a] = table[e] * p + table[e + 1] * q + table[e + 2] * r + table[e + 3] * s
        y1[a] = table[e + 4] * p + table[e + 5] * q + table[e + 6] * r + table[e + 7] * s
        y2[a] = table[e + 8] * p + table[e + 9] * q + table[e + 10] * r + table[e + 11] * s
        y3[a] = table[e + 12] * p + table[e + 13] * q + table[e + 14] * r + table[e + 15] * s


@njit(cache=True, error_model="numpy")
def lockstep3(starts, sight, capture, P, r, r_tau, r_a, step, gamma, index, table, filled):
    """Play all trials in blocks, each in lockstep. Outcomes, final instants, and how much of the table is filled."""
    trials, steps = starts.shape[0], index.shape[0]
    ends, instants = np.full(trials, -1), np.full(trials, steps)
    z = np.empty((8, BLOCK))
    ids, keys, entries = np.empty(BLOCK, np.int64), np.empty(BLOCK, np.int32), np.empty(BLOCK, np.int32)
    over = np.empty(BLOCK, np.bool_)
    flat, work = table.reshape(-1), _strong.scratch()
    reach = capture[0], capture[1], capture[2], capture[3]
    for first in range(0, trials, BLOCK):
        count = min(BLOCK, trials - first)
        for a in range(count):
            ids[a] = first + a
            for i in range(4):
                z[2 * i, a], z[2 * i + 1, a] = starts[first + a, i, 0], starts[first + a, i, 1]
        for k in range(steps + 1):
            _look(z, count, sight[0], sight[1], sight[2], *reach, keys, over)
            a = 0
            while a < count:
                if over[a]:
                    ends[ids[a]], instants[ids[a]] = _who(z, a, capture), k
                    count -= 1
                    ids[a], keys[a], over[a] = ids[count], keys[count], over[count]
                    for row in range(8):
                        z[row, a] = z[row, count]
                else:
                    a += 1
            if count == 0 or k == steps:
                break
            here = index[k]
            for a in range(count):
                entry = here[keys[a]]
                if entry < 0:
                    _strong.entry(keys[a], P[k], r, r_tau, r_a, step, gamma, flat[16 * filled : 16 * filled + 16], work)
                    entry = here[keys[a]] = filled
                    filled += 1
                entries[a] = entry
            _advance(z, entries, flat, count)
    return ends, instants, filled
