"""What the paper proves and what symmetry demands, on random games."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, strategies as st
from scipy.stats import special_ortho_group

import tadcore
from oracle.model import paper_cases
from oracle.riccati import equilibrium, feedback, integrate
from oracle.scenario import as_mapping
from samples import random_game, random_start

SEEDS = st.integers(0, 2**32 - 1)


def play(game, start):
    return tadcore.simulate(tadcore.Scenario.model_validate(as_mapping(game, start)))


def drawn(seed, interaction, n, axes=2, **options):
    rng = np.random.default_rng(seed)
    game = random_game(rng, interaction, n, horizon=1.5, step=0.02, **options)
    return rng, game, random_start(rng, game, axes)


def same_positions(one, other):
    """Within 1e-8 of the extent: a pursuer that is not seen can run very far."""
    return np.max(np.abs(one - other)) <= 1e-8 * (1 + np.max(np.abs(other)))


def times(run):
    return run.outcome.time, [change.time for change in run.network_changes]


@given(seed=SEEDS, n=st.integers(1, 3))
def test_suicidal_attacker_and_target_stay_on_their_line(seed, n):
    _, game, start = drawn(seed, "I1", n, evasion=0.0)
    run, blind = play(game, start), play(game, replace(start, zeta=start.sigma[:n] + 1e-3))
    along = start.positions[n] - start.positions[n + 1]
    across = np.array([-along[1], along[0]]) / np.linalg.norm(along)
    offset = (run.position[:, n:] - start.positions[n]) @ across
    assert np.max(np.abs(offset)) <= 1e-11
    common = min(len(run.times), len(blind.times))
    assert np.allclose(run.position[:common, n:], blind.position[:common, n:], rtol=0, atol=1e-11)
    P = tadcore.solve_equilibrium(run.scenario).P
    for name in ("target", "attacker"):
        outside = P[name].copy()
        outside[:, n, n] = 0
        assert np.max(np.abs(outside)) <= 1e-13


@given(seed=SEEDS, n=st.integers(1, 3), interaction=st.sampled_from(["I1", "I2"]))
def test_a_wider_radius_changes_nothing_before_its_first_edge(seed, n, interaction):
    rng, game, start = drawn(seed, interaction, n)
    i = int(rng.integers(game.m))
    narrow, wide = start.zeta.copy(), start.zeta.copy()
    narrow[i], wide[i] = 0.06, rng.uniform(0.3, 1.5)
    runs = [play(game, replace(start, zeta=zeta)) for zeta in (narrow, wide)]
    firsts = [int(np.argmax(sees)) if (sees := run.adjacency[:, i].any(axis=1)).any() else len(sees) for run in runs]
    first = min(firsts)
    for name in ("position", "control"):
        one, other = (getattr(run, name)[:first] for run in runs)
        assert np.array_equal(one, other)  # to the bit
    assert len(runs[0].position[:first]) == min(first, len(runs[0].times))


def test_radius_delay_in_the_runs_of_the_paper():
    cases = {c.name: c for c in paper_cases()}
    runs = [play(cases[name].game, cases[name].start) for name in ("I2 near target", "I2 wider d3")]
    first = round(1.405 / 0.005)
    assert np.array_equal(runs[0].control[:first], runs[1].control[:first])
    assert not np.array_equal(runs[0].control[first], runs[1].control[first])


@given(seed=SEEDS, n=st.integers(1, 3), interaction=st.sampled_from(["I1", "I2"]), axes=st.sampled_from([2, 3]))
def test_rotation_reflection_and_translation(seed, n, interaction, axes):
    rng, game, start = drawn(seed, interaction, n, axes)
    U = special_ortho_group.rvs(axes, random_state=rng)
    if rng.random() < 0.5:
        U[:, 0] *= -1
    shift = rng.normal(size=axes)
    run = play(game, start)
    moved = play(game, replace(start, positions=start.positions @ U.T + shift))
    assert times(moved) == times(run)
    assert moved.outcome == run.outcome
    assert same_positions(moved.position, run.position @ U.T + shift)
    assert list(moved.costs.values()) == pytest.approx(list(run.costs.values()), rel=1e-8, abs=1e-10)


@given(seed=SEEDS, n=st.integers(2, 4), interaction=st.sampled_from(["I1", "I2"]))
@example(seed=42, n=4, interaction="I2")  # at step 35 one labelling alone makes the lower minimum easy to find
def test_relabelled_defenders(seed, n, interaction):
    rng, game, start = drawn(seed, interaction, n)
    order = rng.permutation(n)
    team = {key: tuple(np.array(getattr(game, key))[order].tolist()) for key in ("r_d", "q_da", "f_da", "q_ad", "f_ad")}
    players = [*order, n, n + 1]
    relabelled = replace(
        start,
        positions=start.positions[players],
        zeta=start.zeta[[*order, n][: game.m]],
        sigma=start.sigma[[*order, n]],
    )
    run, other = play(game, start), play(replace(game, **team), relabelled)
    assert other.outcome.kind == run.outcome.kind
    if run.outcome.defender is not None:
        assert order[other.outcome.defender] == run.outcome.defender
    assert times(other) == times(run)
    assert same_positions(other.position, run.position[:, players])


@given(seed=SEEDS, n=st.integers(1, 3), interaction=st.sampled_from(["I1", "I2"]))
def test_a_planar_game_in_space(seed, n, interaction):
    rng, game, start = drawn(seed, interaction, n)
    plane = special_ortho_group.rvs(3, random_state=rng)[:, :2]
    shift = rng.normal(size=3)
    run, space = play(game, start), play(game, replace(start, positions=start.positions @ plane.T + shift))
    assert space.outcome == run.outcome
    assert times(space) == times(run)
    assert same_positions(space.position, run.position @ plane.T + shift)


@given(seed=SEEDS, n=st.integers(1, 4), interaction=st.sampled_from(["I1", "I2"]))
def test_full_sight_plays_the_equilibrium(seed, n, interaction):
    _, game, start = drawn(seed, interaction, n)
    run = play(game, replace(start, zeta=np.full(game.m, np.inf)))
    P = equilibrium(game)
    assert np.max(run.theta) <= 1e-18 * (1 + np.max(np.abs(P)) ** 4)
    assert len(run.network_changes) == 1
    for k in range(len(run.times) - 1):
        rows = feedback(game, P[k])
        z = run.position[k][:-1] - run.position[k][-1]
        assert np.allclose(run.control[k], rows @ z, rtol=0, atol=1e-8 * np.abs(rows).max() * np.abs(z).max())


@given(seed=SEEDS, n=st.integers(1, 3), interaction=st.sampled_from(["I1", "I2"]))
def test_who_sees_nobody_stands_still(seed, n, interaction):
    _, game, start = drawn(seed, interaction, n)
    run = play(game, start)
    for k in range(len(run.times) - 1):
        alone = ~run.adjacency[k].any(axis=1)
        assert not np.any(run.gains[k][alone])
        assert not np.any(run.control[k][: game.m][alone])
    frozen = play(game, replace(start, zeta=np.full(game.m, 0.051), sigma=np.full(n + 1, 0.05)))
    if not frozen.adjacency[:-1].any() and len(frozen.times) > 1:
        extent = 1 + np.max(np.abs(frozen.position))  # positions are kept relative to the attacker
        drift = np.abs(frozen.position[-1][: game.m] - frozen.position[0][: game.m])
        assert np.max(drift) <= 1e-12 * extent


@pytest.mark.parametrize(("interaction", "order"), [("I1", 1), ("I2", 2)])
def test_equilibrium_cost_is_the_value_function(interaction, order):
    """Full sight to the end: J tends to z'P(0)z/2, at first order in the step in I1, at second in I2 (a saddle)."""
    rng = np.random.default_rng([71, order])
    game = random_game(rng, interaction, 2, horizon=1.0, step=0.1)
    start = random_start(rng, game)
    start = replace(start, zeta=np.full(game.m, np.inf), sigma=np.full(3, 1e-6))
    z = start.positions[:-1] - start.positions[-1]
    P = integrate(game, axes=1, times=[0.0])[0]
    value = np.array([0.5 * np.sum(z * (p @ z)) for p in P])
    errors = []
    for step in (0.02, 0.01, 0.005):
        run = play(replace(game, step=step), start)
        assert run.outcome.kind == "timeout"
        errors.append(np.linalg.norm(list(run.costs.values()) - value))
    slopes = np.log2(np.array(errors[:-1]) / errors[1:])
    assert errors[-1] <= 0.02 * np.linalg.norm(value)
    assert np.allclose(slopes, order, atol=0.15)
