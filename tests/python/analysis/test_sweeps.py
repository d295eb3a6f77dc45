"""Sweeps: every cell is the study of its scenario, with common draws; cells without an equilibrium do not stop them."""

import numpy as np
import pytest

import tadcore
from study_cases import CHUNK, ESCAPE, escaping, part, parts, study
from tadcore import ScenarioError, Study, sweep
from tadcore.sampling import Box
from tadcore.statistics import proportion_interval
from tadcore.study.plan import Plan


def test_every_cell_is_the_study_of_its_scenario():
    base = study(400)
    grid = {"attacker.control_weight": [0.8, 1.2], "horizon": [0.5, 1.0, 1.5]}
    swept = sweep(base, grid, threads=1)
    assert swept.shape == (2, 3)
    data = swept.to_xarray()
    assert dict(data.sizes) == {"attacker.control_weight": 2, "horizon": 3, "outcome": 3}
    for i, weight in enumerate(grid["attacker.control_weight"]):
        for j, horizon in enumerate(grid["horizon"]):
            sc = base.scenario.replace({"attacker.control_weight": weight, "horizon": horizon})
            alone = Study(sc, base.vary, trials=400, seed=7).run()
            cell = swept.cells[3 * i + j]
            assert cell.values == {"attacker.control_weight": weight, "horizon": horizon}
            assert cell.result.table.equals(alone.table)
            at = data.sel({"attacker.control_weight": weight, "horizon": horizon})
            assert {str(k): int(v) for k, v in zip(at["outcome"].values, at["count"], strict=True)} == alone.counts()
            assert float(at["probability"].sum()) == pytest.approx(1.0)
            ends = proportion_interval(at["count"].values, 400)
            assert np.array_equal((at["low"].values, at["high"].values), ends)
            band = proportion_interval(at["count"].values, 400, level=1 - 0.05 / 6, method="exact")
            assert np.array_equal((at["band_low"].values, at["band_high"].values), band)
            for kind, mean in enumerate(at["mean_time"].values):
                times = alone.time[alone.kind == kind]
                assert np.isnan(mean) if not len(times) else mean == pytest.approx(times.mean())
            assert float(at["mean_end"]) == pytest.approx(alone.time.mean())
            assert (int(at["trials"]), str(at["status"].values)) == (400, "done")
    assert np.isnan(data["escape_time"]).all()
    assert tadcore.Scenario.from_toml_string(data.attrs["scenario"]) == base.scenario
    assert (data.attrs["seed"], data.attrs["design"]) == ("7", "random")
    first, *others = (cell.result.inputs for cell in swept.cells)
    assert all(np.array_equal(first[name], other[name]) for other in others for name in first)
    assert len({tuple(cell.result.counts().items()) for cell in swept.cells}) > 3


def test_a_cell_without_equilibrium_is_a_result():
    base = Study(escaping(1.0), {"attacker.position": Box([1, 1], [3, 3])}, trials=100)
    swept = sweep(base, {"horizon": [2.0, 3.0, 3.5, 4.0]})
    data = swept.to_xarray()
    assert data["status"].values.tolist() == ["done"] * 2 + ["no equilibrium"] * 2
    assert data["escape_time"].values[2:] == pytest.approx([ESCAPE] * 2, rel=1e-9)
    assert np.isnan(data["escape_time"].values[:2]).all()
    assert data["trials"].values.tolist() == [100, 100, 0, 0]
    assert np.isnan([data[name].values[2:] for name in ("probability", "low", "high", "band_low")]).all()
    assert swept.cells[2].result is None
    lost = [int(cell.result.diverged.sum()) for cell in swept.cells if cell.result]
    assert repr(swept) == f"SweepResult(horizon (4); 2 without equilibrium; {sum(lost)} games diverged)"


def test_wildcards_radii_and_vectors_can_be_swept():
    base = study(60, vary={"attacker.position": Box([-1, 0], [1, 2])})
    swept = sweep(base, {"defenders.*.capture_radius": [0.1, 0.3], "synthesis_weights": [(1, 0, 0, 0), (0, 0, 0, 1)]})
    assert [d.capture_radius for d in swept.cells[2].study.scenario.defenders] == [0.3] * 3
    data = swept.to_xarray()
    assert data.coords["synthesis_weights"].values.tolist() == ["(1, 0, 0, 0)", "(0, 0, 0, 1)"]
    caught = data["count"].sel(outcome="intercepted").values
    assert (caught[1] > caught[0]).all()  # wider capture, more interceptions
    array = sweep(base, {"defenders[1].control_weight": np.array([1.0, 2.0])})
    assert array.to_xarray()["defenders.1.control_weight"].values.tolist() == [1.0, 2.0]


