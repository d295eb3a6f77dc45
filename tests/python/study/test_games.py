"""Studies whose trials are games of their own: weights, λ, γ, horizon and step vary, and some have no equilibrium."""

import math

import numpy as np
import pytest

import tadcore
from study_cases import CHUNK, ESCAPE, calm, calm_team, escaping
from tadcore import NoEquilibriumError, ScenarioError, Study
from tadcore.sampling import Box, Choice, Disk
from tadcore.scenario.numbers import GAMMA, SINGLE, game_quantities_of, games_of, numbers_of
from tadcore.statistics.outcomes import excluding

VARY = {
    "attacker.position": Disk([0, 1], 2.0),
    "d1.visibility_radius": Box(0.5, 4.0),
    "attacker.control_weight": Box(0.6, 1.4),
    "d*.running_weight": Box(0.5, 2.0),
    "attacker.evasion": Box(0.0, 1.0),
    "synthesis_weights": Choice([[1, 1, 1, 1], [0, 0, 0, 1], [0.1, 0.2, 0.3, 0.4]]),
    "horizon": Choice([0.5, 1.0]),
    "step": Choice([0.05, 0.1]),
}


@pytest.fixture(scope="module")
def played():
    return Study(calm(), VARY, trials=60, seed=3).run(threads=2)


def test_every_trial_is_the_game_that_its_numbers_say(played):
    """Against the batch of each game alone, which has its own Riccati solution and its own table."""
    assert played.study.games[0] == "horizon"
    for trial in range(played.trials):
        one = played.setup(trial)
        assert one.attacker.control_weight == played.inputs["attacker.control_weight"][trial]
        assert one.defenders[2].running_weight == played.inputs["d3.running_weight"][trial]
        assert (one.horizon, one.step) == (played.inputs["horizon"][trial], played.inputs["step"][trial])
        assert one.synthesis_weights == tuple(played.inputs[f"synthesis_weights.{i}"][trial] for i in range(4))
        alone = tadcore.simulate_batch(one, [one.positions])
        assert (alone.kind[0], alone.defender[0], alone.time[0]) == (
            played.kind[trial],
            played.defender[trial],
            played.time[trial],
        )
    assert len(set(played.kind.tolist())) > 1
    assert played.replay(7).outcome.time == played.time[7]


@pytest.mark.parametrize("keep", ["all", "outcomes", "counts"])
def test_stores_threads_and_ways_to_keep_agree(played, keep, tmp_path):
    result = Study(calm(), VARY, trials=60, seed=3).run(keep=keep, store=tmp_path, threads=1)
    for one in (result, tadcore.load_study(tmp_path)):
        assert one.tally == played.tally
        assert one.inputs["synthesis_weights.2"].tobytes() == played.inputs["synthesis_weights.2"].tobytes()
        assert repr(one.probabilities()) == repr(played.probabilities())
    assert tadcore.study.verify_store(tmp_path) == 60


def test_positions_are_drawn_as_in_a_study_of_one_game(played):
    alone = Study(calm(), {"attacker.position": VARY["attacker.position"]}, trials=60, seed=3)
    assert alone.games == ()
    assert alone.inputs()["attacker.position.x"].tobytes() == played.inputs["attacker.position.x"].tobytes()
    assert "every trial is a game of its own" in repr(played.study)
    assert "of its own" not in repr(alone)


def test_a_game_without_an_equilibrium_is_an_outcome(tmp_path):
    """The horizon decides, and the escape time is known in closed form."""
    study = Study(escaping(3.0), {"horizon": Choice([2.0, 3.0, 3.2, 3.25, 4.0])}, trials=200, seed=1)
    result = study.run(store=tmp_path)
    lost = result.inputs["horizon"] > ESCAPE
    assert 0 < lost.sum() < 200
    assert np.array_equal(result.kind == 3, lost)
    assert result.counts()["no_equilibrium"] == int(lost.sum())
    assert sum(result.counts().values()) == 200
    found = result.probabilities()
    assert found["no_equilibrium"][0] == pytest.approx(lost.mean())
    assert sum(found.estimate[excluding(found.names)]) == pytest.approx(1.0)
    assert result.incidence()["no_equilibrium"][0] == pytest.approx(lost.mean())
    assert result.table["outcome"].to_pylist().count("no_equilibrium") == int(lost.sum())
    with pytest.raises(NoEquilibriumError):
        result.replay(int(np.flatnonzero(lost)[0]))
    counted = study.run(keep="counts", store=tmp_path / "counts")
    assert counted.tally == tadcore.load_study(tmp_path / "counts").tally == result.tally


