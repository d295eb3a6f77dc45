"""Workers that write their rows themselves: the store is that of one process, whoever wrote it and whoever died."""

import concurrent.futures as futures
import multiprocessing
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
import warnings
from pathlib import Path

import pytest

import tadcore
from study_cases import CHUNK, FLAG, calm_team, lethal, misses, part, parts, study
from tadcore import StoreError, WorkerError
from tadcore.study import verify_store
from tadcore.study.elsewhere import Reached
from tadcore.study.keepers import RowKeeper
from tadcore.study.parts import Format, Joined
from tadcore.study.plan import Plan
from tadcore.study.task import Written
from tadcore.study.warm_start import read_once
from tadcore.study.workers import Groups, Wanted

HERE = Path(__file__).parents[1]
TRIALS = 13 * CHUNK + 50


def spawned(workers=2):
    return futures.ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn"))


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Parts of four chunks; workers learn of that with what they are sent."""
    monkeypatch.setattr("tadcore.study.parts.GROUP", 4)


@pytest.fixture
def came(monkeypatch):
    """What came back from the workers."""
    seen, add = [], RowKeeper.add

    def noted(keeper, played):
        seen.append(played)
        return add(keeper, played)

    monkeypatch.setattr(RowKeeper, "add", noted)
    return seen


def of_workers(came):
    return [played for played in came if not isinstance(played, Joined)]


@pytest.mark.parametrize("keep", ["all", "outcomes"])
def test_processes_write_their_rows_and_send_digests(keep, tmp_path, came):
    alone = study(TRIALS).run(store=tmp_path / "alone", keep=keep)
    came.clear()
    with spawned() as pool:
        result = study(TRIALS).run(store=tmp_path / "pool", keep=keep, executor=pool)
    assert all(played.written and not played.outcomes for played in of_workers(came))
    assert sum(len(w.digests) for played in of_workers(came) for w in played.written) == 14
    assert parts(tmp_path / "pool") == parts(tmp_path / "alone")
    assert {path.name for path in (tmp_path / "pool").glob("[_.]*")} <= {"_manifest.json", "_store.lock"}
    assert result.table.equals(alone.table)
    assert result.tally == alone.tally == tadcore.load_study(tmp_path / "pool").tally


def test_workers_join_what_they_have_written(tmp_path, came, monkeypatch):
    """Where a part has come in pieces a worker joins them, unless none is left to do it."""
    monkeypatch.setattr(Groups, "note", lambda *_: None)  # one chunk in a group, to the end
    study(TRIALS).run(store=tmp_path / "alone")
    came.clear()
    with futures.ThreadPoolExecutor(1) as pool:
        study(TRIALS).run(store=tmp_path / "pool", executor=pool)
    assert sum(isinstance(one, Joined) for one in came) >= 1
    assert parts(tmp_path / "pool") == parts(tmp_path / "alone")


def test_a_group_is_a_part_where_that_does_not_take_long():
    def groups(speed, whole):
        made, sizes = Groups(Wanted(range(6, 1000), 1000 * CHUNK, "all", apart=False), 1, 1.5, whole), []
        made._speed = speed * CHUNK
        while (task := made.take()) is not None:
            sizes.append(task)
        return sizes

    whole = groups(20.0, 64)
    assert [task.first for task in whole[:4]] == [6, 64, 128, 192]  # 30 chunks in a second and a half, 64 in three
    assert all(task.first // 64 == task.last // 64 for task in groups(5.0, 64))
    assert len(groups(5.0, 64)[1].chunks()) == 7
    assert len(groups(20.0, 0)[0].chunks()) == 30


@pytest.mark.parametrize("until", [None, tadcore.HalfWidth(0.02)])
def test_workers_that_do_not_reach_the_store_send_their_rows(until, tmp_path, came, monkeypatch):
    alone = study(TRIALS).run(store=tmp_path / "alone", until=until)
    monkeypatch.setattr(Reached, "holds", lambda _: False)
    came.clear()
    with futures.ThreadPoolExecutor(2) as pool:
        result = study(TRIALS).run(store=tmp_path / "pool", executor=pool, until=until)
    assert all(played.outcomes and not played.written for played in of_workers(came))
    assert result.table.equals(alone.table)
    if until is None:
        assert parts(tmp_path / "pool") == parts(tmp_path / "alone")


def test_a_rule_stops_a_study_whose_workers_write(tmp_path):
    rule = tadcore.HalfWidth(0.02)
    alone = study(TRIALS).run(until=rule)
    with futures.ThreadPoolExecutor(2) as pool:
        result = study(TRIALS).run(store=tmp_path, executor=pool, until=rule)
    assert CHUNK <= result.trials == alone.trials < TRIALS
    assert result.table.equals(alone.table)
    assert tadcore.load_study(tmp_path).table.equals(alone.table)


def test_some_workers_write_and_others_send(tmp_path, monkeypatch, came):
    turns, put = iter(range(10**6)), Format.put

    def sometimes(form, first, table, *still):
        if "ThreadPoolExecutor" in threading.current_thread().name and next(turns) % 2:
            raise StoreError("there", "a disk of its own", "nothing")
        return put(form, first, table, *still)

    study(TRIALS).run(store=tmp_path / "alone")
    monkeypatch.setattr(Format, "put", sometimes)
    came.clear()
    with futures.ThreadPoolExecutor(2) as pool:
        try:
            study(TRIALS).run(store=tmp_path / "pool", executor=pool)
        except StoreError as error:  # of a worker that was to join parts
            assert "a disk of its own" in str(error)  # noqa: PT017
    assert {bool(played.written) for played in of_workers(came)} == {True, False}
    monkeypatch.setattr(Format, "put", put)
    study(TRIALS).run(store=tmp_path / "pool")
    assert parts(tmp_path / "pool") == parts(tmp_path / "alone")


@pytest.mark.parametrize(
    ("put", "words"),
    [
        (lambda form, first, table, *_: Written(first, first + len(table), ("0",)), "it is not there; let the workers"),
        (lambda form, first, table, *_: PUT(form, first, table)._replace(digests=("0",)), "not hold what a worker has"),
    ],
)
def test_what_a_worker_says_is_confirmed(put, words, tmp_path, monkeypatch):
    monkeypatch.setattr(Format, "put", put)
    with futures.ThreadPoolExecutor(1) as pool, pytest.raises(StoreError, match=words):
        study(2 * CHUNK).run(store=tmp_path, executor=pool)


PUT = Format.put


def test_worker_processes_read_the_saved_table_instead_of_filling_one(tmp_path):
    table, sc = tmp_path / "gains", study().scenario
    whole = study(200).run(table=table)
    saved = table.read_bytes()
    with spawned(1) as pool:
        assert study(200).run(executor=pool, table=table).tally == whole.tally
        assert pool.submit(misses, sc).result() == 0
    with spawned(1) as pool:
        study(200).run(executor=pool)
        assert pool.submit(misses, sc).result() > 0
    assert table.read_bytes() == saved  # workers write none


def test_a_worker_that_cannot_read_the_table_says_so(tmp_path):
    (tmp_path / "gains").write_bytes(b"tadtable")
    with pytest.warns(RuntimeWarning, match="this worker begins with an empty table"):
        read_once(calm_team(), tmp_path / "gains")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read_once(calm_team(), tmp_path / "gains")  # once


@pytest.fixture
def flag(tmp_path, monkeypatch):
    """A file that makes the first worker process that sees it die."""
    place = tmp_path / "flag"
    monkeypatch.setenv(FLAG, str(place))
    return place


def raised(flag, folder, many):
    """A thread that raises the flag when so many parts are there."""

    def wait():
        until = time.monotonic() + 60
        while len(parts(folder)) < many and time.monotonic() < until:
            time.sleep(0.002)
        flag.touch()

    thread = threading.Thread(target=wait, daemon=True)
    thread.start()
    return thread


def dying(trials=40 * CHUNK):
    return study(trials, vary={"attacker.position": lethal})


def test_a_worker_killed_in_its_group_loses_what_was_in_flight_alone(flag, tmp_path, monkeypatch, came):
    folder = tmp_path / "pool"
    thread = raised(flag, folder, 3)
    with spawned() as pool, pytest.raises(WorkerError, match="run the study again with this store"):
        dying().run(store=folder, executor=pool)
    thread.join()
    assert not flag.exists()
    there = parts(folder)
    reported = {chunk for played in of_workers(came) for chunk, _ in played.task.chunks()}
    held = {chunk for name in there for chunk in range(int(name[5:15]) // CHUNK, int(name[16:26]) // CHUNK)}
    assert reported <= held
    assert len(reported) >= 3
    came.clear()
    with spawned(1) as pool:
        dying().run(store=folder, executor=pool)
    again = {chunk for played in of_workers(came) for chunk, _ in played.task.chunks()}
    assert again == set(range(40)) - held
    dying().run(store=tmp_path / "alone")
    assert parts(folder) == parts(tmp_path / "alone")
    assert not list(folder.glob(".*"))
    assert verify_store(folder) == 40 * CHUNK


HEAD = """
import concurrent.futures, multiprocessing, sys
from study_cases import CHUNK, study
from tadcore.study import parts
parts.GROUP = 4
if __name__ == "__main__":
    with concurrent.futures.ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as pool:
        study(60 * CHUNK).run(store=sys.argv[1], executor=pool)
