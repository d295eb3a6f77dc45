"""Runs with gains that turn: against expm of the full loop, mirror images, and the scalar run where none turn."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.linalg import expm

import tadcore
from oracle.costs import running
from oracle.riccati import equilibrium, feedback
from oracle.scenario import as_mapping
from oracle.turning import blocks, play
from samples import random_game, random_start
from tadcore import verification

TURNED = (12, 20, 34, 46)
"""Games at some of whose instants gains turn."""


@cache
def drawn(seed):
    """A random game of three defenders, its start, and the scenario of both."""
    rng = np.random.default_rng([seed, 7])
    gamma = tuple(np.exp(rng.uniform(np.log(0.02), 0.0, 4)).round(4).tolist())
    game = random_game(rng, "I1", 3, horizon=3.0, step=0.05, low=0.25, high=4.0, gamma=gamma)
    start = random_start(rng, game, spread=2.5)
    return game, start, tadcore.Scenario.model_validate(as_mapping(game, start))


def end_of(run):
    return run.outcome.kind, run.outcome.defender, len(run.times) - 1


@pytest.mark.parametrize("mirror", [False, True])
@pytest.mark.parametrize("seed", TURNED)
def test_a_run_is_that_of_the_full_closed_loop(seed, mirror):
    game, start, sc = drawn(seed)
    run = tadcore.simulate(sc, gains="turning", mirror=mirror)
    assert run.gains.dtype == np.complex128
    assert run.gains.imag.any()
    P = equilibrium(game)
    end, positions, networks = play(game, start, lambda k, A: run.gains[k], lambda k: feedback(game, P[k]))
    assert end == end_of(run)
    np.testing.assert_allclose(np.array(positions), run.position, rtol=0, atol=1e-10 * np.abs(run.position).max())
    assert (np.array(networks) == run.adjacency[:-1]).all()
    for k in range(len(run.times)):  # the controls are the velocities at each instant
        z = (run.position[k, :-1] - run.position[k, -1]).ravel()
        u = blocks(run.gains[k]) @ z
        np.testing.assert_allclose(run.control[k, : game.m].ravel(), u, atol=1e-10 * (1.0 + np.abs(u).max()))


@pytest.mark.parametrize("seed", TURNED)
def test_gains_are_those_of_the_instant_and_the_network(seed):
    sc = drawn(seed)[2]
    run = tadcore.simulate(sc, gains="turning")
    turned = np.flatnonzero(run.gains.imag.any(axis=(1, 2)))
    for k in {*turned[:3].tolist(), 0, len(run.times) // 2}:
        own = tadcore.synthesize(sc, step=k, adjacency=run.adjacency[k], gains="turning")
        assert own.rows.tobytes() == run.gains[k].tobytes()
        assert (own.theta, *own.terms.values()) == (run.theta[k], *run.theta_terms[k])


@pytest.mark.parametrize("step", [0.05, 0.25])
@pytest.mark.parametrize("seed", TURNED)
def test_costs_are_integrals_over_both_axes(seed, step):
    """With the long step |C|δ is beyond what the quadrature takes, and the moments are in double-double arithmetic."""
    game, _, sc = drawn(seed)
    sc = sc.replace({"step": step})
    run = tadcore.simulate(sc, gains="turning")
    game = replace(game, step=step)
    P = equilibrium(game)
    _, _, _, Q, F = game.matrices(2)
    r = np.array([*game.r_d, game.r_tau, game.r_a])
    own = np.array([[1, 1, 1, 0, 0], [0, 0, 0, 1, 0], [0, 0, 0, 0, 1]]) * r
    total, size = np.zeros(3), 2 * game.N
    for k in range(len(run.times) - 1):
        rows = feedback(game, P[k]).astype(complex)
        rows[: game.m] = run.gains[k]
        G = blocks(rows)
        C = G[:size] - np.tile(G[size:], (game.N, 1))
        z = (run.position[k, :-1] - run.position[k, -1]).reshape(-1, 1)
        for p, name in enumerate(("d", "tau", "a")):
            total[p] += running(C, Q[name] + G.T @ np.diag(np.repeat(own[p], 2)) @ G, z, sc.step)
    z = (run.position[-1, :-1] - run.position[-1, -1]).ravel()
    expected = 0.5 * (total + [z @ F[name] @ z for name in ("d", "tau", "a")])
    assert list(run.costs.values()) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("seed", TURNED)
def test_from_the_mirror_image_of_the_start_mirrored_gains_play_the_mirror_image(seed):
    sc = drawn(seed)[2]
    players = [*(f"defenders[{i}]" for i in range(sc.n)), "target", "attacker"]
    flipped = sc.replace({f"{p}.position": (x, -y) for p, (x, y) in zip(players, sc.positions.tolist(), strict=True)})
    run = tadcore.simulate(sc, gains="turning")
    image = tadcore.simulate(flipped, gains="turning", mirror=True)
    assert end_of(run) == end_of(image)
    assert (image.position == run.position * [1.0, -1.0]).all()
    assert (image.control == run.control * [1.0, -1.0]).all()
    assert (image.gains == run.gains.conj()).all()
    assert image.costs == run.costs
    other = tadcore.simulate(sc, gains="turning", mirror=True)
    assert np.abs(other.position[: len(run.times)] - run.position[: len(other.times)]).max() > 0.1


def test_who_wins_can_depend_on_the_choice_of_gains():
    sc = drawn(20)[2]
    assert tadcore.simulate(sc).outcome.kind == "intercepted"
    assert tadcore.simulate(sc, gains="turning").outcome.kind == "captured"
    late = tadcore.simulate(sc, gains="turning", mirror=True).outcome
    assert late.kind == "captured"
    assert late.time > tadcore.simulate(sc, gains="turning").outcome.time


@pytest.mark.parametrize("name", tadcore.scenarios.names())
def test_of_the_paper_no_run_has_gains_that_turn(name):
    run, turning = tadcore.simulate(name), tadcore.simulate(name, gains="turning")
    assert turning.outcome == run.outcome
    for field in ("times", "position", "control", "adjacency", "theta", "theta_terms"):
        assert getattr(turning, field).tobytes() == getattr(run, field).tobytes()
    assert turning.gains.real.tobytes() == run.gains.tobytes()
    assert not turning.gains.imag.any()
    assert (turning.costs, turning.certified, turning.passes) == (run.costs, run.certified, run.passes)
    assert turning.turning
    assert not run.turning


@pytest.mark.parametrize("seed", [20, 46])
def test_between_instants_the_motion_turns_too(seed):
    """The end at a crossing lies on the path of the full loop, at the radius."""
    game, _, sc = drawn(seed)
    P = equilibrium(game)
    for mirror in (False, True):
        sampled = tadcore.simulate(sc, gains="turning", mirror=mirror)
        run = tadcore.simulate(sc, gains="turning", mirror=mirror, termination="continuous")
        k = len(run.times) - 2
        rows = feedback(game, P[k]).astype(complex)
        rows[: len(sc.constrained)] = run.gains[k]
        G = blocks(rows)
        whole = np.hstack([G, -G.reshape(len(G), -1, 2).sum(axis=1)])
        X = (expm(whole * (run.times[-1] - run.times[-2])) @ run.position[k].ravel()).reshape(-1, 2)
        np.testing.assert_allclose(run.position[-1], X, atol=1e-11)
        assert (run.position[:-1] == sampled.position[: k + 1]).all()
        if run.outcome.kind != "timeout":
            row = sc.n if run.outcome.kind == "captured" else run.outcome.defender
            assert np.linalg.norm(X[row] - X[-1]) == pytest.approx(sc.capture_radii[row], abs=1e-10)
            assert run.outcome.time <= sampled.outcome.time


def test_a_run_is_saved_and_read_back_whole(tmp_path):
    run = tadcore.simulate(drawn(34)[2], gains="turning", mirror=True)
    assert "a variant, mirrored turning gains" in repr(run)
    data = run.dataset
    assert (data["gain"].values + 1j * data["gain_turning"].values == run.gains).all()
    assert data.attrs["variant"] == "mirrored turning gains"
    for place in (tmp_path / "run.nc", tmp_path / "folder"):
        run.save(place)
        again = tadcore.load_run(place)
        assert again.gains.tobytes() == run.gains.tobytes()
        assert (again.turning, again.mirror, again.outcome) == (True, True, run.outcome)
        assert again.dataset.identical(data)
    run.plot.gains()


def test_what_needs_scalar_gains_refuses_others():
    run = tadcore.simulate(drawn(20)[2], gains="turning")
    with pytest.raises(tadcore.ScenarioError, match="turning gains"):
        tadcore.verify(run)
    with pytest.raises(tadcore.ScenarioError, match="turning gains"):
        verification.control_jumps(run)
    assert not verification.check_record(run, tadcore.solve_equilibrium(run.scenario)).ok
    with pytest.raises(tadcore.ScenarioError, match="mirror: got True"):
        tadcore.simulate("paper-i1", mirror=True)
    with pytest.raises(tadcore.ScenarioError, match=r"gains: got 'all'"):
        tadcore.simulate("paper-i1", gains="all")


@pytest.mark.parametrize(
    "changes",
    [
        {"feedback": "receding", "prediction_horizon": 2.0},
        {"criterion": "component"},
        {"defenders[0].disturbance": 0.01},
    ],
)
def test_variants_of_the_game_are_played_with_gains_that_turn(changes):
    sc = drawn(20)[2].replace(changes)
    run = tadcore.simulate(sc, gains="turning", hysteresis=0.01, seed=3)
    k = int(np.flatnonzero(run.gains.imag.any(axis=(1, 2)))[0])
    own = tadcore.synthesize(sc, step=k, adjacency=run.adjacency[k], gains="turning")
    assert own.rows.tobytes() == run.gains[k].tobytes()
    assert run.position[: k + 1].tobytes() == tadcore.simulate(sc, hysteresis=0.01, seed=3).position[: k + 1].tobytes()
