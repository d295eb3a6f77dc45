"""Gains that turn together with everything else that a game can have: what is played is computed again in full blocks.

Motion, networks and ends by the oracle's exponentials of the full loop, in trials of worlds that it draws itself; the
gains, at some instants, as what BFGS in full blocks finds lowest for the rows that are free.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import tadcore
from oracle.network import adjacency
from oracle.riccati import equilibrium, feedback, integrate
from oracle.scenario import as_mapping
from oracle.stepping import Remembering
from oracle.theta import full, theta
from oracle.turning import blocks, lowest, play
from oracle.worlds import Course
from samples import random_game, random_start
from tadcore import ScenarioError
from tadcore.analysis import sensitivity
from tadcore.game.externality import control_jumps
from tadcore.plotting.run.externality import externality
from tadcore.sampling import Gaussian
from world_samples import changes_of, random_world

STEP = 0.05
WORLDS = {
    "told": {"fails": False, "shakes": False},
    "failing": {"talks": False, "shakes": False},
    "shaken": {"fails": False, "talks": False},
    "all": {},
}


@cache
def drawn(seed):
    """A random game of three defenders, its start, and the scenario of both."""
    rng = np.random.default_rng([seed, 7])
    gamma = tuple(np.exp(rng.uniform(np.log(0.02), 0.0, 4)).round(4).tolist())
    game = random_game(rng, "I1", 3, horizon=3.0, step=STEP, low=0.25, high=4.0, gamma=gamma)
    start = random_start(rng, game, spread=2.5)
    return game, start, tadcore.Scenario.model_validate(as_mapping(game, start))


@cache
def matrices(game, ahead=None):
    """Reduced P at every instant: of the finite game, or at the beginning of a prediction."""
    if ahead is None:
        return equilibrium(game)
    return np.repeat(integrate(game, axes=1, times=[0.0], horizon=ahead), game.steps + 1, axis=0)


def same_play(run, game, start, P, *, sight_of=None, course=None):
    """The record is what the gains in it lead to, by the full loop."""
    played = play(game, start, lambda k, A: run.gains[k], lambda k: feedback(game, P[k]), sight_of, course)
    end, positions, networks = played
    assert end == (run.outcome.kind, run.outcome.defender, len(run.times) - 1)
    assert (np.array(networks) == run.adjacency[:-1]).all()
    np.testing.assert_allclose(np.array(positions), run.position, rtol=0, atol=1e-10 * np.abs(run.position).max())


def lowest_gains(run, game, P, held=lambda k: {}, most=3):
    """At some instants, those at which gains turn first, no descent in blocks is lower, and Theta is theirs."""
    turned = np.flatnonzero(run.gains[:-1].imag.any(axis=(1, 2)))
    assert len(turned)
    # The ends and the middle of where they turn, and as many instants at which they do not.
    others = np.setdiff1d(np.arange(len(run.times) - 1), turned)
    chosen = [
        part[np.unique(np.linspace(0, len(part) - 1, most).astype(int))] for part in (turned, others) if len(part)
    ]
    for k in np.concatenate(chosen):
        A, of_full = run.adjacency[k], full(P[k])
        found = theta(game, of_full, blocks(run.gains[k])) / 2.0
        assert run.theta[k] == pytest.approx(found, rel=1e-9, abs=1e-13)
        best, _ = lowest(game, of_full, A, 5, np.random.default_rng(int(k)), held(k))
        assert run.theta[k] <= best * (1 + 1e-9) + 1e-13
        for i, row in held(k).items():
            np.testing.assert_allclose(run.gains[k, i], row, atol=1e-9 * np.abs(row).max())


@pytest.mark.parametrize("mirror", [False, True])
@pytest.mark.parametrize("what", WORLDS)
@pytest.mark.parametrize("seed", [12, 20, 34])
def test_players_fail_report_and_are_shaken(seed, what, mirror):
    game, start, sc = drawn(seed)
    rng = np.random.default_rng([seed, list(WORLDS).index(what)])
    while (world := random_world(rng, game, **WORLDS[what])) is not None:
        there = {
            "told": world.link_radius is not None,
            "failing": bool(np.isfinite([world.to_failure, world.detected]).any()),
            "shaken": bool(world.disturbance.any()),
        }
        if all(there.values()) if what == "all" else there[what]:
            break
    run = tadcore.simulate(sc.replace(changes_of(world, game)), gains="turning", mirror=mirror, seed=seed, trial=3)
    assert run.gains.dtype == np.complex128
    course = Course(world, game, 2, seed=seed, trial=3)
    same_play(run, game, start, matrices(game), course=course)
    for k in range(len(run.times) - 1):
        assert (run.seen[k] == course.network(k, run.position[k], start.zeta)[1]).all()
    if run.gains[:-1].imag.any():
        lowest_gains(run, game, matrices(game), most=1)
    assert tadcore.simulate(run.scenario, seed=seed, trial=3).turning is False


def test_in_most_of_these_worlds_some_gains_turn():
    """Or the test above would be one of scalar gains."""
    turned = 0
    for seed in (12, 20, 34):
        game, _, sc = drawn(seed)
        for what, parts in WORLDS.items():
            world = random_world(np.random.default_rng([seed, list(WORLDS).index(what)]), game, **parts)
            run = tadcore.simulate(sc.replace(changes_of(world, game)), gains="turning", seed=seed, trial=3)
            turned += bool(run.gains[:-1].imag.any())
    assert turned >= 6


@pytest.mark.parametrize("mirror", [False, True])
@pytest.mark.parametrize("seed", [12, 34])
def test_edges_remember(seed, mirror):
    game, start, sc = drawn(seed)
    run = tadcore.simulate(sc, gains="turning", mirror=mirror, hysteresis=0.2, dwell=0.15)
    remembered = Remembering(start.zeta, 0.2, 0.15, game.step)
    same_play(run, game, start, matrices(game), sight_of=lambda _k, X: remembered(X))
    assert not np.array_equal(run.adjacency[:-1], [adjacency(X, start.zeta) for X in run.position[:-1]])
    lowest_gains(run, game, matrices(game))


@pytest.mark.parametrize("mirror", [False, True])
@pytest.mark.parametrize("seed", [20, 35])
def test_a_function_decides_the_network(seed, mirror):
    game, start, sc = drawn(seed)

    def decided(k, sight):
        return sight | np.eye(*sight.shape, dtype=bool) if k % 7 < 5 else np.roll(sight, 1, axis=0)

    network = lambda k, _t, _X, sight: decided(k, sight)  # noqa: E731
    run = tadcore.simulate(sc, gains="turning", mirror=mirror, network=network)
    assert run.variant == f"{'mirrored ' * mirror}turning gains and a network from outside"
    same_play(run, game, start, matrices(game), sight_of=lambda k, X: decided(k, adjacency(X, start.zeta)))
    lowest_gains(run, game, matrices(game))


@pytest.mark.parametrize("ahead", [1.3, 4.0])
@pytest.mark.parametrize("seed", [20, 34])
def test_the_horizon_recedes(seed, ahead):
    game, start, sc = drawn(seed)
    run = tadcore.simulate(sc.replace({"feedback": "receding", "prediction_horizon": ahead}), gains="turning")
    P = matrices(game, ahead)
    same_play(run, game, start, P)
    if run.gains[:-1].imag.any():
        lowest_gains(run, game, P)


@pytest.mark.parametrize("mirror", [False, True])
@pytest.mark.parametrize("seed", [4, 35])
def test_who_knows_everything_plays_its_equilibrium_row(seed, mirror):
    """The criterion "component", with a player who sees everyone: the others' rows alone are sought, and may turn."""
    game, start, sc = drawn(seed)
    radii = np.where(np.arange(game.m) == 0, np.inf, start.zeta)
    sc = sc.replace({"criterion": "component", "d1.visibility_radius": np.inf})
    run = tadcore.simulate(sc, gains="turning", mirror=mirror)
    P = matrices(game)
    same_play(run, game, replace(start, zeta=radii), P)
    whole = run.adjacency.all(axis=2)
    assert whole[:, 0].all()
    assert not run.gains.imag[whole].any()

    def held(k):
        rows = feedback(game, P[k])
        return {i: rows[i] for i in np.flatnonzero(whole[k])}

    lowest_gains(run, game, P, held)


