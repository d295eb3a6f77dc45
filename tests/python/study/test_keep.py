"""What a study keeps: all, outcomes or counts say the same, to the bit, however the run went; stores of many parts."""

import os
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pyarrow.dataset as ds
import pyarrow.parquet as pq
import pytest

import tadcore
from study_cases import CHUNK, part, parts, resealed, ring, study
from tadcore import HalfWidth, ScenarioError, StoreError
from tadcore.statistics import Tally

HERE = Path(__file__).parents[1]
KEEPS = ("all", "outcomes", "counts")


@pytest.fixture(scope="module")
def whole():
    """The study as it keeps all, in memory."""
    return study().run(threads=2)


@pytest.fixture(params=[1, 2, 64])
def group(request, monkeypatch):
    """How many chunks a part has."""
    monkeypatch.setattr("tadcore.study.parts.GROUP", request.param)
    return request.param


@pytest.fixture
def on_disk(monkeypatch):
    """Results leave their rows in the store, as those of a study that is larger than the memory do."""
    monkeypatch.setattr("tadcore.study.keepers.EAGER", 100)


def files(folder):
    """What there is beside the lock and the manifest."""
    return {path.name: path.read_bytes() for path in Path(folder).glob("[!_]*")}


def test_a_tally_is_what_counting_finds(whole):
    steps = np.rint(whole.time / whole.scenario.step).astype(int)
    names = ["timeout", "captured", "d1", "d2", "d3"]
    code = np.where(whole.kind == 2, 2 + whole.defender, whole.kind)
    tally = whole.tally
    assert tally.trials == whole.trials
    for outcome in range(5):
        for step in range(whole.scenario.steps + 1):
            wanted = int(((code == outcome) & (steps == step)).sum())
            found = tally.count[(tally.outcome == outcome) & (tally.step == step)].sum()
            assert found == wanted, (names[outcome], step)
    assert list(whole.counts().values()) == [int((whole.kind == kind).sum()) for kind in range(3)]


def test_tallies_add_up_in_any_order():
    rng = np.random.default_rng(0)
    drawn = [rng.integers(0, 3, 500), rng.integers(0, 4, 500), rng.random(500) < 0.1, rng.integers(0, 21, 500)]
    drawn[1][drawn[0] != 2] = -1
    everything = Tally.of(*drawn, 4, 20)
    pieces = [Tally.of(*(a[i : i + 100] for a in drawn), 4, 20) for i in range(0, 500, 100)]
    assert Tally.sum(pieces, 4, 20) == Tally.sum(pieces[::-1], 4, 20) == everything
    assert everything - pieces[2] == Tally.sum([*pieces[:2], *pieces[3:]], 4, 20)
    assert (everything - everything).trials == 0
    sparse = Tally.of(*drawn, 4, 10**6)  # counted by sorting
    assert np.array_equal(sparse.count, everything.count)
    assert np.array_equal(sparse.step, everything.step)


@pytest.mark.parametrize("keep", KEEPS)
@pytest.mark.parametrize("stored", [False, True])
def test_every_way_to_keep_says_the_same(whole, keep, stored, tmp_path, group):
    results = [study().run(keep=keep, store=tmp_path if stored else None, threads=1)]
    results += [tadcore.load_study(tmp_path)] if stored else []
    for result in results:
        assert result.trials == whole.trials
        assert result.counts() == whole.counts()
        assert result.tally == whole.tally
        assert repr(result) == repr(whole)
        assert repr(result.probabilities()) == repr(whole.probabilities())
        assert result.incidence().estimate.tobytes() == whole.incidence().estimate.tobytes()
        assert list(result.inputs) == list(whole.inputs)
        assert all(values.tobytes() == whole.inputs[name].tobytes() for name, values in result.inputs.items())
        assert result.setup(9000) == whole.setup(9000)
        assert result.replay(9000).outcome.time == whole.time[9000]
        if keep != "counts":
            assert result.time.tobytes() == whole.time.tobytes()
            assert result.kind.tobytes() == whole.kind.tobytes()
            assert result.table.equals(whole.table.select(result.table.column_names))
            assert result.compare(whole).flipped.size == 0


