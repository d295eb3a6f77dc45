"""Random games, networks and starts for the tests, all from a generator that the test seeds."""

from dataclasses import replace

import numpy as np

from oracle.model import Game, Start, uniform
from oracle.riccati import equilibrium, escape_time
from oracle.scenario import as_mapping
from oracle.theta import full

ESCAPES = {
    "n = 1": (uniform("I2", (1.0,), 1.0, 0.8, horizon=4.0, q_atau=0.01, f_atau=0.01), 3.2197539590990143),
    "n = 3, strong evasion": (
        uniform("I2", (1, 1, 1), 1.2, 0.8, horizon=0.2, q_ad=(3,) * 3, f_ad=(3,) * 3, q_atau=0.1, f_atau=0.1),
        0.11905084462320856,
    ),
    "n = 3, cheap attacker": (uniform("I2", (10, 10, 10), 1.2, 0.3, horizon=0.2), 0.15925099506602167),
}
"""Games of I2 without an equilibrium, with their escape times."""


def random_game(rng, interaction, n, *, horizon, step=0.01, low=0.4, high=2.5, **fixed):
    """Draw weights log-uniformly until the game has an equilibrium well beyond its horizon."""

    def weights(size=None):
        return np.exp(rng.uniform(np.log(low), np.log(high), size)).round(4).tolist()

    ones = (1.0,) * n
    while True:
        first = interaction == "I1"
        game = Game(
            interaction,
            horizon,
            step,
            r_d=tuple(weights(n)),
            r_tau=weights(),
            r_a=weights(),
            q_da=tuple(weights(n)) if first else ones,
            f_da=tuple(weights(n)) if first else ones,
            q_ad=tuple(weights(n)),
            f_ad=tuple(weights(n)),
            q_taua=weights() if first else 1.0,
            f_taua=weights() if first else 1.0,
            q_atau=weights(),
            f_atau=weights(),
        )
        game = replace(game, **fixed)
        if escape_time(game, 1.2 * horizon, rtol=1e-8) is None:
            return game


def random_network(rng, game, density=0.6):
    """Draw a network in which at least one player sees something, and not everyone sees everything."""
    while True:
        A = rng.random((game.m, game.N)) < density
        if A.any() and not A.all():
            return A


def random_start(rng, game, axes=2, spread=2.0, sigma=0.05):
    """Draw positions and radii such that the networks of the run are neither empty nor full throughout."""
    positions = rng.uniform(-spread, spread, (game.n + 2, axes)).round(4)
    zeta = rng.uniform(0.4, 1.5 * spread, game.m).round(4)
    return Start(positions, zeta, np.full(game.n + 1, sigma))


def full_P(game, k):
    """The paper's own matrices at t_k."""
    return full(equilibrium(game)[k])


def scenario(game):
    """The game as a scenario whose positions and radii play no part."""
    positions = np.arange(2.0 * (game.n + 2)).reshape(-1, 2)
    start = Start(positions, np.full(game.m, np.inf), np.full(game.n + 1, 0.1))
    import tadcore

    return tadcore.Scenario.model_validate(as_mapping(game, start))
