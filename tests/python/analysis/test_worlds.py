"""Studies and analyses of games with failures, reports and disturbances: one set of draws, or a refusal by name."""

import numpy as np
import pytest
from scipy import stats

import tadcore
from tadcore import ScenarioError
from tadcore.sampling import Disk

PLAIN = tadcore.scenarios.load("paper-i1").replace({"step": 0.02, "horizon": 3.0})
RANDOM = PLAIN.replace(
    {
        "sensing": {"mean_time_to_failure": 0.4, "mean_time_to_repair": 0.3},
        "communication": {"radius": 1.0, "mean_time_up": 0.5, "mean_time_down": 0.5},
        "*.disturbance": 0.1,
    }
)
VARY = {"attacker.position": Disk([-2, 2], 1.0)}
STUDY = tadcore.Study(RANDOM, VARY, trials=120, seed=5)


def test_a_study_of_one_start_varies_nothing(tmp_path):
    study = tadcore.Study(RANDOM, {}, trials=60, seed=5)
    assert study.columns == ()
    assert "from one start" in repr(study)
    result = study.run(store=tmp_path / "store")
    assert len(set(result.time.tolist())) > 20
    assert result.inputs == {}
    assert result.setup(7) == RANDOM
    assert result.replay(7).outcome.time == result.time[7]
    back = tadcore.load_study(tmp_path / "store")
    assert np.array_equal(back.time, result.time)
    longer = study.replace(trials=9000).run(store=tmp_path / "store")
    assert np.array_equal(longer.time[:60], result.time)
    assert result.probabilities().estimate.sum() > 0
    for sc in (PLAIN, PLAIN.replace({"communication.radius": 1.0})):  # nothing is left to chance
        with pytest.raises(ScenarioError, match="vary"):
            tadcore.Study(sc, {}, trials=2)


def test_chunks_and_processes_share_one_numbering():
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    study = tadcore.Study(RANDOM, {}, trials=8200, seed=3)
    result = study.run()
    assert result.replay(8195).outcome.time == result.time[8195]
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        assert np.array_equal(study.run(executor=pool).time, result.time)


def test_a_study_file_of_a_random_scenario_needs_no_vary(tmp_path):
    RANDOM.to_toml(tmp_path / "random.toml")
    PLAIN.to_toml(tmp_path / "plain.toml")
    study = tadcore.Study.from_toml_string('scenario = "random.toml"\ntrials = 3\nseed = 5\n', folder=tmp_path)
    assert np.array_equal(study.run().time, tadcore.Study(RANDOM, {}, trials=3, seed=5).run().time)
    with pytest.raises(ScenarioError, match=r"^vary: got nothing"):
        tadcore.Study.from_toml_string('scenario = "plain.toml"\ntrials = 3\n', folder=tmp_path)
    with pytest.raises(ScenarioError, match=r"none\.toml"):
        tadcore.Study.from_toml_string('scenario = "none.toml"\ntrials = 3\n', folder=tmp_path)


def test_a_store_knows_its_world(tmp_path):
    STUDY.run(store=tmp_path / "store")
    other = STUDY.replace(sc=RANDOM.replace({"communication.radius": 1.1}))
    with pytest.raises(tadcore.StoreError, match="its scenario differ"):
        other.run(store=tmp_path / "store")


def test_two_studies_share_their_draws_and_are_paired():
    quiet = STUDY.replace(sc=RANDOM.replace({"d2.visibility_radius": 2.3})).run()
    result = STUDY.run()
    paired = result.compare(quiet)
    assert 0 < len(paired.flipped) + np.count_nonzero(result.time != quiet.time) < 120
    apart = STUDY.replace(seed=6).run()
    assert np.count_nonzero(result.time == quiet.time) > 3 * np.count_nonzero(result.time == apart.time)
    same = [result.replay(4), quiet.replay(4)]
    rows = slice(min(len(run.times) for run in same) - 1)
    assert np.array_equal(*(run.course.sensor_up[rows] for run in same))
    assert np.array_equal(*(run.course.displacement[rows] for run in same))


def test_a_sweep_takes_the_paths_of_worlds():
    swept = tadcore.sweep(
        STUDY.replace(trials=30), {"communication.relays": [0, None], "sensing.mean_time_to_failure": [0.4, np.inf]}
    )
    data = swept.to_xarray()
    assert data.sizes["communication.relays"] == data.sizes["sensing.mean_time_to_failure"] == 2
    cell = next(
        c for c in swept.cells if c.values == {"communication.relays": None, "sensing.mean_time_to_failure": 0.4}
    )
    assert np.array_equal(cell.result.time, STUDY.replace(trials=30).run().time)


