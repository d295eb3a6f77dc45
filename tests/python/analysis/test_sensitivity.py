"""Sobol' indices: against closed forms, and games that one input decides."""

import math

import numpy as np
import pytest
from scipy import stats

import tadcore
from study_cases import escaping
from tadcore import ScenarioError
from tadcore.analysis.sensitivities import sensitivity, sobol
from tadcore.sampling import Box, Choice, Disk
from tadcore.statistics.sobol import Joint

CUBE = {name: stats.uniform(-math.pi, 2 * math.pi) for name in ("x1", "x2", "x3")}


def ishigami(x):
    """The function of Ishigami and Homma (1990), whose indices are known, and one that never varies."""
    first = np.sin(x[0]) + 7 * np.sin(x[1]) ** 2 + 0.1 * x[2] ** 4 * np.sin(x[0])
    return np.array([first, np.full(x.shape[1], 3.0), x[0] + 2 * x[1]])


def test_the_indices_of_ishigami_s_function():
    a, b, pi = 7, 0.1, math.pi
    parts = 0.5 * (1 + b * pi**4 / 5) ** 2, a**2 / 8, 8 * b**2 * pi**8 / 225
    variance = sum(parts)
    found = sobol(ishigami, CUBE, ["ishigami", "constant", "linear"], points=4096, seed=1, resamples=200)
    assert found.variance[0] == pytest.approx(variance, rel=0.02)
    assert found.mean[0] == pytest.approx(a / 2, abs=0.02)
    assert found.first[0] == pytest.approx([parts[0] / variance, parts[1] / variance, 0], abs=0.02)
    total = [(parts[0] + parts[2]) / variance, parts[1] / variance, parts[2] / variance]
    assert found.total[0] == pytest.approx(total, abs=0.02)
    for low, high, truth in (
        (found.first_low[0], found.first_high[0], [parts[0] / variance, parts[1] / variance, 0]),
        (found.total_low[0], found.total_high[0], total),
    ):
        assert ((low <= truth) & (truth <= high)).all()
        assert (high - low < 0.2).all()
    assert np.isnan([found.first[1], found.total_low[1], found.first_high[1]]).all()
    assert found.first[2] == pytest.approx([0.2, 0.8, 0.0], abs=0.01)
    assert found.total[2] == pytest.approx([0.2, 0.8, 0.0], abs=0.01)
    assert found.evaluations == 5 * 4096
    assert found.to_pandas().loc[("ishigami", "x2"), "first"] == found.first[0, 1]


def test_an_indicator_of_one_input_is_that_input_s():
    found = sobol(lambda x: (x[:1] > 0) * 1.0, CUBE, ["event"], points=256, seed=3, resamples=100)
    assert found.mean[0] == pytest.approx(0.5, abs=0.02)
    assert found.total[0] == pytest.approx([1, 0, 0], abs=0.03)
    assert found.total[0, 1:].tolist() == [0.0, 0.0]


def test_the_bootstrap_covers():
    """In 60 repetitions with other seeds, 90 % intervals for S1 = 0.2 miss at most 10 % plus 3 standard errors."""
    missed = 0
    for seed in range(60):
        found = sobol(lambda x: x[:1] + 2 * x[1:2], CUBE, ["y"], points=64, seed=seed, level=0.9, resamples=100)
        missed += not found.first_low[0, 0] <= 0.2 <= found.first_high[0, 0]
    assert missed / 60 <= 0.1 + 3 * math.sqrt(0.09 / 60)


def test_a_seed_gives_the_same_indices():
    one, two, other = (
        sobol(ishigami, CUBE, ["a", "b", "c"], points=64, seed=seed, resamples=50).to_pandas() for seed in (1, 1, 2)
    )
    assert one.equals(two)
    assert not one.equals(other)


def test_a_game_that_one_input_decides():
    """A defender on top of the attacker's start wins or not by its reach alone, whatever the others do far away."""
    sc = tadcore.scenarios.load("paper-i1").replace(
        {"defenders[0].position": (-2.0, 2.3), "defenders[0].visibility_radius": 5.0, "horizon": 0.5}
    )
    inputs = {
        "defenders.0.capture_radius": stats.uniform(0.01, 0.6),  # 0.3 away: half of the draws end the game at once
        "target.position.x": stats.norm(60.0, 0.1),
    }
    found = sensitivity(sc, inputs, points=64, seed=5, outputs=("d1", "captured"), resamples=50)
    assert found.inputs == tuple(inputs)
    assert found.outputs == ("d1", "captured")
    assert 0.2 < found.mean[0] < 0.999
    assert found.total[0, 0] == pytest.approx(1.0, abs=0.25)
    assert found.total[0, 1] == pytest.approx(0.0, abs=0.05)
    assert np.isnan(found.total[1]).all()
    assert repr(found).splitlines()[0] == "256 evaluations"


