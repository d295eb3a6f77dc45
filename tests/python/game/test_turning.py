"""Gains that turn, aI + bJ: Θ in the paper's full 2N × 2N matrices, its gradient, and descents of another search."""

from functools import cache

import numpy as np
import pytest

import tadcore
from oracle.riccati import equilibrium
from oracle.theta import full, gradients, joint, terms, theta
from oracle.turning import blocks, lowest, own_gains
from samples import random_game, random_network, scenario

TURNED = [("I1", seed) for seed in (31, 92, 102, 112, 117, 119, 137, 146, 180, 212, 213, 220)] + [("I2", 1071)]
"""Draws at which gains that turn are lower, by between 2e-5 and a half of Θ."""


@cache
def drawn(interaction, seed):
    """A game, one of its instants, a network at which not everyone sees everyone, the paper's full P, the gains."""
    rng = np.random.default_rng([seed, interaction == "I1"])
    game = random_game(
        rng,
        interaction,
        3 if interaction == "I1" else int(rng.integers(2, 4)),
        horizon=1.5,
        step=0.1,
        low=0.25,
        high=4.0,
        gamma=tuple(np.exp(rng.uniform(np.log(0.02), 0.0, 4 if interaction == "I1" else 3)).round(4).tolist()),
    )
    k, A = int(rng.integers(game.steps + 1)), random_network(rng, game, rng.uniform(0.2, 0.6))
    gains = tadcore.synthesize(scenario(game), step=k, adjacency=A, gains="turning")
    return game, k, A, full(equilibrium(game)[k]), gains


def turned():
    """Those of the draws at which gains turn."""
    return [drawn(*key) for key in TURNED]


def test_these_gains_turn():
    assert all(gains.turns for *_, gains in turned())


def test_theta_and_its_terms_are_those_of_the_full_matrices():
    for game, _, A, P, gains in turned():
        G = blocks(gains.rows)
        assert 2.0 * gains.theta == pytest.approx(theta(game, P, G), rel=1e-10)
        assert [2.0 * x for x in gains.terms.values()] == pytest.approx(terms(game, P, G), rel=1e-9, abs=1e-12)
        K = [gains.K[label] for label in gains.players]
        np.testing.assert_allclose(joint(K, A), G, atol=1e-12)
        for i, row in enumerate(A):  # zero on players not seen
            assert not K[i].reshape(2, -1, 2)[:, ~row].any()


def test_they_are_critical_points_in_full_blocks():
    for game, _, A, P, gains in turned():
        K = [gains.K[label] for label in gains.players]
        slope = np.concatenate([g.ravel() for g in gradients(game, P, K, A)])
        size = np.concatenate([g.ravel() for g in gradients(game, P, [1.01 * k + 0.01 for k in K], A)])
        assert np.linalg.norm(slope) < 1e-8 * np.linalg.norm(size)
        assert gains.converged
        assert gains.gradient_norm < 1e-10


def test_they_are_lower_than_scalars_and_no_descent_of_another_search_is_lower():
    some = 0
    for interaction, seed in [*TURNED, *(("I1", seed) for seed in range(20)), *(("I2", seed) for seed in range(10))]:
        game, k, A, P, gains = drawn(interaction, seed)
        scalars = tadcore.synthesize(scenario(game), step=k, adjacency=A)
        assert gains.theta <= scalars.theta
        assert gains.turns == (gains.theta < scalars.theta * (1 - 1e-9))
        if gains.certified_blocks:
            continue
        best, x = lowest(game, P, A, 6, np.random.default_rng(seed))
        assert gains.theta <= best * (1 + 1e-9)
        if gains.turns and best < gains.theta * (1 + 1e-7):
            G = joint(own_gains(x, A), A)
            some += min(np.abs(blocks(rows) - G).max() for rows in (gains.rows, gains.rows.conj())) < 1e-4
    assert some >= 10  # the two searches agree on where it is


@pytest.mark.parametrize("interaction", ["I1", "I2"])
def test_scalars_are_kept_bitwise_where_no_blocks_are_lower(interaction):
    kept = 0
    for seed in range(20):
        game, k, A, _, gains = drawn(interaction, seed)
        scalars = tadcore.synthesize(scenario(game), step=k, adjacency=A)
        if scalars.certified_blocks:
            assert not gains.turns
        if not gains.turns:
            kept += 1
            assert gains.rows.dtype == np.complex128
            assert gains.rows.real.tobytes() == scalars.rows.tobytes()
            assert not gains.rows.imag.any()
            assert (gains.theta, gains.certified) == (scalars.theta, scalars.certified)
    assert kept > 10


def test_of_two_mirror_images_the_first_imaginary_part_decides():
    for game, k, A, _, gains in turned():
        mirror = tadcore.synthesize(scenario(game), step=k, adjacency=A, gains="turning", mirror=True)
        assert (mirror.rows == gains.rows.conj()).all()
        assert (mirror.theta, mirror.terms) == (gains.theta, gains.terms)
        parts = gains.rows.imag.ravel()
        assert parts[np.flatnonzero(np.abs(parts) > 1e-8 * np.abs(gains.rows).max())[0]] > 0.0
        assert not gains.certified
        assert not gains.certified_blocks


def test_they_are_a_function_of_the_instant_and_the_network_alone():
    game, k, A, _, gains = turned()[0]
    sc = scenario(game).replace({"d*.visibility_radius": 3.0, "attacker.position": (0.5, -9.0)})
    again = tadcore.synthesize(sc, step=k, adjacency=A, gains="turning")
    assert again.rows.tobytes() == gains.rows.tobytes()


def test_what_cannot_be_had_is_refused_by_name():
    sc, A = tadcore.scenarios.load("paper-i1"), [[0, 1, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]]
    at = {f"{p}.position": (*getattr(sc, p).position, 0.0) for p in ("attacker", "target")}
    space = sc.replace({**at, **{f"defenders[{i}].position": (*d.position, 0.0) for i, d in enumerate(sc.defenders)}})
    for given, named in (
        ({"gains": "complex"}, "gains: got 'complex'"),
        ({"gains": None}, "gains: got None"),
        ({"mirror": True}, "mirror: got True"),
        ({"gains": "turning", "mirror": 1}, "mirror: got 1"),
        ({"gains": "turning", "method": "descent"}, "method: got 'descent'"),
        ({"gains": "turning", "max_iterations": 3}, "max_iterations: got 3"),
    ):
        with pytest.raises(tadcore.ScenarioError, match=named):
            tadcore.synthesize(sc, step=0, adjacency=A, **given)
    with pytest.raises(tadcore.ScenarioError, match="in the plane"):
        tadcore.synthesize(space, step=0, adjacency=A, gains="turning")
