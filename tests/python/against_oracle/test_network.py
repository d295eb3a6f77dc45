"""The network in the paper's own form: Example 1 entry by entry, and random networks against the oracle."""

import numpy as np
import pytest

import tadcore
from oracle import network
from oracle.scenario import as_mapping
from samples import random_game, random_start

# Example 1 of the paper: four defenders, figure 1, panel I1.
AD = np.array([[0, 1, 0, 0], [1, 0, 1, 1], [0, 0, 0, 0], [0, 0, 1, 0]])
PHI_A = np.diag([1, 1, 0, 0])
PHI_TAU = np.array([[0], [0], [0], [1]])
AUGMENTED = np.array([[1, 1, 0, 0, 0], [1, 1, 1, 1, 0], [0, 0, 0, 0, 0], [0, 0, 1, 0, 1]])
RELATIVE_TO_D2 = np.array([[1, -1, 0, 0, 0], [0, 1, 0, 0, 0], [0, -1, 1, 0, 0], [0, -1, 0, 1, 0], [0, -1, 0, 0, 1]])
I_D2 = np.kron(np.diag([1, 1, 1, 1, 0]) @ RELATIVE_TO_D2, np.eye(2))


def test_example_1_in_the_oracle():
    assert np.array_equal(network.from_parts(AD, np.diag(PHI_A), PHI_TAU), AUGMENTED)
    assert np.array_equal(network.information(AUGMENTED[1], 1), I_D2)


def test_example_1_entry_by_entry():
    net = tadcore.VisibilityNetwork(AUGMENTED)
    assert np.array_equal(net.Ad, AD)
    assert np.array_equal(net.Phi_a, PHI_A)
    assert np.array_equal(net.Phi_tau, PHI_TAU)
    assert np.array_equal(net.adjacency, AUGMENTED)
    assert np.array_equal(net.information_matrix("d2"), I_D2)
    z = np.arange(1.0, 11.0)
    used = net.information_matrix("d2") @ z
    blocks = z.reshape(5, 2)
    assert np.array_equal(used.reshape(5, 2)[:4], [*(blocks[[0]] - blocks[1]), blocks[1], *(blocks[2:4] - blocks[1])])
    assert np.array_equal(used.reshape(5, 2)[4], [0, 0])


@pytest.mark.parametrize("interaction", ["I1", "I2"])
def test_information_matrices_of_random_networks(interaction):
    rng = np.random.default_rng(51)
    for n in (1, 2, 3, 6):
        A = rng.random((n if interaction == "I1" else n + 1, n + 1)) < 0.5
        net = tadcore.VisibilityNetwork(A)
        for axes in (1, 2, 3):
            for i, row in enumerate(A):
                assert np.array_equal(net.information_matrix(i, dim=axes), network.information(row, i, axes))
        assert np.array_equal(net.information_matrix_team, network.team_information(A[:n]))


@pytest.mark.parametrize("interaction", ["I1", "I2"])
@pytest.mark.parametrize("axes", [2, 3])
def test_network_of_positions(interaction, axes):
    rng = np.random.default_rng([52, axes])
    seen = []
    for n in (1, 2, 4):
        game = random_game(rng, interaction, n, horizon=0.5, step=0.1)
        start = random_start(rng, game, axes)
        sc = tadcore.Scenario.model_validate(as_mapping(game, start))
        A = network.adjacency(start.positions, start.zeta)
        assert np.array_equal(tadcore.VisibilityNetwork.from_positions(sc).adjacency, A)
        if A.any():  # what the run itself uses at its first instant
            assert np.array_equal(tadcore.simulate(sc).adjacency[0], A)
        seen.append(A.ravel())
    assert 0 < np.concatenate(seen).mean() < 1


def test_the_ball_of_sight_is_closed():
    rng = np.random.default_rng(53)
    game = random_game(rng, "I1", 1, horizon=0.5, step=0.1)
    start = random_start(rng, game)
    start = type(start)(np.array([[0.0, 0.0], [3.0, 4.0], [9.0, 0.0]]), np.array([5.0]), start.sigma)
    for zeta, sees in ((5.0, True), (np.nextafter(5.0, 0.0), False)):
        mapping = as_mapping(game, type(start)(start.positions, np.array([zeta]), start.sigma))
        run = tadcore.simulate(tadcore.Scenario.model_validate(mapping))
        assert bool(run.adjacency[0, 0, 1]) is sees
