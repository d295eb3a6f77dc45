"""Weights decades apart: whatever is called converged is stationary for every player by that player's own measure."""

from dataclasses import replace

import numpy as np
import pytest

import tadcore
from oracle.network import information
from oracle.theta import errors, gradients
from samples import random_game, random_network, scenario


def own_measure(game, P, G, K, A):
    """The largest over players of the gradient's norm relative to the sizes of its parts, of that player alone."""
    g, r = game.gammas, game.r
    slopes = gradients(game, P, K, A, 1)
    parts = errors(game, P, G, 1)
    F = G - (parts[3] if game.interaction == "I1" else np.vstack(parts[1:])) / r[:, None]
    M = F.T @ np.diag(r) @ F
    worst = 0.0
    for i, slope in enumerate(slopes):
        rows = np.linalg.norm(G[i]) + np.linalg.norm(F[i])
        size = 4 * g[0] * r[i] * rows * (np.linalg.norm(parts[0]) + 2 * np.linalg.norm(M))
        if game.interaction == "I1":
            for weight, group in ((g[1], 1), (g[2], 2)):
                W = np.linalg.norm(P[group][: game.n], axis=1)
                size += 8 * weight * W[i] * (W @ (np.linalg.norm(G, axis=1) + np.linalg.norm(F, axis=1)))
            size += 2 * g[3] * r[i] ** 2 * rows
        else:
            size += 2 * g[1 if i < game.n else 2] * r[i] ** 2 * rows
        worst = max(worst, np.linalg.norm(slope) / (size * (1 + np.linalg.norm(information(A[i], i, 1), 2))))
    return worst


@pytest.mark.parametrize("interaction", ["I1", "I2"])
def test_every_player_is_at_its_own_minimum(interaction):
    rng = np.random.default_rng(interaction == "I2")
    converged = 0
    for _ in range(40):
        n = int(rng.integers(2, 5))
        game = random_game(rng, interaction, n, horizon=0.5, step=0.1)
        game = replace(game, r_d=tuple(float(x) for x in 10 ** rng.uniform(-3, 3, n)))
        try:
            P = tadcore.solve_equilibrium(scenario(game)).P
        except tadcore.NoEquilibriumError:
            continue
        A, k = random_network(rng, game), int(rng.integers(0, 5))
        gains = tadcore.synthesize(scenario(game), step=k, adjacency=A)
        K = [block[:1, ::2] for block in gains.K.values()]
        measure = own_measure(game, [P[group][k] for group in P], gains.rows, K, A)
        if gains.converged:
            converged += 1
            assert measure < 1e-8
    assert converged > 20