def test_what_is_not_kept_is_said(tmp_path):
    counted = study(100).run(keep="counts", store=tmp_path)
    for ask in (lambda: counted.kind, lambda: counted.table, lambda: next(counted.pieces()), lambda: counted.time):
        with pytest.raises(ScenarioError, match=r'keep: got .counts., must be "outcomes" or "all"'):
            ask()
    assert study(100).run(keep="outcomes").table.column_names == [
        "trial",
        "outcome",
        "kind",
        "defender",
        "time",
        "diverged",
    ]
    with pytest.raises(ScenarioError, match=r'keep: got .some., must be "all" or "outcomes" or "counts"'):
        study(100).run(keep="some")
    with pytest.raises(StoreError, match="it keeps 'counts' of every trial, and this run 'all'"):
        study(100).run(store=tmp_path)
    assert study(100, keep="counts").run(store=tmp_path).counts() == counted.counts()
    assert tadcore.load_study(tmp_path).study.keep == "counts"


def test_outcomes_take_few_bytes(tmp_path):
    sc = tadcore.scenarios.load("paper-i1").replace({"d*.visibility_radius": np.inf})
    vary = {"*.position": tadcore.sampling.Box([-3, -3], [3, 3])}
    trials = 4 * CHUNK
    tadcore.Study(sc, vary, trials=trials).run(keep="outcomes", store=tmp_path)
    assert sum(map(len, files(tmp_path).values())) <= 6 * trials


def test_what_a_store_does_not_keep_and_cannot_draw_again_is_said(tmp_path):
    study(50, vary={"attacker.position": ring}).run(store=tmp_path, keep="outcomes")
    loaded = tadcore.load_study(tmp_path)
    assert loaded.trials == 50
    for ask in (lambda: loaded.inputs, lambda: loaded.replay(3)):
        with pytest.raises(ScenarioError, match="given again as the object itself"):
            ask()


@pytest.mark.parametrize("keep", KEEPS)
def test_any_way_to_run_gives_the_same_files(keep, tmp_path, group):
    trials = 4 * CHUNK + 9
    study(trials).run(store=tmp_path / "once", keep=keep)
    for step in (CHUNK - 3, 2 * CHUNK + 5, 3 * CHUNK, trials):
        study(step).run(store=tmp_path / "grown", keep=keep, threads=1)
    with ThreadPoolExecutor(3) as pool:
        study(trials).run(store=tmp_path / "pool", keep=keep, executor=pool)
    assert files(tmp_path / "once") == files(tmp_path / "grown") == files(tmp_path / "pool")


def test_parts_are_joined(tmp_path, monkeypatch):
    """Written one by one, as by a slow study; those of one group become one file, and nothing is left beside."""
    monkeypatch.setattr("tadcore.study.parts.GROUP", 2)
    monkeypatch.setattr("tadcore.study.writing._PATIENCE", -1.0)
    study(5 * CHUNK).run(store=tmp_path / "slow", threads=1)
    names = ["part-0000000000-0000016384.parquet", "part-0000016384-0000032768.parquet", part(4)]
    assert list(parts(tmp_path / "slow")) == names
    assert [pq.read_metadata(tmp_path / "slow" / name).num_row_groups for name in names] == [2, 2, 1]
    monkeypatch.setattr("tadcore.study.writing._PATIENCE", 1.0)
    study(5 * CHUNK).run(store=tmp_path / "quick")
    assert parts(tmp_path / "slow") == parts(tmp_path / "quick")
    assert ds.dataset(tmp_path / "slow").to_table().num_rows == 5 * CHUNK