def test_games_at_the_points_are_the_games(monkeypatch):
    """What the indices are computed from is the outcome of each point, played alone."""
    sc = tadcore.scenarios.load("paper-i1")
    inputs = {"attacker.position.x": stats.uniform(-3, 3), "defenders.1.visibility_radius": stats.uniform(0.5, 2)}
    seen = {}

    def watch(function, names, outputs, **options):
        x = np.array([[-2.0, -1.0, -2.5], [2.25, 0.6, 1.7]])
        seen["x"], seen["y"] = x, function(x)
        return sobol(function, names, outputs, **options)

    monkeypatch.setattr("tadcore.analysis.sensitivities.sobol", watch)
    found = sensitivity(sc, inputs, points=8, resamples=5)
    assert found.first.shape == (3, 2)
    for i, (x, radius) in enumerate(seen["x"].T):
        run = tadcore.simulate(
            sc.replace({"attacker.position": (x, sc.attacker.position[1]), "defenders[1].visibility_radius": radius})
        )
        kind = run.outcome.kind
        assert seen["y"][:, i].tolist() == [kind == "intercepted", kind == "captured", run.outcome.time]


@pytest.mark.parametrize(
    ("options", "name"),
    [
        ({"points": 100}, "points"),
        ({"points": 1}, "points"),
        ({"level": 2}, "level"),
        ({"resamples": 0}, "resamples"),
        ({"seed": -1}, "seed"),
        ({"outputs": ["escaped"]}, "outputs"),
        ({"outputs": []}, "outputs"),
        ({"inputs": {}}, "inputs"),
        ({"inputs": {"interaction": stats.norm()}}, "input"),
        ({"inputs": {"attacker.position.x": 3.0}}, "inputs['attacker.position.x']"),
    ],
)
def test_what_makes_no_sense_is_refused(options, name):
    sc = tadcore.scenarios.load("paper-i1")
    inputs = options.pop("inputs", {"attacker.position.x": stats.norm(-2, 0.1)})
    with pytest.raises(ScenarioError) as caught:
        sensitivity(sc, inputs, **options)
    assert caught.value.field == name


def test_the_samplers_of_a_study_and_positions_as_a_whole():
    """A position is one input; with only it and a radius that does not matter varying, it explains everything."""
    sc = tadcore.scenarios.load("paper-i1").replace({"horizon": 1.0, "step": 0.05})
    study = tadcore.Study(
        sc, {"attacker.position": Disk([0, 1], 2.0), "d1.visibility_radius": Box(50.0, 60.0)}, trials=1
    )
    found = sensitivity(study.scenario, study.vary, points=256, outputs=["intercepted", "time"], resamples=50)
    same = sensitivity(study, points=256, outputs=["intercepted", "time"], resamples=50)
    assert repr(same) == repr(found)
    assert np.array_equal(same.total, found.total)
    with pytest.raises(ScenarioError, match="left out: a study brings what it varies"):
        sensitivity(study, study.vary)
    with pytest.raises(ScenarioError, match="inputs: got nothing, must be a mapping of names"):
        sensitivity(study.scenario)
    assert found.inputs == ("attacker.position", "defenders.0.visibility_radius")
    assert found.total[0, 1] == pytest.approx(0.0, abs=1e-12)
    assert found.first[0, 0] == pytest.approx(1.0, abs=0.1)
    axes = {f"attacker.position.{axis}": Box(-2.0, 3.0) for axis in "xy"}
    by_axis = sensitivity(sc, axes, points=256, outputs=["time"], resamples=50)
    same = sensitivity(sc, {name: stats.uniform(-2, 5) for name in axes}, points=256, outputs=["time"], resamples=50)
    assert by_axis.first.tolist() == same.first.tolist()


def test_joint_inputs_of_a_function_that_is_known():
    """Y = X₁ + X₂ + 2 X₃ with X₁ and X₂ drawn together: 2/6 and 4/6."""
    pair = Joint(2, lambda points: points - 0.5)
    found = sobol(lambda x: x[:1] + x[1:2] + 2 * x[2:], {"pair": pair, "one": stats.uniform(0, 1)}, ["y"], points=4096)
    assert found.first[0] == pytest.approx([1 / 3, 2 / 3], abs=0.01)
    assert found.total[0] == pytest.approx([1 / 3, 2 / 3], abs=0.01)


def test_weights_decide_too():
    """A game whose horizon decides whether there is an equilibrium, and with it everything."""
    sc = escaping(3.0)
    inputs = {"horizon": Choice([2.0, 4.0]), "attacker.target_running_weight": Box(0.0099, 0.0101)}
    inputs["target.control_weight"] = stats.uniform(0.99, 0.02)
    found = sensitivity(sc, inputs, points=128, outputs=["no_equilibrium"], resamples=50)
    assert found.mean[0] == pytest.approx(0.5, abs=0.05)
    assert found.total[0, 0] == pytest.approx(1.0, abs=0.1)
    with pytest.raises(ScenarioError, match="a sampler with quantiles"):
        sensitivity(sc, {"target.position": lambda rng, size: rng.normal(size=(size, 2))}, points=4)
