"""The gains: Theta, its terms and stationarity in the paper's blocks; no other search may go lower."""

import numpy as np
import pytest
from scipy.optimize import minimize

import tadcore
from oracle import synthesis, theta
from oracle.model import paper_cases
from oracle.network import from_number, information
from oracle.riccati import equilibrium, feedback
from oracle.scenario import game_of
from samples import full_P, random_game, random_network, scenario

LOWER = 1e-9


def solved(game, k, A, **options):
    return tadcore.synthesize(scenario(game), step=k, adjacency=A, **options)


def draws(seed, sizes=(1, 2, 3, 4), **options):
    """(game, step, network) for both interactions and every n of `sizes`."""
    for n in sizes:
        for interaction in ("I1", "I2"):
            rng = np.random.default_rng([seed, n, interaction == "I1"])
            game = random_game(rng, interaction, n, horizon=1.5, **options)
            for _ in range(2):
                yield game, int(rng.integers(game.steps + 1)), random_network(rng, game)


def test_theta_and_its_terms_are_the_printed_ones():
    for game, k, A in draws(61):
        gains = solved(game, k, A)
        P = full_P(game, k)
        blocks = np.kron(gains.rows, np.eye(2))
        printed = theta.terms(game, P, blocks)
        assert np.allclose(2 * np.array(list(gains.terms.values())), printed, rtol=1e-9, atol=1e-12)
        assert 2 * gains.theta == pytest.approx(theta.theta(game, P, blocks), rel=1e-9, abs=1e-13)
        assert list(gains.weights.values()) == pytest.approx(game.gammas)


def test_rows_are_the_blocks_times_the_information():
    for game, k, A in draws(62):
        gains = solved(game, k, A)
        for i, player in enumerate(gains.players):
            K = gains.K[player]
            assert K.shape == (2, 2 * game.N)
            assert np.allclose(K @ information(A[i], i), np.kron(gains.rows[[i]], np.eye(2)), rtol=1e-12, atol=1e-13)
            assert not np.any(K.reshape(2, game.N, 2)[:, ~A[i]])
            if not A[i].any():
                assert not np.any(gains.rows[i])


def test_printed_gradients_vanish():
    for game, k, A in draws(63, sizes=(1, 2, 3, 5)):
        gains = solved(game, k, A)
        P = full_P(game, k)
        K = [gains.K[player] for player in gains.players]
        there = np.concatenate([g.ravel() for g in theta.gradients(game, P, K, A)])
        nowhere = np.concatenate([g.ravel() for g in theta.gradients(game, P, [0 * x for x in K], A)])
        assert gains.converged
        assert gains.gradient_norm <= 1e-10
        assert np.linalg.norm(there) <= 1e-9 * np.linalg.norm(nowhere)


def best_of_bfgs(game, k, A, rng, runs):
    """SciPy's BFGS on all 2 x 2 blocks of players seen, with the printed gradients, from random starts."""
    P = full_P(game, k)
    m, N = A.shape
    mask = np.repeat(A, 2, axis=1)[:, None, :].repeat(2, axis=1)  # (m, 2, 2N)
    scale = max(0.1, np.max(np.abs(feedback(game, equilibrium(game)[k])[:m])))

    def blocks(x):
        K = np.zeros((m, 2, 2 * N))
        K[mask] = x
        return K

    def value(x):
        K = blocks(x)
        gradient = np.array(theta.gradients(game, P, K, A))
        return theta.theta(game, P, theta.joint(K, A)), gradient[mask]

    starts = scale * rng.normal(size=(runs, mask.sum()))
    return min(minimize(value, x, jac=True, method="BFGS", options={"gtol": 1e-7}).fun for x in starts)


def test_bfgs_on_the_full_problem_never_goes_lower():
    rng = np.random.default_rng(64)
    reached = total = 0
    for game, k, A in draws(64):
        lowest = best_of_bfgs(game, k, A, rng, 4)
        gains = solved(game, k, A)
        assert 2 * gains.theta <= lowest * (1 + LOWER) + 1e-12
        reached += lowest <= 2 * gains.theta * (1 + 1e-6) + 1e-10
        total += 1
    assert reached >= total // 2  # BFGS found the same minimum often enough to have been a rival