def test_where_a_run_was_killed_between_joining_and_removing_the_larger_part_counts(tmp_path, monkeypatch):
    monkeypatch.setattr("tadcore.study.parts.GROUP", 1)
    result = study(3 * CHUNK).run(store=tmp_path / "pieces")
    monkeypatch.setattr("tadcore.study.parts.GROUP", 64)
    study(3 * CHUNK).run(store=tmp_path / "whole")
    both = shutil.copytree(tmp_path / "whole", tmp_path / "both")
    for name in list(parts(tmp_path / "pieces"))[:2]:
        shutil.copy(tmp_path / "pieces" / name, both)
    assert tadcore.load_study(both).table.equals(result.table)
    monkeypatch.setattr("tadcore.study.plan.Plan.play", lambda *_: pytest.fail("a game was played"))
    assert study(3 * CHUNK).run(store=both).table.equals(result.table)
    assert parts(both) == parts(tmp_path / "whole")
    assert study(3 * CHUNK).run(store=tmp_path / "pieces").table.equals(result.table)
    assert parts(tmp_path / "pieces") == parts(tmp_path / "whole")


KILLED = """
import sys, time
from study_cases import CHUNK, study
from tadcore.study import keepers, parts, writing
from tadcore.study.plan import Plan
parts.GROUP = 4
writing._PATIENCE = keepers._PATIENCE = 0.1
play = Plan.play
Plan.play = lambda *given: (time.sleep(0.1), play(*given))[1]
study(22 * CHUNK + 5).run(store=sys.argv[1], keep=sys.argv[2], threads=int(sys.argv[3]))
"""


@pytest.mark.parametrize("keep", KEEPS)
def test_kill_9_at_any_moment_and_the_same_files(keep, tmp_path, monkeypatch):
    folder, rng, kills = tmp_path / "killed", np.random.default_rng(len(keep)), 0
    for attempt in range(4):
        with subprocess.Popen([sys.executable, "-c", KILLED, folder, keep, str(1 + attempt % 2)], cwd=HERE) as process:
            before = files(folder) if folder.exists() else {}
            while process.poll() is None and (not folder.exists() or files_now(folder) == set(before)):
                time.sleep(0.005)
            time.sleep(rng.uniform(0.0, 0.3))
            process.send_signal(signal.SIGKILL)
        kills += process.returncode == -signal.SIGKILL
    assert kills >= 2
    monkeypatch.setattr("tadcore.study.parts.GROUP", 4)
    result = study(22 * CHUNK + 5).run(store=folder, keep=keep)
    again = study(22 * CHUNK + 5).run(store=tmp_path / "once", keep=keep)
    assert result.tally == again.tally
    assert files(folder) == files(tmp_path / "once")
    assert not list(folder.glob(".*"))


def files_now(folder):
    return {path.name for path in folder.glob("[!_]*.parquet")}


def test_counts_of_fewer_trials_cannot_be_told(tmp_path):
    study(2 * CHUNK).run(store=tmp_path, keep="counts")
    with pytest.raises(StoreError, match="it counts 16,384 trials, of which the first 300 cannot be told"):
        study(300).run(store=tmp_path, keep="counts")


@pytest.mark.parametrize("keep", KEEPS)
@pytest.mark.parametrize("threads", [1, 3])
def test_a_rule_stops_at_the_same_trial(keep, threads, tmp_path):
    rule = HalfWidth(0.005)
    wanted = study(40 * CHUNK).run(until=rule, threads=1)
    assert CHUNK < wanted.trials < 40 * CHUNK
    for _ in range(2):  # the second time from the store
        result = study(40 * CHUNK).run(until=rule, keep=keep, store=tmp_path, threads=threads)
        assert (result.trials, result.tally) == (wanted.trials, wanted.tally)
        assert repr(result.probabilities()) == repr(wanted.probabilities())
    loaded = tadcore.load_study(tmp_path)
    assert (loaded.trials, loaded.tally, str(loaded.stopping)) == (wanted.trials, wanted.tally, str(wanted.stopping))


def test_counts_go_on_with_the_same_rule_and_begin_again_with_another(tmp_path):
    study(3 * CHUNK).run(until=HalfWidth(1e-6), keep="counts", store=tmp_path)
    wanted = study(40 * CHUNK).run(until=HalfWidth(0.005))
    found = study(40 * CHUNK).run(until=HalfWidth(0.005), keep="counts", store=tmp_path)
    assert (found.trials, found.tally) == (wanted.trials, wanted.tally)


