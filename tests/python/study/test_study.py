"""Studies: their table, trials played again, stopping, progress and interruption."""

import re
import signal
import subprocess
import sys
import time
import types
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

import tadcore
from study_cases import CHUNK, calm, calm_team, study
from tadcore import ScenarioError, Study
from tadcore.sampling import Box, Disk, Gaussian


def test_wildcards_and_the_columns_of_the_table():
    result = study(50, vary={"*.position": Gaussian(0, 1), "defenders.*.capture_radius": [0.1, 0.2]}).run()
    players = ["attacker", "target", "defenders.0", "defenders.1", "defenders.2"]
    columns = [f"{p}.position.{axis}" for p in players for axis in "xy"]
    columns += [f"defenders.{i}.capture_radius" for i in range(3)]
    assert set(result.inputs) == set(columns)
    fixed = {"trial": pa.int64(), "kind": pa.int8(), "defender": pa.int32(), "time": pa.float64()}
    fixed["diverged"] = pa.bool_()
    fixed["outcome"] = pa.dictionary(pa.int32(), pa.string())
    assert {f.name: f.type for f in result.table.schema} == fixed | dict.fromkeys(columns, pa.float64())
    assert not np.array_equal(result.inputs["defenders.0.capture_radius"], result.inputs["defenders.1.capture_radius"])


def test_the_target_of_i2_has_a_radius():
    sc = calm_team()
    result = Study(sc, {"*.visibility_radius": Box(1.0, 3.0)}, trials=40, seed=1).run()
    assert list(result.inputs) == [
        f"{p}.visibility_radius" for p in ("target", "defenders.0", "defenders.1", "defenders.2")
    ]
    assert result.setup(7).target.visibility_radius == result.inputs["target.visibility_radius"][7]
    with pytest.raises(ScenarioError, match="belongs to interaction I2"):
        Study(calm(), {"target.visibility_radius": Box(1, 2)}, trials=1)


def test_every_trial_can_be_played_again():
    vary = {"attacker.position": Disk([0, 1], 2.0), "defenders.*.visibility_radius": Box(0.5, 4.0)}
    vary |= {"defenders.0.capture_radius": Box(0.1, 0.4), "target.position.x": Box(-1, 1)}
    result = study(400, vary=vary).run()
    chosen = [int(np.flatnonzero(result.kind == kind)[0]) for kind in range(3)]
    for trial in chosen:
        one = result.setup(trial)
        assert one.attacker.position[1] == result.inputs["attacker.position.y"][trial]
        assert one.defenders[2].visibility_radius == result.inputs["defenders.2.visibility_radius"][trial]
        assert one.defenders[0].capture_radius == result.inputs["defenders.0.capture_radius"][trial]
        assert one.target.position == (result.inputs["target.position.x"][trial], 1.0)
        run = result.replay(trial)
        assert run.outcome.kind == ("timeout", "captured", "intercepted")[result.kind[trial]]
        assert (-1 if run.outcome.defender is None else run.outcome.defender) == result.defender[trial]
        assert run.outcome.time == result.time[trial]
    for bad in (400, -1, 1.0, "0"):
        with pytest.raises(ScenarioError, match="trial"):
            result.replay(bad)


class After:
    """A rule that holds from some number of trials on, and notes when it was asked."""

    def __init__(self, trials):
        self.trials = trials
        self.asked = []

    def satisfied(self, counts, trials):
        assert counts.shape == (3,)
        assert counts.sum() == trials
        self.asked.append(trials)
        return trials >= self.trials


def test_a_study_stops_after_the_first_chunk_at_which_the_rule_holds():
    rule = After(CHUNK + 1)
    result = study(5 * CHUNK).run(until=rule)
    assert rule.asked == [CHUNK, 2 * CHUNK]
    assert result.trials == 2 * CHUNK
    assert result.table.equals(study(2 * CHUNK).run().table)
    assert repr(result).startswith("StudyResult(16,384 of 40,960 trials: ")
    rule = After(10**9)
    assert study(CHUNK + 10).run(until=rule).trials == CHUNK + 10
    assert rule.asked == [CHUNK, CHUNK + 10]
    with pytest.raises(ScenarioError, match="until"):
        study(10).run(until=0.002)


