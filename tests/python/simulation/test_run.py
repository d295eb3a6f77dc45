"""A run as Python shows it: record, network changes, dataset, files, repr."""

import json
import pickle

import numpy as np
import pytest
import xarray as xr

import tadcore
from tadcore import Outcome, Scenario, VisibilityNetwork


@pytest.fixture(scope="module")
def run():
    return tadcore.simulate(tadcore.scenarios.load("paper-i1"))


@pytest.fixture(scope="module")
def team_run():
    return tadcore.simulate(tadcore.scenarios.load("paper-i2"))


def test_the_paper_to_the_digit(run):
    assert run.outcome.kind == "intercepted"
    assert run.outcome.defender == 0
    assert run.outcome.time == pytest.approx(1.395, abs=1e-9)
    assert str(run.outcome) == "d1 intercepts the attacker at t = 1.395"
    changes = run.network_changes
    assert [c.time for c in changes] == pytest.approx([0, 0.16, 0.49, 0.575, 0.915, 0.96], abs=1e-9)
    assert changes[0].added == VisibilityNetwork.from_positions(run.scenario).edges()
    assert [(c.added, c.removed) for c in changes[1:]] == [
        ((("d2", "d3"),), ()),
        ((("d2", "attacker"),), ()),
        ((("d3", "target"),), ()),
        ((("d3", "d2"),), ()),
        ((("d3", "attacker"),), ()),
    ]
    assert repr(run) == "Run(I1: d1 intercepts the attacker at t = 1.395; 5 network changes)"


def test_the_record_and_the_dataset_are_the_same(run):
    data, sc = run.dataset, run.scenario
    assert dict(data.sizes) == {"time": 280, "player": 5, "axis": 2, "term": 4, "observer": 3, "entry": 4, "seen": 5}
    assert list(data.player.values) == ["d1", "d2", "d3", "target", "attacker"]
    assert np.array_equal(data.position.sel(time=0.0), sc.positions)
    assert np.array_equal(data.position.values, run.position)
    assert data.time.values[-1] == run.outcome.time
    assert data.distance.sel(player="d1").values[-1] <= 0.1 < data.distance.sel(player="d1").values[-2]
    assert not data.distance.sel(player="attacker").any()
    assert np.allclose(data.theta_terms @ xr.DataArray([0.25] * 4, dims="term"), data.theta, rtol=1e-12, atol=1e-25)
    assert data.adjacency.dtype == bool
    for name in data.data_vars:
        assert data[name].attrs["units"] == "1"
        assert data[name].attrs["long_name"]
    assert data.attrs["tadcore_version"] == tadcore.__version__
    assert Scenario.from_toml_string(data.attrs["scenario"]) == sc
    assert run.dataset is data


def test_controls_are_the_velocity_of_the_frozen_loop(run):
    """u = G z at every instant, for the gains and the equilibrium rows in force there."""
    eq = tadcore.solve_equilibrium(run.scenario)
    z = run.position[:, :4] - run.position[:, 4:]
    for k in (0, 50, 200, len(run.times) - 1):
        assert np.allclose(run.control[k, :3], run.gains[k] @ z[k], rtol=1e-12, atol=1e-14)
        for player, i in (("target", 3), ("attacker", 4)):
            assert np.allclose(run.control[k, i], eq.feedback[player][k] @ z[k], rtol=1e-12, atol=1e-14)
    velocity = np.diff(run.position[:5], axis=0) / 0.005
    assert np.allclose(velocity, run.control[:4], rtol=0.05, atol=0.02)


def test_the_terminal_row_keeps_the_last_network(run):
    assert np.array_equal(run.adjacency[-1], run.adjacency[-2])
    last = run.intervals()[-1]
    assert (last.start, last.end) == (pytest.approx(0.96), run.outcome.time)
    assert set(last.edges) == set(VisibilityNetwork(run.adjacency[-1]).edges())
    assert len(run.intervals()) == len(run.network_changes)


def test_every_recorded_network_follows_from_the_positions(team_run):
    for k in range(0, len(team_run.times) - 1, 25):
        net = VisibilityNetwork.from_positions(team_run.scenario, team_run.position[k])
        assert np.array_equal(net.adjacency, team_run.adjacency[k])