def test_rows_that_stay_on_disk_are_those_in_memory(whole, tmp_path, group, on_disk):
    for result in (study().run(store=tmp_path, keep="all"), tadcore.load_study(tmp_path)):
        assert type(result.rows).__name__ == "InStore"
        assert result.tally == whole.tally
        assert result.kind.tobytes() == whole.kind.tobytes()
        assert sum(piece.num_rows for piece in result.pieces()) == whole.trials
        assert result.setup(9000) == whole.setup(9000)
        assert result.table.equals(whole.table)
    longer = study(3 * CHUNK).run(store=tmp_path)
    assert longer.tally == study(3 * CHUNK).run(keep="counts").tally
    shorter = study(CHUNK + 3).run(store=tmp_path)
    assert shorter.tally == study(CHUNK + 3).run(keep="counts").tally


def test_a_part_is_verified_when_its_rows_are_asked_for(tmp_path, on_disk, monkeypatch):
    monkeypatch.setattr("tadcore.study.parts.GROUP", 1)
    study().run(store=tmp_path)
    path = tmp_path / part(1)
    data = bytearray(path.read_bytes())
    data[len(data) // 3] ^= 0x10
    path.write_bytes(data)
    loaded = tadcore.load_study(tmp_path)
    assert next(loaded.pieces()).num_rows == CHUNK
    for ask in (lambda: loaded.table, lambda: loaded.replay(9000)):
        with pytest.raises(StoreError, match="damaged") as caught:
            ask()
        assert caught.value.path == str(path)


def test_too_many_rows_are_refused_before_they_are_read(tmp_path, on_disk, monkeypatch):
    study(300).run(store=tmp_path)
    monkeypatch.setattr("tadcore.study.rows.MOST_BYTES", 1000)
    monkeypatch.setattr("tadcore.study.study.MOST_BYTES", 1000)
    loaded = tadcore.load_study(tmp_path)
    with pytest.raises(tadcore.OutOfMemoryError, match=r"the table of 300 trials, which pieces\(\) reads part by part"):
        loaded.table  # noqa: B018
    assert loaded.kind.size == 300


def test_verify_reads_everything(tmp_path, capsys, monkeypatch):
    from tadcore.cli.app import main

    monkeypatch.setattr("tadcore.study.parts.GROUP", 1)
    for keep in KEEPS:
        study().run(store=tmp_path / keep, keep=keep)
        with pytest.raises(SystemExit, match="0"):
            main(["store", "verify", str(tmp_path / keep)])
        assert "16,884 trials, all as they were written" in capsys.readouterr().out
        path = sorted((tmp_path / keep).glob("[!_]*.parquet"))[-1]
        data = bytearray(path.read_bytes())
        data[200] ^= 0x04
        path.write_bytes(data)
        with pytest.raises(SystemExit, match="2"):
            main(["store", "verify", str(tmp_path / keep)])
        assert path.name in " ".join(capsys.readouterr().err.split()).replace(" ", "")


def test_a_store_of_many_parts_opens_without_reading_them(tmp_path, on_disk, monkeypatch):
    """As many files as a billion trials have: opened by their names alone, and counted from their ends."""
    monkeypatch.setattr("tadcore.study.parts.GROUP", 1)
    study(CHUNK).run(store=tmp_path, keep="outcomes")
    first = (tmp_path / part(0)).read_bytes()
    for chunk in range(1, 1908):
        os.link(tmp_path / part(0), tmp_path / part(chunk))
    assert first == (tmp_path / part(1907)).read_bytes()
    resealed(tmp_path, trials=1908 * CHUNK)
    began = time.monotonic()
    loaded = tadcore.load_study(tmp_path)
    assert loaded.trials == 1908 * CHUNK
    assert time.monotonic() - began < 2.0
    with pytest.raises(StoreError, match="it holds the trials from 0 on, not from 8192"):
        loaded.counts()
