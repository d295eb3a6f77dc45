"""Costs of stiff steps, in which a player's control weight is tiny: beside decimal numbers."""

import json
import math

import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st

import tadcore
from oracle.stiff import decimal_costs, exact_costs
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
    _, added = decimal_costs(run)
    for name, value in exact.items():
        assert abs(run.costs[name] - value) <= 3e-16 * abs(value) + 2e-15 * added[name], name


def test_a_stiff_run_writes_numbers(tmp_path):
    sc = duel(attacker=1e-9)
    run = tadcore.simulate(sc)
    assert run.costs == pytest.approx(exact_costs(run), rel=1e-9)
    run.save(tmp_path)
    text = (tmp_path / "summary.json").read_text(encoding="utf-8")
    assert json.loads(text, parse_constant=pytest.fail)["costs"] == run.costs


weights = st.one_of(st.floats(-10.0, 4.0), st.floats(-3.0, 1.0)).map(lambda x: 10.0**x)


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
# Grows to 1,800 times its size; parts of 1e6 times the running cost cancel.
CANCELS = ("I2", [1.0, 1.0, 1.0, 1.0, 0.001, 0.001])


def compare(run, rel=3e-16):
    """Compare the costs of a run with decimal numbers; rel is of the cost, 2e-15 of what adds up in doubles."""
    exact, added = decimal_costs(run)
    for name, value in run.costs.items():
        assert abs(value - exact[name]) <= rel * abs(exact[name]) + 2e-15 * added[name], name


@settings(max_examples=400)
@example(*EXPLODES, 2, 1.0, 0.0, 43318343)
@example(*CANCELS, 3, 1.0, 0.0, 3)
@given(
    st.sampled_from(["I1", "I2"]),
    st.lists(weights, min_size=3, max_size=6),
    st.integers(1, 6),
    st.floats(-2.0, 1.0).map(lambda x: 10.0**x),
    st.sampled_from([0.0, 0.5, 1.0]),
    st.integers(0, 2**32 - 1),
)
def test_costs_of_any_weights_are_those_of_decimal_numbers(interaction, r, steps, horizon, evasion, seed):
    sc = team_game(interaction, r, steps, horizon, evasion, seed)
    try:
        run = tadcore.simulate(sc)
    except TadcoreError:  # no equilibrium, too stiff for one, or beyond the range of doubles: said, not shown
        return
    compare(run)


@pytest.mark.parametrize(("game", "steps", "seed"), [(EXPLODES, 2, 43318343), (CANCELS, 3, 3)])
def test_decimal_numbers_have_digits_to_spare(game, steps, seed):
    run = tadcore.simulate(team_game(*game, steps, 1.0, 0.0, seed))
    assert run.diverged is not None
    assert decimal_costs(run, 120) == decimal_costs(run, 300)


@pytest.mark.parametrize("sc", STIFF[::4], ids=str)
def test_modes_and_gramians_give_the_same_decimal_numbers(sc):
    run = tadcore.simulate(sc)
    assert decimal_costs(run)[0] == pytest.approx(exact_costs(run), rel=3e-16)


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
    compare(run, 1e-12)  # the last step is a difference of times
