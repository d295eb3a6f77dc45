"""The equilibrium as Python shows it."""

import numpy as np
import pytest

import tadcore
from tadcore import NoEquilibriumError, ScenarioError


@pytest.fixture(scope="module", params=["paper-i1", "paper-i2"])
def solved(request):
    sc = tadcore.scenarios.load(request.param)
    return sc, tadcore.solve_equilibrium(sc)


def test_the_solution_lies_on_the_grid_by_group(solved):
    sc, eq = solved
    assert list(eq.P) == (["defenders", "target", "attacker"] if sc.interaction == "I1" else ["team"])
    assert eq.times.shape == (1201,)
    assert (eq.times[0], eq.times[-1]) == (0.0, 6.0)
    for p in eq.P.values():
        assert p.shape == (1201, 4, 4)
        assert np.array_equal(p, p.swapaxes(1, 2))
        assert not p.flags.writeable


def test_it_ends_in_the_terminal_weights(solved):
    sc, eq = solved
    if sc.interaction == "I1":
        assert np.array_equal(eq.P["defenders"][-1], np.diag([1.0, 1, 1, 0]))
        assert np.array_equal(eq.P["target"][-1], np.diag([0.0, 0, 0, -1]))
        assert np.array_equal(eq.P["attacker"][-1], np.diag([-1.0, -1, -1, 1]))
    else:
        assert np.array_equal(eq.P["team"][-1], np.diag([-1.0, -1, -1, 1]))


def test_the_full_matrix_is_the_papers(solved):
    _, eq = solved
    name = next(iter(eq.P))
    full = eq.full(name, 7)
    assert full.shape == (8, 8)
    assert np.array_equal(full[::2, ::2], eq.P[name][7])
    assert np.array_equal(full[1::2, 1::2], eq.P[name][7])
    assert not full[::2, 1::2].any()
    assert eq.full(name, 0, dim=3).shape == (12, 12)
    for bad in (-1, 1201, 0.0, True, None):
        with pytest.raises(ScenarioError, match=r"^k: got .*, must be a whole number in \[0, 1200\]"):
            eq.full(name, bad)
    with pytest.raises(ScenarioError, match=r"^name: got 'nobody', must be one of"):
        eq.full("nobody", 0)


def test_the_feedback_is_the_printed_one(solved):
    sc, eq = solved
    assert list(eq.feedback) == list(sc.players)
    if sc.interaction == "I1":
        expected = {
            "d2": -eq.P["defenders"][:, 1],
            "target": -eq.P["target"][:, 3] / 1.2,
            "attacker": eq.P["attacker"].sum(axis=1) / 0.8,
        }
    else:
        team = eq.P["team"]
        expected = {"d2": team[:, 1], "target": team[:, 3] / 1.2, "attacker": team.sum(axis=1) / 0.8}
    for player, rows in expected.items():
        assert np.allclose(eq.feedback[player], rows, rtol=1e-12, atol=1e-13)


def test_the_residual_is_small_and_public(solved):
    _, eq = solved
    assert set(eq.residual) == set(eq.P)
    assert all(values.shape == (1201,) for values in eq.residual.values())
    assert 0.0 <= eq.max_residual < 1e-9
    assert eq.integrator_steps > 0
    assert "4×4 on 1,201 nodes to T=6" in repr(eq)


@pytest.mark.parametrize(
    ("r", "q_d", "q_target", "escape"),
    [
        ([1.0, 1.0, 0.8], 1.0, 0.01, 3.2197539590990143),
        ([1.0, 1.0, 1.0, 1.2, 0.8], 3.0, 0.1, 0.11905084462320856),
        ([10.0, 10.0, 10.0, 1.2, 0.3], 1.0, 1.0, 0.15925099506602167),
    ],
)
def test_a_game_without_equilibrium_says_for_how_long_it_has_one(r, q_d, q_target, escape):
    """I2 with control weights r of d1…dn, target, attacker; the escape times are exact (Hamiltonian closed form)."""
    n = len(r) - 2
    evasion = {"evasion_running_weight": q_d, "evasion_terminal_weight": q_d, "capture_radius": 0.1}
    sc = tadcore.Scenario(
        interaction="I2",
        horizon=6.0,
        attacker={
            "position": (2, 2),
            "control_weight": r[-1],
            "capture_radius": 0.1,
            "target_running_weight": q_target,
            "target_terminal_weight": q_target,
        },
        target={"position": (0, 0), "control_weight": r[-2]},
        defenders=[{"position": (i, -1), "control_weight": w, **evasion} for i, w in enumerate(r[:n])],
    )
    for call in (
        tadcore.solve_equilibrium,
        tadcore.simulate,
        lambda s: tadcore.simulate_batch(s, [s.positions]),
        lambda s: tadcore.synthesize(s, step=0, adjacency=np.ones((n + 1, n + 1))),
    ):
        with pytest.raises(NoEquilibriumError) as caught:
            call(sc)
        assert caught.value.escape_time == pytest.approx(escape, rel=1e-9)
        assert caught.value.horizon == 6.0
        assert caught.value.step == 0.005
    longest = caught.value.longest_horizon
    assert tadcore.solve_equilibrium(sc.replace(horizon=longest)).times[-1] == pytest.approx(longest)
    with pytest.raises(NoEquilibriumError):
        tadcore.solve_equilibrium(sc.replace(horizon=longest + 0.005))


def test_runs_with_the_same_weights_share_one_game():
    from tadcore.game.compiled import game_of

    sc = tadcore.scenarios.load("paper-i1")
    assert game_of(sc) is game_of(tadcore.scenarios.load("paper-i1-full"))
    assert game_of(sc) is game_of(sc.replace({"attacker.position": (5, 5), "attacker.capture_radius": 1}))
    assert game_of(sc) is not game_of(tadcore.scenarios.load("paper-i1-suicidal"))
    assert game_of(sc) is not game_of(sc.replace(step=0.01))
    assert game_of(sc) is not game_of(sc.replace(horizon=3.0))
    assert game_of(sc) is not game_of(sc.replace(synthesis_weights=(1, 0, 0, 0)))