def test_multistart_never_goes_lower():
    for game, k, A in draws(65, sizes=(2, 3, 4), low=0.2, high=5.0):
        found = synthesis.solve(game, equilibrium(game)[k], A, count=12)
        gains = solved(game, k, A)
        assert gains.theta <= found.theta * (1 + LOWER) + 1e-13
        assert gains.theta == pytest.approx(found.theta, rel=1e-8, abs=1e-13)
        assert np.allclose(gains.rows, found.rows, rtol=0, atol=1e-7 * (1 + np.abs(found.rows).max()))


def hard_instants(reference):
    """(game, step, network, lowest Theta known) where Newton's method from the canonical start ends higher."""
    for name in ("hard_instants", "reversed_rows", "lower_theta", "dominated_theta", "five_defenders_theta"):
        for entry in reference(name)["instants"]:
            yield game_of(entry), entry["step"], entry["network"], entry["theta"]
    for entry in reference("random_games")["games"]:
        for k, code, best, _ in entry.get("hard", ()):
            yield game_of(entry), k, code, best


def test_instants_where_newton_alone_ends_too_high(reference):
    met, above = 0, []
    for game, k, code, best in hard_instants(reference):
        gains = solved(game, k, from_number(code, game.m, game.N))
        met += 1
        if gains.theta > best * (1 + LOWER):
            above.append((met, game.interaction, game.n, k, code, gains.theta / best - 1))
    assert met >= 150
    assert not above


def test_the_rows_with_a_lower_theta_are_admissible_and_have_it(reference):
    names = ("lower_theta", "dominated_theta", "five_defenders_theta")
    for entry in (entry for name in names for entry in reference(name)["instants"]):
        game, rows = game_of(entry), np.array(entry["rows"])
        A = from_number(entry["network"], game.m, game.N)
        for i, row in enumerate(rows):
            W = information(A[i], i, 1)
            assert np.allclose(W.T @ np.linalg.pinv(W.T) @ row, row, rtol=0, atol=1e-12 * np.abs(row).max(initial=1.0))
        there = theta.theta(game, equilibrium(game)[entry["step"]], rows, 1)
        assert there == pytest.approx(entry["theta"], rel=1e-9)
        assert there < entry["without"]


def test_everyone_seen_gives_the_equilibrium():
    for game, k, A in draws(66, sizes=(1, 2, 5)):
        gains = solved(game, k, np.ones_like(A))
        rows = feedback(game, equilibrium(game)[k])[: game.m]
        assert gains.theta <= 1e-20 * (1 + np.sum(rows**4))
        assert np.allclose(gains.rows, rows, rtol=0, atol=1e-10 * np.abs(rows).max())


def test_nobody_seen_gives_zero_gains():
    for game, k, A in draws(67, sizes=(1, 3)):
        gains = solved(game, k, np.zeros_like(A))
        assert not gains.rows.any()
        assert gains.theta == pytest.approx(theta.theta(game, equilibrium(game)[k], np.zeros(A.shape), 1), rel=1e-9)


def test_descent_reaches_the_optimum_on_the_instants_of_the_paper(reference):
    for case, run in zip(paper_cases(), reference("paper_runs")["runs"], strict=True):
        for k in (*range(0, run["step"], 120), *run["changes"]):
            code = [c for at, c in zip(run["changes"], run["networks"], strict=True) if at <= k][-1]
            A = from_number(code, case.game.m, case.game.N)
            newton = solved(case.game, k, A)
            descent = solved(case.game, k, A, method="descent")
            assert newton.converged
            assert descent.converged, (case.name, k, descent.status)
            assert descent.theta == pytest.approx(newton.theta, rel=1e-9, abs=1e-12)


def test_descent_says_how_it_ended():
    """Whatever it claims is true by the printed gradients, and it never pretends to be below the minimum."""
    for game, k, A in draws(68, sizes=(2, 4)):
        descent, newton = solved(game, k, A, method="descent"), solved(game, k, A)
        P = full_P(game, k)
        K = [descent.K[player] for player in descent.players]
        there = np.linalg.norm([np.linalg.norm(g) for g in theta.gradients(game, P, K, A)])
        nowhere = np.linalg.norm([np.linalg.norm(g) for g in theta.gradients(game, P, [0 * x for x in K], A)])
        assert descent.theta >= newton.theta * (1 - LOWER) - 1e-13
        assert there <= 1e3 * max(descent.gradient_norm, 1e-13) * nowhere  # other variables, another scale
        if descent.converged:
            assert there <= 1e-8 * nowhere
    stopped = solved(game, k, A, method="descent", max_iterations=1)
    assert not stopped.converged
    assert stopped.iterations <= 1
    assert stopped.status != newton.status