def test_times_beyond_the_scenarios_horizon_are_counted_at_its_end():
    result = Study(calm(), {"horizon": Choice([0.5, 2.0])}, trials=20, seed=1).run()
    curves = result.incidence()
    assert curves.running[-1] == pytest.approx(0.0)
    by_half = result.time <= 0.5
    assert float(1.0 - curves.running[10]) == pytest.approx(by_half.mean())


def test_the_row_of_a_game_is_read_as_it_is_written():
    for sc in (calm(), calm_team()):
        known = game_quantities_of(sc)
        states = ("position", "visibility_radius", "capture_radius", "interaction")
        kinds = ("feedback", "criterion", "prediction_horizon", "sensing", "communication", "disturbance")
        numbers = {path for path in sc.paths if not any(kind in path.split(".") for kind in kinds)}
        assert set(known) == {path for path in numbers if path.rpartition(".")[2] not in states}
        purposes = [quantity.purpose for quantity in known.values()]
        assert len(set(purposes)) == len(purposes)
        for quantity in known.values():
            drawn = np.full((1, quantity.components), 0.25)
            row = games_of(sc, (quantity,), drawn)[0]
            changed = np.flatnonzero(row != numbers_of(sc))
            wanted = range(quantity.row, quantity.row + quantity.components)
            assert set(changed) <= set(wanted)
            if quantity.path not in ("horizon", "step", GAMMA):
                assert np.array_equal(numbers_of(sc.replace({quantity.path: 0.25})), row)
    assert SINGLE[0] == "horizon"


@pytest.mark.parametrize(
    ("vary", "words"),
    [
        (
            {"attacker.control_weight": Box(-1, 1)},
            r"attacker\.control_weight, trial \d+: got -0\.\d+, must be a weight",
        ),
        ({"attacker.evasion": Box(0, 2)}, r"attacker\.evasion, trial \d+: got 1\.\d+, must be a number in \[0, 1\]"),
        ({"horizon": Box(1, 2)}, r"horizon, trial 0: got 1\.\d+, must be a multiple of the step"),
        ({"step": Choice([0.05, 0.3])}, r"step, trial \d+: got 0\.3, must be a divisor of the horizon"),
        (
            {"synthesis_weights": Choice([[0, 0, 0, 0], [1, 1, 1, 1]])},
            r"synthesis_weights, trial \d+: .*one is positive",
        ),
        ({"synthesis_weights": Choice([[1, 1, 1]])}, r"synthesis_weights.*positions of 4 numbers"),
        ({"interaction": Choice([1.0, 2.0])}, r"tadcore\.sweep\(study"),
        ({"target.visibility_radius": Box(1, 2)}, "belongs to interaction I2"),
    ],
)
def test_draws_that_are_no_games_are_refused_before_anything_runs(vary, words, monkeypatch):
    monkeypatch.setattr("tadcore.study.plan.Plan.play", lambda *_, **__: pytest.fail("a game was played"))
    with pytest.raises(ScenarioError, match=words):
        Study(calm(), vary, trials=100, seed=1).run()


def test_a_table_of_gains_is_no_use_to_games_of_their_own(tmp_path):
    with pytest.raises(ScenarioError, match=r"table: .* left out: attacker\.control_weight varies"):
        Study(calm(), {"attacker.control_weight": Box(1, 2)}, trials=3).run(table=tmp_path / "gains")


def test_in_i2_too():
    vary = {
        "target.visibility_radius": Box(1, 3),
        "target.control_weight": Box(0.5, 2),
        "d2.evasion_running_weight": [1, 2],
    }
    result = Study(calm_team(), vary, trials=12, seed=2).run()
    for trial in range(12):
        one = result.setup(trial)
        assert one.target.control_weight == result.inputs["target.control_weight"][trial]
        alone = tadcore.simulate_batch(one, [one.positions])
        assert (alone.kind[0], alone.time[0]) == (result.kind[trial], result.time[trial])
    assert not math.isnan(result.time.sum())
    assert result.trials < CHUNK
