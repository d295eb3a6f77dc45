"""Scores of a batch: their signs are the outcomes, their values those of the definition, and they change nothing."""

import numpy as np
import pytest

import tadcore
from samples import random_game, scenario
from tadcore import ScenarioError
from tadcore.statistics.outcomes import indicators
from world_samples import changes_of, random_world

TINY = 5e-324


def strict(margin):
    return np.where(margin > 0.0, margin, np.minimum(margin, -TINY))


def by_definition(states, capture):
    """All scores from relative positions (K + 1, N, dim), by the formulas of the core's docs."""
    d2 = np.zeros(states.shape[:2])
    for x in range(states.shape[2]):
        d2 = d2 + states[..., x] * states[..., x]
    d, n = np.sqrt(d2), states.shape[1] - 1
    inside, clear = capture - d, strict(d - capture)
    always = np.full((1, n + 1), np.inf)
    until = np.minimum.accumulate(np.concatenate([always, clear]))[:-1]
    timeout = clear.min()
    captured = np.minimum(inside[:, n], np.minimum.accumulate(clear[:, :n].min(axis=1))).max()
    intercepted = np.minimum(inside[:, :n].max(axis=1), until[:, n]).max()
    each = []
    for i in range(n):
        margin = np.minimum(inside[:, i], until[:, n])
        for j in range(n):
            if j == i:
                continue
            nearer = d2[:, j] >= d2[:, i] if j > i else d2[:, j] > d2[:, i]
            by = np.where(nearer, np.maximum(d[:, j] - d[:, i], 0.0), np.minimum(d[:, j] - d[:, i], -TINY))
            margin = np.minimum(margin, np.minimum(until[:, j], np.maximum(clear[:, j], by)))
        each.append(margin.max())
    return [timeout, captured, intercepted, *each]


def drawn(rng, game, trials, dim, spread):
    """A scenario with random radii and starts, some of them on whole numbers, where ties are the rule."""
    positions = rng.uniform(-spread, spread, (trials, game.n + 2, dim))
    positions[::3] = np.round(positions[::3] * 2) / 2
    capture = np.round(rng.uniform(0.1, 0.6, (trials, game.n + 1)), 1)
    sight = np.where(rng.random((trials, game.m)) < 0.5, np.inf, rng.uniform(0.7, 2 * spread, (trials, game.m)))
    return positions, sight, capture


CASES = [
    (interaction, n, dim, world)
    for interaction in ("I1", "I2")
    for n, dim in ((1, 2), (2, 3), (3, 2), (5, 2))
    for world in (False, True)
]


@pytest.mark.parametrize(("interaction", "n", "dim", "world"), CASES)
def test_signs_are_the_outcomes(interaction, n, dim, world):
    """6,250 trials of each of 16 kinds: 100,000."""
    rng = np.random.default_rng([n, dim, world, interaction == "I2"])
    horizon = 0.2 if n > 3 else 1.0
    game = random_game(rng, interaction, n, horizon=horizon, step=0.05 * horizon)
    sc = scenario(game)
    if world:
        sc = sc.replace(changes_of(random_world(rng, game), game))
    positions, sight, capture = drawn(rng, game, 6250, dim, 1.0 if n > 3 else 1.5)
    found = tadcore.simulate_batch(sc_of(sc, dim), positions, sight, capture, seed=3, scores=True)
    plain = tadcore.simulate_batch(sc_of(sc, dim), positions, sight, capture, seed=3)
    for name in ("kind", "defender", "time", "diverged"):
        assert np.array_equal(getattr(found, name), getattr(plain, name)), name
    assert plain.scores is None
    events = indicators(plain.kind, plain.defender, n, plain.diverged)
    assert np.array_equal((found.scores >= 0.0).T, events[: n + 3])
    assert events[: n + 3].any(axis=1).all()


def sc_of(sc, dim):
    """The same scenario with positions of another dimension, which play no part."""
    if dim == sc.dim:
        return sc
    names = [*(f"defenders[{i}]" for i in range(sc.n)), "target", "attacker"]
    return sc.replace({f"{name}.position": [1.0 * i, 0.0, 0.0] for i, name in enumerate(names)})


@pytest.mark.parametrize("name", ["paper-i1", "paper-i2"])
def test_scores_are_those_of_the_definition(name):
    """Against NumPy, on recorded runs that go on past the end since nobody catches anybody within 1e-9."""
    sc = tadcore.scenarios.load(name)
    sc = sc.replace({"d1.sensing.mean_time_to_failure": 1.0, "d*.disturbance": 0.05})
    rng = np.random.default_rng(5)
    positions = sc.positions + rng.uniform(-1.0, 1.0, (40, sc.n + 2, sc.dim))
    found = tadcore.simulate_batch(sc, positions, seed=9, first_trial=100, scores=True)
    blind = sc.replace({"d*.capture_radius": 1e-9, "attacker.capture_radius": 1e-9})
    names = [*(f"defenders[{i}]" for i in range(sc.n)), "target", "attacker"]
    for i, at in enumerate(positions):
        changes = {f"{who}.position": row for who, row in zip(names, at, strict=True)}
        run = tadcore.simulate(blind.replace(changes), seed=9, trial=100 + i)
        assert run.outcome.kind == "timeout"
        x = run.dataset["position"].transpose("time", "player", "axis").values
        expected = by_definition(x[:, :-1] - x[:, -1:], np.asarray(sc.capture_radii))
        assert found.scores[i] == pytest.approx(expected, abs=1e-12)


def test_threads_and_slices():
    sc = tadcore.scenarios.load("paper-i1")
    positions = sc.positions + np.random.default_rng(1).uniform(-0.5, 0.5, (300, sc.n + 2, sc.dim))
    one, three = (tadcore.simulate_batch(sc, positions, scores=True, threads=t) for t in (1, 3))
    assert one.scores.shape == (300, 6)
    assert one.scores.tobytes() == three.scores.tobytes()
    assert one[100:].scores.tobytes() == tadcore.simulate_batch(sc, positions[100:], scores=True).scores.tobytes()
    assert tadcore.simulate_batch(sc, positions[:0], scores=True).scores.shape == (0, 6)


def test_a_game_that_diverges_is_no_event():
    """Blind defenders in an unstable game: whoever is far off is no timeout, and nobody is caught any more."""
    sc = tadcore.scenarios.load("paper-i2").replace({"attacker.control_weight": 0.3})
    positions = sc.positions + np.random.default_rng(2).uniform(-0.3, 0.3, (64, sc.n + 2, sc.dim))
    found = tadcore.simulate_batch(sc, positions, scores=True)
    plain = tadcore.simulate_batch(sc, positions)
    assert np.array_equal(found.diverged, plain.diverged)
    assert found.diverged.any()
    assert np.array_equal(found.time, plain.time)
    assert (found.scores[found.diverged] < 0.0).all()
    assert np.isneginf(found.scores[found.diverged, 0]).all()


def test_what_looks_between_instants_is_refused():
    sc = tadcore.scenarios.load("paper-i1")
    with pytest.raises(ScenarioError, match="termination") as caught:
        tadcore.simulate_batch(sc, [sc.positions], termination="continuous", scores=True)
    assert "instants of the grid" in str(caught.value)
    with pytest.raises(ScenarioError, match="passes"):
        tadcore.simulate_batch(sc, [sc.positions], passes=True, scores=True)
