"""What surrounds a game: sensors, edges and links that fail, reports between players, disturbances.

A world is plain numbers; `Course` is one trial of it: its chains played out, the network of positions at an instant,
and the displacement of every player over a step.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from . import chains
from .network import adjacency, distances
from .philox import SHOCK, SHOCK_THIRD, uniforms
from .relay import relay


@dataclass(frozen=True)
class World:
    """Arrays over the m players with limited sight, unless said otherwise."""

    to_failure: np.ndarray
    to_repair: np.ndarray
    detected: np.ndarray
    missed: np.ndarray
    stationary: np.ndarray
    disturbance: np.ndarray
    """ς of all players, (n + 2,)."""
    link_radius: np.ndarray | None = None
    """ρ of what each sends; NaN: it sends nothing. None: there are no links at all."""
    relays: int | None = None
    common: bool = False
    link_up: np.ndarray | None = None
    link_down: np.ndarray | None = None
    link_stationary: bool = False


def still(game, **fields):
    """A world in which nothing happens, but for the fields named."""
    never, n = np.full(game.m, np.inf), game.n
    base = {"to_failure": never, "to_repair": never, "detected": never, "missed": never}
    base |= {"stationary": np.zeros(game.m, dtype=bool), "disturbance": np.zeros(n + 2)}
    return World(**(base | {"link_up": never, "link_down": never} | fields))


class Course:
    """One trial of a world: everything that does not depend on where the players are."""

    def __init__(self, world, game, axes, *, seed=0, trial=0):
        self.world, self.game, self.axes = world, game, axes
        self.key = (seed, trial)
        self.mask = chains.mask(world, game, self.key)
        self.links = None if world.link_radius is None else chains.links(world, game, self.key)

    def heard(self, k, positions):
        """Whom each hears at instant k, (m, m)."""
        m = self.game.m
        if self.links is None:
            return np.zeros((m, m), dtype=bool)
        near = distances(positions)[:m, :m] <= self.world.link_radius[None, :]
        return near & self.links[k] & ~np.eye(m, dtype=bool)

    def network(self, k, positions, zeta, sight=None):
        """The network in use and what is seen, (m, N) each; ``sight`` instead of the closed balls where given."""
        seen = (adjacency(positions, zeta) if sight is None else sight) & self.mask[k]
        if self.links is None:
            return seen, seen
        return relay(seen, self.heard(k, positions), self.world.relays, self.world.common), seen

    def shock(self, k):
        """What is added to each position after the step from instant k, (n + 2, axes)."""
        out = np.zeros((self.game.n + 2, self.axes))
        for p, size in enumerate(self.world.disturbance):
            if size > 0:
                numbers = [*uniforms(*self.key, SHOCK, p, k), uniforms(*self.key, SHOCK_THIRD, p, k)[0]]
                out[p] = size * np.sqrt(self.game.step) * ndtri(np.array(numbers[: self.axes], dtype=float))
        return out


def margin(world, positions, m):
    """How close any two players are to the rim of a link: how much rounding the network bears."""
    if world.link_radius is None:
        return np.inf
    gap = np.abs(distances(positions)[:m, :m] - world.link_radius[None, :])[~np.eye(m, dtype=bool)]
    return np.min(gap[np.isfinite(gap)], initial=np.inf)