def test_a_radius_curve_plays_the_trials_of_its_study():
    curve = tadcore.radius_curve(STUDY, player="d1", radii=[1.0, float(PLAIN.visibility_radii[0])])
    result = STUDY.run()
    assert np.array_equal(curve.kind[1], result.kind)
    with pytest.raises(ScenarioError, match=r"scenario: got 'a random game', must be .*refine"):
        tadcore.radius_curve(STUDY, player="d1", radii=[1.0, 2.0], refine=True)
    with pytest.raises(ScenarioError, match="seed"):
        tadcore.radius_curve(STUDY, player="d1", radii=[1.0], seed=3)
    starts = np.repeat(RANDOM.positions[None], 40, axis=0)
    by_seed = [tadcore.radius_curve(RANDOM, starts, player="d1", radii=[2.0], seed=s).kind[0] for s in (1, 1, 2)]
    assert np.array_equal(by_seed[0], by_seed[1])
    assert not np.array_equal(by_seed[0], by_seed[2])


def test_a_probability_map_plays_the_same_trials_at_every_place():
    own = RANDOM.defenders[2].position
    found = tadcore.probability_map(STUDY, "d3", x=(own[0], own[0] + 1, 2), y=(own[1], own[1], 1))
    counts = STUDY.run().counts()
    here = found.dataset["count"].isel(x=0, y=0)
    assert {k: int(here.sel(outcome=k)) for k in ("timeout", "captured", "intercepted")} == {
        k: counts.get(k, 0) for k in ("timeout", "captured", "intercepted")
    }
    fixed = tadcore.probability_map(tadcore.Study(RANDOM, {}, trials=20), "attacker", x=(-2, 0, 2), y=(0, 2, 2))
    assert fixed.trials == 20


def test_what_is_of_one_outcome_for_each_start_is_refused_by_name():
    for call, word in (
        (lambda: tadcore.outcome_map(RANDOM, x=(0, 1, 2), y=(0, 1, 2)), "probability_map"),
        (lambda: tadcore.analysis.sensitivity(RANDOM, {"attacker.position.x": stats.uniform(-2, 1)}), "Sobol"),
    ):
        with pytest.raises(ScenarioError, match=rf"scenario: got 'a random game'.*{word}"):
            call()
    links = PLAIN.replace({"communication.radius": 2.0})
    found = tadcore.outcome_map(links, x=(-2, -2, 1), y=(2, 2, 1))
    assert found.dataset["time"].item() == tadcore.simulate(links).outcome.time
    with pytest.raises(ScenarioError, match=r'tadcore.sweep\(study, \{"disturbance.attacker"'):
        tadcore.Study(RANDOM, {"disturbance.attacker": stats.uniform(0, 1)}, trials=2)


def test_the_share_of_the_start():
    study = STUDY.replace(trials=400)
    found = tadcore.analysis.start_share(study)
    rows = study.inputs()
    positions = np.repeat(RANDOM.positions[None], 400, axis=0)
    positions[:, -1] = np.stack([rows["attacker.position.x"], rows["attacker.position.y"]], axis=1)
    ended = [
        tadcore.simulate_batch(RANDOM, positions, seed=5, first_trial=first).kind == tadcore.OutcomeKind.INTERCEPTED
        for first in (0, 2**48)
    ]
    assert np.array_equal(ended[0], study.run().kind == tadcore.OutcomeKind.INTERCEPTED)
    assert (found.both, found.none) == (np.sum(ended[0] & ended[1]), np.sum(~ended[0] & ~ended[1]))
    assert found.share == pytest.approx(np.corrcoef(ended)[0, 1], abs=0.02)
    for bad, word in (
        (tadcore.Study(RANDOM, {}, trials=4), "nothing to split"),
        (tadcore.Study(PLAIN, VARY, trials=4), "nothing to split"),
        (STUDY.replace(design="sobol"), "independent"),
        (RANDOM, "a tadcore.Study"),
    ):
        with pytest.raises(ScenarioError, match=word):
            tadcore.analysis.start_share(bad)
    with pytest.raises(ScenarioError, match="outcome"):
        tadcore.analysis.start_share(study, outcome="d9")
