"""The criterion "component": who knows everything plays the equilibrium, and Θ is least over the rows of the others."""

import numpy as np
import pytest
from scipy.optimize import minimize

from oracle.network import information
from oracle.riccati import equilibrium
from oracle.theta import theta
from samples import random_game, random_network, scenario
from tadcore import _core
from tadcore.game.compiled import _arguments, _array

STEP = 0.1


def core(sc, **more):
    """The compiled game of a scenario with fields that it need not have."""
    return _core.Game(**{name: _array(value) for name, value in _arguments(sc).items()} | more)


def with_whole_rows(rng, game, whole):
    """A network in which the first ``whole`` players see everyone, and the others do not."""
    A = random_network(rng, game, 0.5)
    A[:whole] = True
    A[whole:][A[whole:].all(axis=1), -1] = False
    return A


def least_theta(game, P, A, fixed, starts, rng):
    """Θ by SciPy's minimiser over the gains of the rows that are not fixed, from many starts; reduced."""
    free = [i for i in range(game.m) if i not in fixed]
    spaces = [information(A[i], i, 1) for i in free]

    def rows(x):
        G = np.zeros((game.m, game.N))
        for i, row in fixed.items():
            G[i] = row
        for i, k, space in zip(free, x.reshape(len(free), game.N), spaces, strict=True):
            G[i] = k @ space
        return G

    best = np.inf
    size = np.abs(np.array(list(fixed.values()))).max()
    for _ in range(starts):
        found = minimize(
            lambda x: theta(game, P, rows(x), 1), size * rng.normal(size=len(free) * game.N), options={"gtol": 1e-10}
        )
        best = min(best, found.fun)
    return best


@pytest.mark.parametrize("interaction", ["I1", "I2"])
@pytest.mark.parametrize("seed", range(4))
def test_theta_is_the_least_with_the_whole_rows_at_the_equilibrium(interaction, seed):
    rng = np.random.default_rng([seed, interaction == "I2"])
    game = random_game(rng, interaction, 3, horizon=1.0, step=STEP)
    whole = int(rng.integers(1, game.m))
    A, k = with_whole_rows(rng, game, whole), int(rng.integers(0, game.steps))
    team = core(scenario(game), criterion="component")
    feedback = team.equilibrium().feedback()[k]
    gains = team.synthesize(k, A)
    assert gains.converged
    assert (gains.rows[:whole] == feedback[:whole]).all()
    # Nobody uses what it does not see.
    for i in range(game.m):
        space = information(A[i], i, 1)
        row = gains.rows[i]
        assert np.abs(row - row @ np.linalg.pinv(space) @ space).max() < 1e-9 * (1 + np.abs(row).max())
    P = equilibrium(game)[k]
    assert abs(gains.theta - theta(game, P, gains.rows, 1)) < 1e-8 * gains.theta + 1e-12
    least = least_theta(game, P, A, dict(enumerate(feedback[:whole])), 12, rng)
    assert gains.theta < least * (1 + 1e-6) + 1e-12
    assert least < gains.theta * (1 + 1e-6) + 1e-12

    paper = core(scenario(game))
    price = team.theta_price(np.array([k, k]), np.array([A, A]))
    assert (price == paper.theta_price(np.array([k, k]), np.array([A, A]))).all()
    assert price[0] == price[1] == max(gains.theta - paper.synthesize(k, A).theta, 0.0)


@pytest.mark.parametrize("interaction", ["I1", "I2"])
def test_without_whole_rows_nothing_changes_and_with_whole_rows_alone_it_is_the_equilibrium(interaction):
    rng = np.random.default_rng(9)
    game = random_game(rng, interaction, 3, horizon=1.0, step=STEP)
    sc = scenario(game)
    team, paper = core(sc, criterion="component"), core(sc)
    for _ in range(5):
        A = with_whole_rows(rng, game, 0)
        ours, theirs = team.synthesize(2, A), paper.synthesize(2, A)
        assert (ours.rows == theirs.rows).all()
        assert ours.theta == theirs.theta
    everything = np.ones((game.m, game.N), dtype=bool)
    ours = team.synthesize(2, everything)
    assert (ours.rows == team.equilibrium().feedback()[2, : game.m]).all()
    assert ours.certified
    assert (ours.rows == paper.synthesize(2, everything).rows).all()
    blind = np.zeros((game.m, game.N), dtype=bool)
    assert (team.theta_price(np.array([2, 2]), np.array([everything, blind])) == 0.0).all()


def test_the_papers_criterion_need_not_be_consistent_for_one_player():
    """Where d1 alone sees everyone its row is far from its equilibrium row under T1, and it has a price to be there."""
    import tadcore

    sc = tadcore.scenarios.load("paper-i1")
    A = np.zeros((3, 4), dtype=bool)
    A[0] = True
    paper, team = core(sc), core(sc, criterion="component")
    feedback = team.equilibrium().feedback()[0, 0]
    away = np.linalg.norm(paper.synthesize(0, A).rows[0] - feedback) / np.linalg.norm(feedback)
    assert 0.5 < away < 1.0
    assert team.theta_price(np.array([0]), A[None])[0] > 0.0


def test_a_run_and_a_batch_play_it():
    rng = np.random.default_rng(11)
    game = random_game(rng, "I1", 3, horizon=2.0, step=0.1)
    team = core(scenario(game), criterion="component")
    positions = rng.uniform(-2, 2, (60, game.n + 2, 2))
    visibility, capture = np.full((60, game.m), 2.2), np.full((60, game.n + 1), 0.1)
    visibility[:, 0] = np.inf
    batch = team.simulate_batch(positions, visibility, capture)
    feedback = team.equilibrium().feedback()
    for i in range(20):
        run = team.simulate(positions[i], visibility[i], capture[i])
        assert (run.kind, run.defender, run.times[-1]) == (batch[0][i], batch[1][i], batch[2][i])
        steps = len(run.times) - 1
        assert (run.gains[:steps, 0] == feedback[:steps, 0]).all()
    with pytest.raises(ValueError, match="another game"):
        core(scenario(game)).load_table(team.save_table())


def test_another_word_is_refused():
    game = random_game(np.random.default_rng(5), "I1", 1, horizon=1.0)
    with pytest.raises(ValueError, match=r"criterion is \"best\", but it must be paper or component"):
        core(scenario(game), criterion="best")
    one = core(scenario(game))
    for steps, A in [([101], np.ones((1, 1, 2))), ([-1], np.ones((1, 1, 2))), ([0], np.ones((2, 1, 2)))]:
        with pytest.raises(ValueError, match="steps must be from 0 to 100"):
            one.theta_price(np.array(steps), A.astype(bool))
