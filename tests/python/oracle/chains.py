"""On/off chains on a grid, each as the list of the steps at which it flips, and the mask that they make."""

import numpy as np

from .philox import EDGE, LINK, SENSOR, uniforms

NEVER = 2**31


def leaving(up, down, step):
    """Probabilities of leaving the states up and down within one step, exactly for a chain in continuous time."""
    a, b = 1 / up, 1 / down
    if a + b == 0:
        return 0.0, 0.0
    moved = -np.expm1(-(a + b) * step)
    return a / (a + b) * moved, b / (a + b) * moved


def stationary_share(up, down):
    """The share of time up."""
    a, b = 1 / up, 1 / down
    return 1.0 if a == 0 else b / (a + b)


def wait(u, p):
    """Steps until a flip of probability p per step, by inversion of the geometric law."""
    if p == 0:
        return NEVER
    with np.errstate(divide="ignore"):
        return min(1 + int(np.floor(np.log(u) / np.log1p(-p))), NEVER)


def states(up, down, step, steps, draw, *, stationary=False):
    """Whether the chain is up at steps 0 … steps; ``draw(index)`` gives its uniform numbers."""
    state = not stationary or (1 / up == 0) or bool(draw(0) < stationary_share(up, down))
    out = np.empty(steps + 1, dtype=bool)
    at, flip = 0, 1
    probabilities = leaving(up, down, step)
    while at <= steps:
        p = probabilities[0 if state else 1]
        after = at + (wait(draw(flip), p) if p > 0 else NEVER)
        out[at:after] = state
        at, flip, state = after, flip + 1, not state
    return out


def _family(purpose, entity, up, down, stationary, game, key):
    def draw(index):
        return uniforms(*key, purpose, entity, index)[0]

    return states(up, down, game.step, game.steps, draw, stationary=stationary)


def sensors(world, game, key):
    """Whether each sensor works, (K + 1, m)."""
    rows = zip(world.to_failure, world.to_repair, world.stationary, strict=True)
    return np.array([_family(SENSOR, i, u, d, s, game, key) for i, (u, d, s) in enumerate(rows)]).T


def edges(world, game, key):
    """Whether player i would detect j in range, (K + 1, m, N)."""
    m, N = game.m, game.N
    out = np.empty((game.steps + 1, m, N), dtype=bool)
    for i, j in np.ndindex(m, N):
        begin = world.stationary[i]
        out[:, i, j] = _family(EDGE, i * N + j, world.detected[i], world.missed[i], begin, game, key)
    return out


def links(world, game, key):
    """Whether the link by which i hears j is up, (K + 1, m, m)."""
    m = game.m
    out = np.zeros((game.steps + 1, m, m), dtype=bool)
    for i, j in np.ndindex(m, m):
        if i != j:
            up, down = world.link_up[j], world.link_down[j]
            out[:, i, j] = _family(LINK, i * m + j, up, down, world.link_stationary, game, key)
    return out


def mask(world, game, key):
    """What can be seen at each instant where distances allow it, (K + 1, m, N)."""
    return sensors(world, game, key)[:, :, None] & edges(world, game, key)
