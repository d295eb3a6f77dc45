"""Games in random worlds against the oracle: outcome, time, networks, positions, and what failed and was told."""

import numpy as np
import pytest

import tadcore
from oracle import chains
from oracle.scenario import as_mapping
from oracle.stepping import Gains, Remembering, simulate
from oracle.worlds import Course
from samples import random_game, random_start
from world_samples import changes_of, random_world

CLOSE = 1e-7
"""Relative to the size of a game: nearer than this to a radius or an end, rounding decides."""


def drawn_game(seed, *, steps=30, **parts):
    """A random game in a random world, and the same as a scenario."""
    rng = np.random.default_rng([95, seed])
    interaction, n, axes = ("I1", "I2")[seed % 2], 1 + seed % 3, 2 + (seed // 2) % 2
    game = random_game(rng, interaction, n, horizon=1.2, step=1.2 / steps)
    start = random_start(rng, game, axes, spread=1.2, sigma=0.25)
    world = random_world(rng, game, **parts)
    sc = tadcore.Scenario.model_validate(as_mapping(game, start)).replace(changes_of(world, game))
    key = {"seed": int(rng.integers(2**63)), "trial": int(rng.integers(2**40))}
    return game, start, world, sc, key


def play(game, start, world, key, look=None):
    course = Course(world, game, start.positions.shape[1], **key)
    return simulate(game, start, Gains(game, few=1, many=6), look, course=course), course


def compare(run, expected, game):
    """Outcome, time, networks, what is seen and positions of a run against those of the oracle."""
    assert (run.outcome.kind, run.outcome.defender) == (expected.kind, expected.defender)
    assert run.outcome.time == pytest.approx(expected.time, abs=1e-9)
    L = expected.step
    assert len(run.times) == L + 1
    if L:
        assert np.array_equal(run.adjacency[:L], expected.networks)
        assert np.array_equal(run.seen[:L], expected.seen)
        changes = [k for k in range(L) if k == 0 or (expected.networks[k] != expected.networks[k - 1]).any()]
        assert [c.time for c in run.network_changes] == pytest.approx([k * game.step for k in changes], abs=1e-9)
    scale = 1 + np.max(np.abs(expected.positions))
    assert np.max(np.abs(run.position - np.array(expected.positions))) <= 1e-7 * scale


@pytest.mark.parametrize("seed", range(30))
def test_a_random_game_is_the_oracles(seed):
    game, start, world, sc, key = drawn_game(seed)
    expected, course = play(game, start, world, key)
    assert expected.margin > CLOSE
    run = tadcore.simulate(sc, **key)
    compare(run, expected, game)
    L = expected.step
    if run.course is None:
        assert sc.world is None
        return
    assert np.array_equal(run.course.sensor_up[:L], chains.sensors(world, game, course.key)[:L])
    assert np.array_equal(run.course.edge_up[:L], chains.edges(world, game, course.key)[:L])
    for k in range(L):
        assert np.array_equal(run.course.heard[k], course.heard(k, expected.positions[k]))
        assert run.course.displacement[k] == pytest.approx(course.shock(k), rel=1e-13, abs=1e-300)
    assert not run.course.displacement[-1].any()


@pytest.mark.parametrize("seed", [pytest.param(s, marks=[pytest.mark.heavy] * (s >= 6)) for s in range(30)])
def test_edges_with_a_memory_are_the_oracles(seed):
    """Hysteresis, in every second game a dwell time: the memory is of sight alone, before what fails and is told."""
    game, start, world, sc, key = drawn_game(100 + seed)
    rule = {"hysteresis": 0.1 + 0.05 * (seed % 5), "dwell": 3 * game.step * (seed % 2)}
    expected, _ = play(game, start, world, key, Remembering(start.zeta, *rule.values(), game.step))
    assert expected.margin > CLOSE
    run = tadcore.simulate(sc, **rule, **key)
    if run.course is None:  # nothing surrounds this game: what is seen is used
        expected.seen = expected.networks
    compare(run, expected, game)


@pytest.mark.parametrize("seed", range(100))
def test_a_batch_plays_what_a_run_plays(seed):
    _, start, _, sc, key = drawn_game(seed)
    rng = np.random.default_rng([96, seed])
    positions = start.positions + rng.normal(0.0, 0.3, (5, 1, start.positions.shape[1]))
    positions[0] = start.positions
    batch = tadcore.simulate_batch(sc, positions, seed=key["seed"], first_trial=key["trial"])
    for row, places in enumerate(positions):
        moved = sc.replace({f"{p}.position": x for p, x in zip(sc.players, places.tolist(), strict=True)})
        assert tadcore.simulate(moved, seed=key["seed"], trial=key["trial"] + row).outcome == batch[row]


def test_the_games_are_of_every_kind():
    """So that what was compared was worth comparing."""
    drawn = [drawn_game(seed) for seed in range(30)]
    worlds = [sc.world for _, _, _, sc, _ in drawn if sc.world is not None]
    assert sum(w.fails for w in worlds) >= 10
    assert sum(w.talks for w in worlds) >= 8
    assert sum(w.shakes for w in worlds) >= 10
    assert {w.common_frame for w in worlds if w.talks} == {True, False}
    assert len({w.relays for w in worlds if w.talks}) >= 3
    assert {sc.dim for _, _, _, sc, _ in drawn} == {2, 3}
