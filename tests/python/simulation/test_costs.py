"""Costs of stiff steps, in which a player's control weight is tiny: beside decimal numbers and sums over modes."""

import json
import math

import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st

import tadcore
from oracle.stiff import exact_costs, modal_costs
from tadcore import Scenario, TadcoreError


def duel(interaction="I1", *, steps=1, horizon=1.0, evasion=0.0, **weights):
    """One defender; control weights by the name of the player."""
    r = {"attacker": 0.8, "target": 1.2, "defender": 1.0} | weights
    data = {
        "interaction": interaction,
        "horizon": horizon,
        "step": horizon / steps,
        "attacker": {"position": [-2.0, 0.3], "control_weight": r["attacker"], "capture_radius": 1e-9},
        "target": {"position": [2.0, 0.0], "control_weight": r["target"]},
        "defenders": [{"position": [0.5, 1.0], "control_weight": r["defender"], "capture_radius": 1e-9}],
    }
    if interaction == "I1":
        data["attacker"]["evasion"] = evasion
    return Scenario.model_validate(data)


STIFF = [
    duel(attacker=r, steps=steps, horizon=horizon)
    for r in (1.22e-9, 1.1e-9, 1e-9, 1e-7, 1e-5, 1e-3)
    for steps, horizon in [(1, 1.0), (3, 1.0), (2, 10.0)]
]
STIFF += [duel(defender=r, steps=2) for r in (1e-10, 1e-8, 1e-5)] + [duel(target=r, horizon=1e-5) for r in (1e-8, 1e-6)]
STIFF += [duel("I2", defender=r, steps=2, horizon=1e-2) for r in (1e-8, 1e-5)]


@pytest.mark.parametrize("sc", STIFF, ids=str)
def test_costs_of_stiff_steps_are_those_of_decimal_numbers(sc):
    run = tadcore.simulate(sc)
    exact = exact_costs(run)
    assert exact is not None, "its modes are not real: no case for this test"
    C = np.abs(run.gains[:-1]).sum() + 1.0 / min(sc.attacker.control_weight, sc.defenders[0].control_weight) ** 0.5
    for name, value in exact.items():
        assert run.costs[name] == pytest.approx(value, rel=1e-14 * (100.0 + C)), name


def test_a_stiff_run_writes_numbers(tmp_path):
    sc = duel(attacker=1e-9)
    run = tadcore.simulate(sc)
    assert run.costs == pytest.approx(exact_costs(run), rel=1e-9)
    run.save(tmp_path)
    text = (tmp_path / "summary.json").read_text(encoding="utf-8")
    assert json.loads(text, parse_constant=pytest.fail)["costs"] == run.costs


weights = st.floats(-10.0, 4.0).map(lambda x: 10.0**x)


def team_game(interaction, r, steps, horizon, evasion, seed):
    """Defenders drawn from a seed, with the control weights r; the last two are the target's and the attacker's."""
    rng = np.random.default_rng(seed)
    n = len(r) - 2
    sc = duel(interaction, steps=steps, horizon=horizon, evasion=evasion)
    team = [
        {
            "position": rng.normal(size=2).tolist(),
            "control_weight": weight,
            "capture_radius": 1e-6,
            "visibility_radius": float(rng.choice([0.5, 2.0, math.inf])),
        }
        for weight in r[:n]
    ]
    return sc.replace({"defenders": team, "target.control_weight": r[n], "attacker.control_weight": r[n + 1]})


EXPLODES = ("I1", [1.0, 1e-8, 1.0, 10**0.0625, 10**1.375])  # d2 flies 1e76 away in one step


def compare_with_modes(run):
    """Compare the costs of a run with sums over modes where those are known; which they are."""
    expected, doubt = modal_costs(run)
    known = [name for name in expected if doubt[name] < 1e-6 * abs(expected[name])]
    for name, value in run.costs.items():
        assert math.isfinite(value)
        if name in known:
            assert abs(value - expected[name]) <= 20.0 * doubt[name] + 1e-12 * abs(expected[name]), name
    return known


@settings(max_examples=100)
@example(*EXPLODES, 2, 1.0, 0.0, 43318343)
@given(
    st.sampled_from(["I1", "I2"]),
    st.lists(weights, min_size=3, max_size=6),
    st.integers(1, 4),
    st.floats(-4.0, 1.0).map(lambda x: 10.0**x),
    st.sampled_from([0.0, 0.5, 1.0]),
    st.integers(0, 2**32 - 1),
)
def test_costs_of_any_weights_are_sums_over_modes(interaction, r, steps, horizon, evasion, seed):
    sc = team_game(interaction, r, steps, horizon, evasion, seed)
    try:
        run = tadcore.simulate(sc)
    except TadcoreError:  # no equilibrium, too stiff for one, or beyond the range of doubles: said, not shown
        return
    compare_with_modes(run)


@pytest.mark.parametrize(("step", "rows"), [(0.5, 4), (0.52, 2)])
def test_a_diverged_game_that_ends_within_a_step_costs_what_its_record_does(step, rows):
    """At 0.52 a velocity leaves the range of a record two steps before the end: no row of it is cut at the crossing."""
    sc = team_game(*EXPLODES, 4, 4.0 * step, 0.0, 43318343)
    blind, everyone = np.zeros((3, 4), dtype=bool), np.ones((3, 4), dtype=bool)
    explodes = np.array([blind[0], [True, False, True, True], blind[0]])
    networks = [blind, explodes, everyone, everyone]
    run = tadcore.simulate(sc, network=lambda k, *_: networks[k], termination="continuous")
    assert run.outcome.kind == "intercepted"
    assert run.diverged is not None
    assert len(run.times) == rows
    assert 2.0 * step < run.outcome.time < 2.1 * step
    assert compare_with_modes(run) == ["defenders", "target", "attacker"]
