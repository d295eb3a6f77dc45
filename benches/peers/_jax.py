"""The lockstep Monte Carlo in JAX: `lax.scan` over instants, `vmap` over a batch, from a table that is full already.

JAX compiles one program of fixed shape: nobody leaves a batch early, and a missing entry cannot be solved on the way.
So it gets the table that Numba filled with the same trials, and only its warm speed is compared. Double precision, one
CPU.
"""

import os

os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
os.environ["JAX_PLATFORMS"] = "cpu"

import jax
import jax.numpy as jnp
import numpy as np

jax.config.update("jax_enable_x64", True)

BATCH = 4_000
BIT = 1 << (4 * np.arange(3)[:, None] + np.arange(4))
"""Bit of entry (i, j) of the augmented adjacency."""


def _look(z, sight, capture):
    """Code of the outcome (-1 none, -2 captured, else the defender) and the topology of one trial."""
    own = jnp.sum(z * z, axis=1)
    between = jnp.sum((z[:3, None] - z[None]) ** 2, axis=-1)
    distance = jnp.where(np.eye(3, 4, dtype=bool), own[:3, None], between)
    key = jnp.sum(jnp.where(distance <= sight[:, None], BIT, 0))
    within = jnp.where(own[:3] <= capture[:3], own[:3], jnp.inf)
    caught = jnp.where(jnp.isfinite(within).any(), jnp.argmin(within), jnp.where(own[3] <= capture[3], -2, -1))
    return caught, key


@jax.jit
def _play(z, sight, capture, index, table):
    """Outcome codes and final instants of one batch."""

    def one(z, end, instant, k, row):
        caught, key = _look(z, sight, capture)
        ends = (end == -1) & (caught != -1)
        end, instant = jnp.where(ends, caught, end), jnp.where(ends, k, instant)
        return jnp.where(end == -1, table[row[key]] @ z, z), end, instant

    def instant(state, step):
        return jax.vmap(one, in_axes=(0, 0, 0, None, None))(*state, *step), None

    steps = index.shape[0]
    start = (z, jnp.full(len(z), -1), jnp.full(len(z), steps))
    (z, end, when), _ = jax.lax.scan(instant, start, (jnp.arange(steps), index))
    last, _ = jax.vmap(lambda z: _look(z, sight, capture))(z)
    return jnp.where(end == -1, last, end), when


def play(memo, positions, sight, capture):
    """Outcome codes, defenders and final times, in batches; `memo` holds every entry that the trials need."""
    z = positions[:, :-1] - positions[:, -1:]
    index, table = jnp.asarray(memo.index), jnp.asarray(memo.table[: memo.filled])
    parts = []
    for first in range(0, len(z), BATCH):
        part = z[first : first + BATCH]
        padded = np.concatenate([part, np.broadcast_to(part[:1], (BATCH - len(part), *part.shape[1:]))])
        ends, when = _play(padded, sight**2, capture**2, index, table)
        parts.append((np.asarray(ends)[: len(part)], np.asarray(when)[: len(part)]))
    ends, instants = (np.concatenate(column) for column in zip(*parts, strict=True))
    return np.select([ends == -1, ends == -2], [0, 1], 2), np.where(ends >= 0, ends, -1), instants * memo.game.step
