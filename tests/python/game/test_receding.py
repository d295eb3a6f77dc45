"""A receding horizon: at every instant P at the beginning of a horizon T_h, and tables by the network alone."""

from dataclasses import replace

import numpy as np
import pytest

from oracle.riccati import escape_time, hamiltonian, integrate
from samples import ESCAPES, random_game, random_network, scenario
from tadcore import NoEquilibriumError, ScenarioError, _core
from tadcore.game.compiled import _arguments, _array


def core(sc, **more):
    """The compiled game of a scenario with fields that it need not have."""
    return _core.Game(**{name: _array(value) for name, value in _arguments(sc).items()} | more)


def start(game, rng, trials=None):
    """Positions and radii."""
    shape = (game.n + 2, 2) if trials is None else (trials, game.n + 2, 2)
    wide = (game.m,) if trials is None else (trials, game.m)
    return rng.uniform(-2, 2, shape), np.full(wide, 2.0), np.full((*wide[:-1], game.n + 1), 0.1)


@pytest.mark.parametrize("interaction", ["I1", "I2"])
def test_P_is_that_at_the_beginning_of_the_prediction(interaction):
    game = random_game(np.random.default_rng(1), interaction, 3, horizon=2.0, step=0.1)
    for ahead in (0.37, 2.0, 2.3):
        eq = core(scenario(game), prediction_horizon=ahead).equilibrium()
        if interaction == "I2":
            (expected,) = hamiltonian(game, [0.0], ahead)
        else:
            (expected,) = integrate(game, axes=1, times=[0.0], horizon=ahead)
        assert eq.P.shape[1] == game.steps + 1
        for group, P in enumerate(eq.P):
            assert np.abs(P - expected[group]).max() < 1e-9 * np.abs(expected[group]).max()
        assert eq.residual().max() < 1e-9
        assert (eq.feedback() == eq.feedback()[0]).all()


@pytest.mark.parametrize("interaction", ["I1", "I2"])
def test_the_finite_game_follows_as_the_prediction_shrinks_with_what_is_left(interaction):
    """T_h = T - t_k: the gains, the transition and P of the finite game at t_k; of the whole T, at t_0."""
    rng = np.random.default_rng(2)
    game = random_game(rng, interaction, 3, horizon=2.0, step=0.125)
    sc, A = scenario(game), random_network(rng, game)
    finite = core(sc)
    for k in (0, 3, 15):
        receding = core(sc, prediction_horizon=float(2.0 - game.times[k]))
        ours, theirs = receding.synthesize(7, A), finite.synthesize(k, A)
        assert np.abs(ours.rows - theirs.rows).max() < 1e-8
        assert abs(ours.theta - theirs.theta) < 1e-8 * theirs.theta + 1e-15
        assert np.abs(receding.equilibrium().P[:, 0] - finite.equilibrium().P[:, k]).max() < 1e-9


def test_one_network_is_one_entry_of_the_table():
    rng = np.random.default_rng(3)
    game = random_game(rng, "I1", 3, horizon=2.0, step=0.05)
    sc = scenario(game)
    receding = core(sc, prediction_horizon=1.0)
    positions, visibility, capture = start(game, rng, 400)
    batch = receding.simulate_batch(positions, visibility, capture)
    entries = receding.table()["entries"]
    assert 0 < entries <= 4096
    again = receding.simulate_batch(positions, visibility, capture)
    assert receding.table()["entries"] == entries
    for first, second in zip(batch, again, strict=True):
        assert (first == second).all()
    # One by one as in the batch, whatever was in the table, and with a table that was saved.
    saved = receding.save_table()
    other = core(sc, prediction_horizon=1.0)
    assert other.load_table(saved) == entries
    loaded = other.simulate_batch(positions, visibility, capture)
    assert other.table()["misses"] == 0
    alone = core(sc, prediction_horizon=1.0)
    for i in range(40):
        run = alone.simulate(positions[i], visibility[i], capture[i])
        assert (run.kind, run.defender) == (batch[0][i], batch[1][i]) == (loaded[0][i], loaded[1][i])
        assert run.times[-1] == batch[2][i] == loaded[2][i]
    # Not a table of the finite game, nor of another prediction.
    for wrong in (core(sc), core(sc, prediction_horizon=1.5)):
        with pytest.raises(ValueError, match="another game"):
            wrong.load_table(saved)


def test_it_is_played_as_the_oracle_steps():
    """Positions by scipy's exponential of the closed loop of constant gains, under full sight."""
    from scipy.linalg import expm

    rng = np.random.default_rng(4)
    game = random_game(rng, "I2", 2, horizon=1.0, step=0.1)
    receding = core(scenario(game), prediction_horizon=0.8)
    positions, _, capture = start(game, rng)
    run = receding.simulate(positions, np.full(game.m, np.inf), 1e-6 * capture)
    rows = receding.equilibrium().feedback()[0]
    flow = expm(0.1 * (rows[:-1] - rows[-1]))
    z = positions[:-1] - positions[-1]
    for k in range(len(run.times)):
        now = run.position[k]
        assert np.abs(now[:-1] - now[-1] - z).max() < 1e-10
        z = flow @ z


@pytest.mark.parametrize("name", ESCAPES)
def test_an_escape_counts_within_the_prediction_alone(name):
    game, escape = ESCAPES[name]
    assert abs(escape_time(game, 2 * escape) - escape) < 1e-9 * escape
    long = scenario(replace(game, horizon=10 * escape, step=escape / 10))
    with pytest.raises(NoEquilibriumError) as caught:
        core(long, prediction_horizon=1.5 * escape).equilibrium()
    assert abs(caught.value.escape_time - escape) < 1e-9 * escape
    assert caught.value.horizon == 1.5 * escape
    eq = core(long, prediction_horizon=0.5 * escape).equilibrium()
    assert eq.P.shape[1] == 101
    assert np.isfinite(eq.P).all()


@pytest.mark.parametrize("ahead", [0.0, -1.0, np.nan, np.inf])
def test_the_prediction_is_positive_and_finite(ahead):
    game = random_game(np.random.default_rng(5), "I1", 1, horizon=1.0)
    with pytest.raises(ScenarioError, match="prediction_horizon"):
        core(scenario(game), prediction_horizon=ahead)