def test_everything_at_once():
    game, start, sc = drawn(34)
    rng = np.random.default_rng(3)
    world = random_world(rng, game)
    changes = changes_of(world, game) | {"feedback": "receding", "prediction_horizon": 2.5, "criterion": "component"}
    run = tadcore.simulate(sc.replace(changes), gains="turning", hysteresis=0.1, seed=5, trial=6)
    course = Course(world, game, 2, seed=5, trial=6)
    remembered = Remembering(start.zeta, 0.1, 0.0, game.step)
    P = matrices(game, 2.5)
    same_play(run, game, start, P, sight_of=lambda _k, X: remembered(X), course=course)
    whole = run.adjacency.all(axis=2)
    lowest_gains(run, game, P, lambda k: {i: feedback(game, P[k])[i] for i in np.flatnonzero(whole[k])})


def test_from_the_mirror_image_of_the_start_failing_players_play_the_mirror_image():
    """Sensors and links know no side; disturbances do, and are left out."""
    game, _, sc = drawn(34)
    world = random_world(np.random.default_rng([34, 3]), game, shakes=False)
    sc = sc.replace(changes_of(world, game))
    flipped = sc.replace({f"{p}.position": (x, -y) for p, (x, y) in zip(names(sc), sc.positions.tolist(), strict=True)})
    run = tadcore.simulate(sc, gains="turning", seed=2)
    image = tadcore.simulate(flipped, gains="turning", mirror=True, seed=2)
    assert run.gains.imag.any()
    assert image.outcome == run.outcome
    assert (image.position == run.position * [1.0, -1.0]).all()
    assert (image.gains == run.gains.conj()).all()
    assert (image.seen == run.seen).all()