def test_a_store_holds_every_cell_and_grows_with_the_grid(tmp_path, monkeypatch):
    base = study(CHUNK + 10)
    first = sweep(base, {"horizon": [0.5, 1.0]}, store=tmp_path)
    folders = sorted(path.name for path in tmp_path.iterdir())
    assert [name.rpartition("-")[0] for name in folders] == ["horizon=0.5", "horizon=1.0"]
    assert list(parts(tmp_path / folders[0])) == [part(0, CHUNK + 10)]
    assert tadcore.load_study(tmp_path / folders[1]).table.equals(first.cells[1].result.table)
    played = []
    real = Plan.play
    monkeypatch.setattr(Plan, "play", lambda plan, *a: played.append(plan.scenario.horizon) or real(plan, *a))
    second = sweep(base, {"horizon": [1.0, 0.25, 0.5]}, store=tmp_path)
    assert set(played) == {0.25}
    assert second.cells[2].result.table.equals(first.cells[0].result.table)


@pytest.mark.parametrize(
    ("grid", "words"),
    [
        ({}, "grid: .* a mapping"),
        ([], "grid: .* a mapping"),
        ({"horizon": []}, "at least one value"),
        ({"horizon": 1.0}, "at least one value"),
        ({"horizon": "12"}, "at least one value"),
        ({"horizon": [1.0, -1.0]}, "horizon: got -1.0, must be a positive"),
        ({"step": [0.05, 0.3]}, "step: got 0.3, must be a divisor"),
        ({"horizons": [1.0]}, "horizons"),
        ({"attacker.weight": [1.0]}, "attacker.weight"),
        ({"defenders.3.control_weight": [1.0]}, "which has 3 defenders, d1 to d3"),
        ({"attacker.position": [(0, 0)]}, "a field that the study does not vary"),
        ({"*.visibility_radius": [1.0]}, "a field that the study does not vary"),
        ({"defenders.*.control_weight": [1.0], "defenders.0.control_weight": [2.0]}, "swept once only"),
        ({3: [1.0]}, "a path such as attacker"),
    ],
)
def test_a_grid_that_cannot_be_swept_is_refused_before_any_cell_runs(grid, words, monkeypatch):
    monkeypatch.setattr(Study, "run", lambda *_, **__: pytest.fail("a cell was run"))
    with pytest.raises(ScenarioError, match=words):
        sweep(study(10), grid)


def test_the_draws_of_every_cell_are_checked_before_any_runs(monkeypatch, tmp_path):
    base = study(3 * CHUNK, vary={"d1.visibility_radius": Box(0.5, 4.0)})
    smallest = float(base.inputs()["defenders.0.visibility_radius"].min())
    monkeypatch.setattr("tadcore.study.plan.Plan.play", lambda *_, **__: pytest.fail("a game was played"))
    with pytest.raises(ScenarioError, match=rf"trial [\d,]+: got .* capture radius, {smallest!r}") as caught:
        sweep(base, {"d1.capture_radius": [0.1, 0.2, smallest]}, store=tmp_path / "store")
    assert caught.value.__notes__ == [f"(in the cell defenders.0.capture_radius = {smallest!r})"]
    assert not (tmp_path / "store").exists()


@pytest.mark.parametrize("keep", ["all", "outcomes", "counts"])
def test_what_a_study_keeps_does_not_change_a_sweep(keep):
    grid = {"attacker.control_weight": [0.8, 1.2]}
    whole, found = (sweep(study(300, keep=way), grid).to_xarray() for way in ("all", keep))
    assert found["count"].equals(whole["count"])
    assert found["probability"].equals(whole["probability"])
    assert np.allclose(found["mean_time"], whole["mean_time"], rtol=1e-12, equal_nan=True)
    assert np.allclose(found["mean_end"], whole["mean_end"], rtol=1e-12)


def test_games_of_their_own_are_swept_too():
    """In each cell some horizons have no equilibrium, and are an outcome."""
    base = Study(escaping(3.0), {"horizon": [2.0, 4.0]}, trials=40, seed=1)
    data = sweep(base, {"attacker.capture_radius": [0.1, 0.2]}).to_xarray()
    lost = int((base.inputs()["horizon"] > ESCAPE).sum())
    assert data["count"].sel(outcome="no_equilibrium").values.tolist() == [lost, lost]
    assert data["count"].sum("outcome").values.tolist() == [40, 40]


def test_values_are_shown_without_the_noise_of_their_last_bits():
    shown = sweep(study(20), {"attacker.control_weight": [0.1 + 0.2, 1.0]})._repr_html_()
    assert "0.3" in shown
    assert "0.30000000000000004" not in shown
