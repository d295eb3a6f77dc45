"""Weights many decades apart: P is right by a solution in decimal numbers, or refused by name."""

import numpy as np
import pytest

import tadcore
from oracle.taylor import taylor_P

STEPS = 20


def stiff_game(rng, span, n, horizon):
    """A game of I1 with weights log-uniform over ``span`` decades on either side of one."""

    def weight():
        return float(10 ** rng.uniform(-span, span))

    own = ("control_weight", "running_weight", "terminal_weight")
    fled = ("evasion_running_weight", "evasion_terminal_weight")
    attacker = ("control_weight", "target_running_weight", "target_terminal_weight")
    return tadcore.Scenario.model_validate(
        {
            "interaction": "I1",
            "horizon": horizon,
            "step": horizon / STEPS,
            "attacker": {"position": [-2.0, 2.0], "capture_radius": 0.1, **{k: weight() for k in attacker}},
            "target": {"position": [0.0, 1.0], **{k: weight() for k in own}},
            "defenders": [
                {"position": [float(i), 0.0], "capture_radius": 0.1, **{k: weight() for k in (*own, *fled)}}
                for i in range(n)
            ],
        }
    )


def test_ordinary_weights_agree_with_decimal_numbers():
    sc = tadcore.scenarios.load("paper-i1").replace({"horizon": 0.5, "step": 0.025})
    eq = tadcore.solve_equilibrium(sc)
    for P, k in zip(taylor_P(sc, [0.25, 0.5]), [10, 0], strict=True):
        for group, name in enumerate(eq.P):
            assert np.abs(P[group] - eq.P[name][k]).max() < 1e-11


@pytest.mark.parametrize("seed", [0, 3, 5, 7, 9, 10, 13, 21])
def test_weights_apart_are_solved_or_refused_by_name(seed):
    rng = np.random.default_rng([seed, 77])
    span, horizon = rng.choice([2.0, 3.0, 4.0]), rng.choice([1e-3, 0.1])
    sc = stiff_game(rng, span, 1, float(horizon))
    try:
        eq = tadcore.solve_equilibrium(sc)
    except tadcore.TadcoreError as error:
        refused = str(error)
    else:
        compare(sc, eq)
        return
    assert any(word in refused for word in ("too far apart", "no feedback", "integrator")), refused


def compare(sc, eq):
    """Five digits of every matrix, in a layer near the horizon too."""
    ks = [STEPS - 1, STEPS // 2, 0]
    for P, k in zip(taylor_P(sc, [sc.horizon * (STEPS - k) / STEPS for k in ks]), ks, strict=True):
        for group, name in enumerate(eq.P):
            assert np.linalg.norm(P[group] - eq.P[name][k]) < 1e-5 * np.linalg.norm(P[group]), (name, k)


def test_a_layer_that_amplifies_rounding_is_refused():
    """Three equal defenders came out unequal there, and P_a 400 times too small, with residuals of 1e-11."""
    sc = tadcore.scenarios.load("paper-i1")
    stiff = sc.replace({"attacker.control_weight": 1e-12, "horizon": 1e-6, "step": 1e-8})
    with pytest.raises(tadcore.TadcoreError, match="too far apart for double precision") as caught:
        tadcore.solve_equilibrium(stiff)
    assert not isinstance(caught.value, tadcore.NoEquilibriumError)
    with pytest.raises(tadcore.TadcoreError, match="too far apart"):
        tadcore.simulate(stiff)
