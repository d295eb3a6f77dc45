"""The oracle against closed forms, against finite differences and against itself in full and reduced form."""

import numpy as np
import pytest

from oracle import model, network, riccati, synthesis, theta
from oracle.model import uniform
from oracle.network import from_number, number
from samples import ESCAPES, full_P, random_game, random_network


def test_paper_cases_are_the_printed_ones():
    cases = model.paper_cases()
    assert [c.game.interaction for c in cases] == ["I1"] * 4 + ["I2"] * 4
    assert all(c.game.steps == 1200 and c.game.n == 3 for c in cases)
    B, _, S, _, F = cases[0].game.matrices()
    assert np.array_equal(B["a"], -np.kron(np.ones((4, 1)), np.eye(2)))
    assert np.allclose(S["tau"], np.diag([0, 0, 0, 0, 0, 0, 1 / 1.2, 1 / 1.2]))
    assert np.array_equal(np.diag(F["a"]), [-1] * 6 + [1] * 2)


@pytest.mark.parametrize("n", [1, 2, 4])
def test_kronecker_form_reduces_exactly_and_stays_symmetric(n):
    for interaction in ("I1", "I2"):
        game = random_game(np.random.default_rng([31, n]), interaction, n, horizon=1.0)
        times = [0.0, 0.31, 0.9]
        large, small = (riccati.integrate(game, axes=axes, times=times) for axes in (2, 1))
        for P, p in zip(large, small, strict=True):
            assert np.allclose(P, theta.full(p), rtol=1e-11, atol=1e-12)
            assert np.allclose(p, p.swapaxes(-1, -2), rtol=1e-11, atol=1e-12)


def test_integrator_agrees_with_the_hamiltonian_form():
    for seed in range(4):
        game = random_game(np.random.default_rng([32, seed]), "I2", 1 + seed, horizon=1.5)
        times = np.linspace(0, game.horizon, 7)
        one, other = riccati.integrate(game, axes=1, times=times), riccati.hamiltonian(game, times=times)
        assert np.max(np.abs(one - other)) <= 1e-11 * np.max(np.abs(other))


@pytest.mark.parametrize("name", ESCAPES)
def test_escape_times(name):
    game, expected = ESCAPES[name]
    assert riccati.escape_time(game, game.horizon) == pytest.approx(expected, rel=1e-9)
    assert riccati.escape_time(game, 0.999 * expected) is None


def test_printed_gradients_are_those_of_theta():
    for seed in range(6):
        rng = np.random.default_rng([33, seed])
        game = random_game(rng, ("I1", "I2")[seed % 2], 1 + seed // 2, horizon=0.8)
        A, P = random_network(rng, game), full_P(game, 0)
        K = [rng.normal(size=(2, 2 * game.N)) for _ in range(game.m)]
        printed = theta.gradients(game, P, K, A)
        h = 1e-6
        for i, k in enumerate(K):
            for at in np.ndindex(*k.shape):
                values = []
                for sign in (1, -1):
                    moved = [x.copy() for x in K]
                    moved[i][at] += sign * h
                    values.append(theta.theta(game, P, theta.joint(moved, A)))
                difference = (values[0] - values[1]) / (2 * h)
                scale = max(np.max(np.abs(g)) for g in printed) + values[0]
                assert printed[i][at] == pytest.approx(difference, rel=1e-6, abs=1e-7 * scale)


def test_search_has_the_value_gradient_and_hessian_of_the_printed_problem():
    from oracle import search

    for seed in range(4):
        rng = np.random.default_rng([34, seed])
        game = random_game(rng, ("I1", "I2")[seed % 2], 2 + seed // 2, horizon=0.8)
        A, p = random_network(rng, game), riccati.equilibrium(game)[0]
        problem = synthesis.Problem(game, p, A)
        x, y = rng.normal(size=(2, problem.size))
        # a + ib stands for the block aI + bJ, and complex norms are half of the full ones.
        blocks = np.kron(problem.rows(x), np.eye(2)) + np.kron(problem.rows(y), np.array([[0, -1], [1, 0]]))
        z = np.concatenate([x, y])
        value, gradient, H = search.complex_model(z, *problem.data)
        assert 2 * value == pytest.approx(theta.theta(game, theta.full(p), blocks), rel=1e-12)
        assert problem.value(x) == pytest.approx(theta.theta(game, p, problem.rows(x), axes=1), rel=1e-12)
        d = rng.normal(size=z.size)
        h = 1e-5
        up, down = (search.complex_model(z + s * h * d, *problem.data) for s in (1, -1))
        assert gradient @ d == pytest.approx((up[0] - down[0]) / (2 * h), rel=1e-6)
        assert np.allclose(H @ d, (up[1] - down[1]) / (2 * h), rtol=1e-5, atol=1e-6 * np.linalg.norm(H))
        assert np.allclose(
            search.real_model(x, *problem.data)[2],
            search.complex_model(np.concatenate([x, 0 * x]), *problem.data)[2][: x.size, : x.size],
            rtol=1e-12,
            atol=1e-12,
        )


def test_search_reaches_the_best_known_theta_of_the_hard_instants(reference):
    for case in reference("synthesis_hard")["cases"]:
        w = case["control_weights"]
        game = uniform("I2", w["defenders"], w["target"], w["attacker"], horizon=1.0, gamma=tuple(case["gamma"]))
        found = synthesis.solve(game, np.array([case["P"]]), np.array(case["adjacency"]), count=12)
        assert found.theta == pytest.approx(case["best_theta"], rel=1e-10)
        assert found.lowest > 0


def test_networks_as_numbers_come_back():
    rng = np.random.default_rng(35)
    for m, N in ((1, 2), (4, 4), (5, 6)):
        A = rng.random((m, N)) < 0.5
        assert np.array_equal(from_number(number(A), m, N), A)


def test_edges_of_a_closed_ball():
    positions = np.array([[0.0, 0.0], [3.0, 4.0], [0.0, 1.0]])  # d1, target, attacker
    assert network.edges(network.adjacency(positions, np.array([5.0]))) == {(0, 1), (0, 2)}
    assert network.edges(network.adjacency(positions, np.array([np.nextafter(5.0, 0)]))) == {(0, 2)}