def test_results_are_frames(tmp_path):
    result = study(200).run()
    frame = result.to_pandas()
    assert frame["time"].to_numpy().tolist() == result.time.tolist()
    assert list(frame) == result.table.column_names
    polars = pytest.importorskip("polars")
    other = result.to_polars()
    assert other["kind"].to_list() == result.kind.tolist()
    assert isinstance(other, polars.DataFrame)


def test_a_study_reads_well():
    assert repr(study(5000)) == (
        "Study(5,000 trials of Scenario(I1, 3 defenders, dim=2, T=1, δ=0.05), random, seed 7, "
        "vary attacker.position (Disk), defenders.0.visibility_radius (Box))"
    )
    result = study(100).run()
    ends = result.counts()
    assert repr(result) == (
        f"StudyResult(100 trials: {ends['timeout']} timeout, {ends['captured']} captured, "
        f"{ends['intercepted']} intercepted)"
    )
    assert (result.seed, result.scenario) == (7, calm())


def last_state(capsys):
    """The last state of the bar: trials done and the running estimates."""
    shown = capsys.readouterr().err.replace("\n", "\r").strip("\r ").split("\r")[-1]
    found = re.search(r"([\d.]+k?)/([\d.]+k?) \[.*intercepted ([\d.]+) captured ([\d.]+) timeout ([\d.]+)", shown)
    return shown, found[1], found[2], [float(found[i]) for i in (5, 4, 3)]


def test_a_notebook_gets_a_bar_that_counts_what_the_store_holds(monkeypatch, capsys, tmp_path):
    shell = types.SimpleNamespace(config={"IPKernelApp": {}})
    study(CHUNK).run(store=tmp_path, progress=True)
    assert capsys.readouterr().err == ""
    monkeypatch.setitem(sys.modules, "IPython", types.SimpleNamespace(get_ipython=lambda: shell))
    result = study(2 * CHUNK).run(store=tmp_path, progress="cell 1/3")
    shown, done, total, estimates = last_state(capsys)
    assert shown.startswith("cell 1/3: |")
    assert (done, total) == ("16.4k", "16.4k")
    assert estimates == pytest.approx([count / (2 * CHUNK) for count in result.counts().values()], abs=5.1e-4)


SLOW = """
import time, tadcore
from tadcore.sampling import Box
from study_cases import CHUNK
sc = tadcore.scenarios.load("paper-i1")
study = tadcore.Study(sc, {"*.position": Box(-3, 3)}, trials=200 * CHUNK)
print("ready", flush=True)
try:
    study.run(progress=True)
except KeyboardInterrupt:
    print(time.monotonic(), flush=True)
"""


def test_ctrl_c_ends_a_study_within_a_fifth_of_a_second():
    took = []
    for _ in range(3):  # a loaded machine may be late once
        with subprocess.Popen(
            [sys.executable, "-c", SLOW], stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=Path(__file__).parents[1]
        ) as process:
            assert process.stdout.readline() == b"ready\n"
            time.sleep(0.5)
            sent = time.monotonic()
            process.send_signal(signal.SIGINT)
            out, err = process.communicate(timeout=20)
        assert err == b""  # quiet where no terminal watches
        took.append(float(out) - sent)
        if took[-1] < 0.2:
            break
    assert min(took) < 0.2


def test_replace_takes_the_scenario_by_either_name():
    study = tadcore.Study(tadcore.scenarios.load("paper-i1"), {"d1.visibility_radius": [1.0, 2.0]}, trials=3)
    other = tadcore.scenarios.load("paper-i1-full")
    assert study.replace(scenario=other).scenario == study.replace(sc=other).scenario == other
    with pytest.raises(TypeError, match="no option 'scenario'"):
        study.replace(sc=other, scenario=other)