def test_the_team_of_i2(team_run):
    assert list(team_run.costs) == ["team"]
    assert list(team_run.dataset.term.values) == ["dQ", "S2", "S3"]
    assert list(team_run.dataset.observer.values) == ["d1", "d2", "d3", "target"]
    assert [c.time for c in team_run.network_changes] == pytest.approx([0, 0.5, 1.005, 1.055, 1.31], abs=1e-9)
    assert team_run.outcome == Outcome("intercepted", 0, team_run.outcome.time)
    assert team_run.outcome.time == pytest.approx(3.54, abs=1e-9)


def test_costs_are_those_of_the_objectives(run):
    """Eq. fullobj by the trapezoidal rule on the record."""
    sc, end = run.scenario, run.position[-1]
    z = np.sum((run.position[:, :4] - run.position[:, 4:]) ** 2, axis=-1)
    u = np.sum(run.control**2, axis=-1)
    last = np.sum((end[:4] - end[4]) ** 2, axis=-1)
    state = {"defenders": [1, 1, 1, 0], "target": [0, 0, 0, -1], "attacker": [-1, -1, -1, 1]}
    effort = {"defenders": [1, 1, 1, 0, 0], "target": [0, 0, 0, 1.2, 0], "attacker": [0, 0, 0, 0, 0.8]}
    assert sc.attacker.control_weight == 0.8
    for group, weights in state.items():
        running = z @ weights + u @ effort[group]
        area = np.sum((running[1:] + running[:-1]) / 2 * np.diff(run.times))
        expected = 0.5 * (area + last @ weights)
        assert run.costs[group] == pytest.approx(expected, rel=5e-3)


def test_files_are_written_whole_and_read_back(run, tmp_path):
    folder = tmp_path / "a" / "b"
    run.save(folder)
    run.save(folder)
    assert sorted(p.name for p in folder.iterdir()) == ["run.nc", "scenario.toml", "summary.json"]
    with xr.open_dataset(folder / "run.nc", engine="scipy") as data:
        xr.testing.assert_identical(data.load(), run.dataset)
    assert Scenario.from_toml(folder / "scenario.toml") == run.scenario
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert summary["outcome"] == {
        "kind": "intercepted",
        "defender": 0,
        "time": run.outcome.time,
        "text": "d1 intercepts the attacker at t = 1.395",
    }
    assert summary["network_changes"][1]["added"] == ["d2->d3"]
    assert summary["converged"] is True


def test_a_run_can_be_pickled(run):
    again = pickle.loads(pickle.dumps(run))
    assert repr(again) == repr(run)
    assert np.array_equal(again.position, run.position)


def test_a_run_converges_and_says_so(run):
    assert run.converged
    assert run.unconverged == 0
    assert run.iterations > 0
    assert 0 < run.certified <= len(run.times)


@pytest.mark.parametrize(
    ("change", "outcome"),
    [
        ({"defenders[1].position": (-2, 2)}, "d2 intercepts the attacker at t = 0"),
        ({"target.position": (-2, 2)}, "the attacker captures the target at t = 0"),
        ({"target.position": (-2, 2), "defenders[2].position": (-2, 2)}, "d3 intercepts the attacker at t = 0"),
    ],
)
def test_a_game_that_is_over_at_the_start(change, outcome):
    run = tadcore.simulate(tadcore.scenarios.load("paper-i1").replace(change))
    assert str(run.outcome) == outcome
    assert run.times.tolist() == [0.0]
    assert run.network_changes == ()
    assert run.intervals() == ()
    assert run.dataset.sizes["time"] == 1


def test_a_game_that_no_one_ends():
    run = tadcore.simulate(tadcore.scenarios.load("paper-i1").replace(horizon=0.5))
    assert run.outcome == Outcome("timeout", None, 0.5)
    assert str(run.outcome) == "time runs out at t = 0.5"
    assert len(run.times) == 101


def test_one_defender_in_space():
    sc = Scenario(
        interaction="I2",
        horizon=1.0,
        step=0.01,
        attacker={"position": (2, 2, 2), "control_weight": 1, "capture_radius": 0.1},
        target={"position": (0, 0, 0), "control_weight": 2, "visibility_radius": 3},
        defenders=[{"position": (1, 0, 0), "control_weight": 1, "capture_radius": 0.1}],
    )
    run = tadcore.simulate(sc)
    assert list(run.dataset.axis.values) == ["x", "y", "z"]
    assert run.adjacency.shape[1:] == (2, 2)