"""


def test_a_head_killed_while_its_workers_write_is_resumed(tmp_path):
    folder, script = tmp_path / "store", tmp_path / "head.py"
    script.write_text(HEAD, encoding="utf-8")
    path = os.pathsep.join([str(HERE), str(Path(tadcore.__file__).parents[1])])
    with subprocess.Popen([sys.executable, script, folder], env={**os.environ, "PYTHONPATH": path}) as process:
        while process.poll() is None and len(parts(folder)) < 5:
            time.sleep(0.002)
        process.send_signal(signal.SIGKILL)
    assert process.returncode == -signal.SIGKILL
    assert parts(folder)
    result = study(60 * CHUNK).run(store=folder)
    whole = study(60 * CHUNK).run(store=tmp_path / "whole")
    assert result.table.equals(whole.table)
    assert parts(folder) == parts(tmp_path / "whole")


def test_what_a_worker_of_a_killed_run_writes_late_does_not_stay(tmp_path, monkeypatch):
    """It appears while the next run is on its way, as a smaller part than that run writes."""
    study(TRIALS).run(store=tmp_path / "alone")
    with monkeypatch.context() as patch:
        patch.setattr("tadcore.study.parts.GROUP", 1)
        study(2 * CHUNK).run(store=tmp_path / "small")
    late, play = (tmp_path / "small" / part(1)), Plan.run

    def run(plan, *given):
        shutil.copy(late, tmp_path / "store")
        return play(plan, *given)

    monkeypatch.setattr(Plan, "run", run)
    result = study(TRIALS).run(store=tmp_path / "store")
    assert parts(tmp_path / "store") == parts(tmp_path / "alone")
    assert result.table.equals(tadcore.load_study(tmp_path / "alone").table)


def test_a_worker_whose_run_has_ended_writes_nothing(tmp_path, monkeypatch, came):
    """The sign goes between the playing and the writing."""
    asked = iter([True] + 9 * [False])
    monkeypatch.setattr(Reached, "holds", lambda _: next(asked))
    with futures.ThreadPoolExecutor(1) as pool:
        study(CHUNK).run(store=tmp_path, executor=pool)
    assert [bool(played.written) for played in came] == [False]


@pytest.mark.filterwarnings("ignore")  # what Dask warns of while it starts and stops is its own affair
def test_a_dask_cluster_writes_its_parts_and_outlives_a_worker(flag, tmp_path, came):
    distributed = pytest.importorskip("distributed")
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None, "silence_logs": 50}
    folder = tmp_path / "dask"
    with distributed.LocalCluster(processes=True, **options) as cluster, distributed.Client(cluster) as client:
        thread = raised(flag, folder, 3)
        result = dying().run(store=folder, executor=client.get_executor())
        thread.join()
        assert not flag.exists()  # a worker died, and another plays its group
    assert all(played.written and not played.outcomes for played in of_workers(came))
    alone = dying().run(store=tmp_path / "alone")
    assert result.table.equals(alone.table)
    assert parts(folder) == parts(tmp_path / "alone")
