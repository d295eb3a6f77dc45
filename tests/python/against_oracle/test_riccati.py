"""`solve_equilibrium` against DOP853 on the paper's 2N x 2N equations and against the Hamiltonian closed form."""

from dataclasses import replace

import numpy as np
import pytest

import tadcore
from oracle import riccati
from oracle.model import paper_cases
from oracle.scenario import game_of
from samples import ESCAPES, full_P, random_game, scenario

NAMES = {"I1": ("defenders", "target", "attacker"), "I2": ("team",)}


def relative(P, expected):
    """The largest Frobenius error over the nodes, relative to the matrix at that node."""
    return np.max(np.linalg.norm(P - expected, axis=(-2, -1)) / np.linalg.norm(expected, axis=(-2, -1)))


@pytest.mark.parametrize("interaction", ["I1", "I2"])
@pytest.mark.parametrize(("n", "step"), [(1, 0.005), (2, 0.01), (3, 0.01), (5, 0.02), (10, 0.25)])
def test_every_node_agrees_with_the_full_equations(interaction, n, step):
    # Unit weights and the long horizon of the paper, then varied weights.
    plain = paper_cases()[0 if interaction == "I1" else 4].game
    ones = (1.0,) * n
    team = {"r_d": ones, "q_da": ones, "f_da": ones, "q_ad": ones, "f_ad": ones}
    games = [random_game(np.random.default_rng([41, n]), interaction, n, horizon=2.0, step=step)]
    if interaction == "I1" or n <= 3:  # beyond, the zero-sum game with unit weights has no equilibrium
        games.append(replace(plain, **team, step=step))
    for game in games:
        expected = riccati.integrate(game)
        solution = tadcore.solve_equilibrium(scenario(game))
        assert tuple(solution.P) == NAMES[interaction]
        assert np.allclose(solution.times, game.times, rtol=0, atol=1e-12)
        for g, name in enumerate(NAMES[interaction]):
            assert solution.P[name].shape == (game.steps + 1, game.N, game.N)
            multiplied_out = np.kron(solution.P[name], np.eye(2))
            assert relative(multiplied_out, expected[:, g]) <= 1e-10


def test_paper_games_on_their_own_grid():
    for case in paper_cases()[::2]:
        solution = tadcore.solve_equilibrium(scenario(case.game))
        for g, name in enumerate(NAMES[case.game.interaction]):
            assert relative(solution.P[name], riccati.equilibrium(case.game)[:, g]) <= 1e-10
            k = 137
            assert np.allclose(solution.full(name, k), full_P(case.game, k)[g], rtol=1e-10, atol=1e-11)


@pytest.mark.parametrize("n", [1, 3, 8])
def test_zero_sum_solution_is_the_closed_form(n):
    game = random_game(np.random.default_rng([42, n]), "I2", n, horizon=1.6, step=0.02)
    solution = tadcore.solve_equilibrium(scenario(game))
    assert relative(solution.P["team"], riccati.hamiltonian(game)[:, 0]) <= 1e-10


def test_feedback_is_that_of_the_equilibrium():
    for case in paper_cases()[:5:2]:
        game = case.game
        feedback = tadcore.solve_equilibrium(scenario(game)).feedback
        for k in (0, 500, game.steps):
            rows = riccati.feedback(game, riccati.equilibrium(game)[k])
            for i, player in enumerate(("d1", "d2", "d3", "target", "attacker")):
                assert np.allclose(feedback[player][k], rows[i], rtol=1e-10, atol=1e-11)


@pytest.mark.parametrize("name", ESCAPES)
def test_no_equilibrium_carries_the_known_escape_time(name):
    game, expected = ESCAPES[name]
    with pytest.raises(tadcore.NoEquilibriumError) as caught:
        tadcore.solve_equilibrium(scenario(game))
    assert caught.value.escape_time == pytest.approx(expected, abs=1e-8, rel=1e-8)


def both_sides(game, pole):
    """The game with horizons just short of its escape and just beyond it."""
    K = 50
    return [replace(game, horizon=share * pole, step=share * pole / K) for share in (0.99, 1.0 + 1e-5)]


def test_zero_sum_games_on_both_sides_of_their_escape():
    """Just short of the escape P is large and must still be right; just beyond there is no solution."""
    met = 0
    for seed in range(40):
        game = random_game(np.random.default_rng([43, seed]), "I2", 1 + seed % 3, horizon=0.1, low=0.2, high=5.0)
        pole = riccati.escape_time(game, 4.0)
        if pole is None:
            continue
        met += 1
        short, beyond = both_sides(game, pole)
        assert relative(tadcore.solve_equilibrium(scenario(short)).P["team"], riccati.hamiltonian(short)[:, 0]) <= 1e-9
        with pytest.raises(tadcore.NoEquilibriumError) as caught:
            tadcore.solve_equilibrium(scenario(beyond))
        assert caught.value.escape_time == pytest.approx(pole, rel=1e-8)
        if met == 6:
            break
    assert met == 6


def test_non_zero_sum_games_on_both_sides_of_their_escape(reference):
    """The escape times of the table are those of an extended precision, which double precision does not reach."""
    entries = reference("escapes")["games"]
    assert len(entries) >= 8
    for entry in entries:
        game, pole = game_of(entry), entry["escape_backward_time"]
        short, beyond = both_sides(game, pole)
        solution, expected = tadcore.solve_equilibrium(scenario(short)), riccati.integrate(short, axes=1)
        for g, name in enumerate(NAMES["I1"]):
            assert relative(solution.P[name], expected[:, g]) <= 1e-8
        with pytest.raises(tadcore.NoEquilibriumError) as caught:
            tadcore.solve_equilibrium(scenario(beyond))
        assert caught.value.escape_time == pytest.approx(pole, rel=1e-6)