def names(sc):
    return [*(f"defenders[{i}]" for i in range(sc.n)), "target", "attacker"]


def test_a_run_in_a_world_is_saved_and_read_back_whole(tmp_path):
    game, _, sc = drawn(20)
    world = random_world(np.random.default_rng(3), game)
    run = tadcore.simulate(sc.replace(changes_of(world, game)), gains="turning", mirror=True, seed=5, trial=6)
    assert run.gains.imag.any()
    run.save(tmp_path / "run.nc")
    again = tadcore.load_run(tmp_path / "run.nc")
    assert again.gains.tobytes() == run.gains.tobytes()
    assert again.dataset.identical(run.dataset)
    assert (again.seed, again.trial, again.mirror, again.variant) == (5, 6, True, "mirrored turning gains")


# ---- what is refused


def test_an_end_between_instants_is_refused_where_players_are_shaken():
    sc = drawn(20)[2].replace({"attacker.disturbance": 0.02})
    with pytest.raises(ScenarioError, match="termination: got 'continuous', must be \"sampled\""):
        tadcore.simulate(sc, gains="turning", termination="continuous")


def test_what_is_of_scalar_gains_refuses_the_run_by_name():
    run = tadcore.simulate(drawn(20)[2].replace({"d1.visibility_radius": np.inf}), gains="turning")
    for ask in (lambda: run.theta_price, lambda: control_jumps(run), lambda: externality(run)):
        with pytest.raises(ScenarioError, match=r"run: got .*turning gains.*, must be one with scalar gains"):
            ask()


def test_many_games_are_of_scalar_gains_and_say_so():
    sc = drawn(20)[2]
    study = tadcore.Study(sc, {"attacker.position": Gaussian(sc.attacker.position, 0.1)}, trials=2)
    positions, plane = [sc.positions], {"x": (0.0, 1.0, 2), "y": (0.0, 1.0, 2)}
    for use in (
        lambda **gains: tadcore.simulate_batch(sc, positions, **gains),
        lambda **gains: tadcore.Study(sc, {}, trials=2, **gains),
        lambda **gains: study.run(**gains),
        lambda **gains: tadcore.outcome_map(sc, **plane, **gains),
        lambda **gains: tadcore.certified_map(sc, **gains),
        lambda **gains: tadcore.probability_map(study, **gains),
        lambda **gains: tadcore.radius_curve(study, "d1", **gains),
        lambda **gains: tadcore.best_start(study, "d1", **gains),
        lambda **gains: tadcore.best_radii(study, **gains),
        lambda **gains: sensitivity(study, **gains),
        lambda **gains: tadcore.sweep(study, {}, **gains),
        lambda **gains: tadcore.rare(study, **gains),
        lambda **gains: tadcore.verify(sc, **gains),
    ):
        for given in ({"gains": "turning"}, {"mirror": True}):
            (name,) = given
            said = rf"\(\) has no option '{name}'; only tadcore\.simulate and .* many games have scalar gains$"
            with pytest.raises(TypeError, match=said):
                use(**given)
    text = 'scenario = "paper-i1"\ntrials = 2\ngains = "turning"\n[vary]\n"attacker.position.x" = { box = [0, 1] }\n'
    with pytest.raises(ScenarioError, match=r"gains: got 'turning', must be left out: a study has no such key"):
        tadcore.Study.from_toml_string(text)
    with pytest.raises(ScenarioError, match=r"gains: got 'turning'"):
        sc.replace({"gains": "turning"})
