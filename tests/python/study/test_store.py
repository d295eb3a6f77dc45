"""Stores: killed, continued, extended, shared, damaged and full; the outcomes are always those of one clean run."""

import json
import multiprocessing
import os
import resource
import shutil
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from scipy import stats

import tadcore
from study_cases import CHUNK, edited, part, parts, resealed, ring, study, to_kill
from tadcore import StoreError
from tadcore.sampling import Box, Choice
from tadcore.study.manifest import Manifest

HERE = Path(__file__).parents[1]


@pytest.fixture(autouse=True, scope="module")
def small_parts():
    """A part for every chunk, so that a store of a few chunks has several."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tadcore.study.parts.GROUP", 1)
        yield


@pytest.fixture(scope="module")
def clean(tmp_path_factory):
    """A finished store, made without interruption."""
    folder = tmp_path_factory.mktemp("clean")
    return study().run(store=folder), folder


@pytest.fixture
def copied(clean, tmp_path):
    """A copy of it, to be spoiled."""
    return Path(shutil.copytree(clean[1], tmp_path / "store"))


def test_a_store_says_what_it_holds(clean):
    result, folder = clean
    assert {path.name for path in folder.iterdir()} <= {"_manifest.json", "_store.lock", *parts(folder)}
    assert list(parts(folder)) == [part(0), part(1), part(2, 500)]
    manifest = json.loads((folder / "_manifest.json").read_text(encoding="utf-8"))
    assert manifest["trials"] == result.trials == 2 * CHUNK + 500
    assert (manifest["seed"], manifest["design"], manifest["chunk"]) == (7, "random", CHUNK)
    assert manifest["tadcore_version"] == tadcore.__version__
    assert manifest["vary"]["attacker.position"] == {"disk": {"center": [0.0, 1.0], "radius": 2.0}}
    assert tadcore.Scenario.from_toml_string(manifest["scenario"]) == result.scenario
    assert manifest["environment"]["numpy"] == np.__version__
    about = pq.read_metadata(folder / part(2, 500)).metadata
    assert about[b"tadcore_study"].decode() == manifest["study_sha256"]
    assert (about[b"tadcore_first"], about[b"tadcore_rows"]) == (b"16384", b"500")


def test_a_study_is_read_back_from_its_store_alone(clean):
    result, folder = clean
    loaded = tadcore.load_study(folder)
    assert loaded.table.equals(result.table)
    assert loaded.table.schema.equals(result.table.schema)
    assert loaded.study.vary == result.study.vary
    assert repr(loaded) == repr(result)
    assert loaded.setup(9000) == result.setup(9000)
    assert tadcore.StudyResult.load(str(folder)).table.equals(study().run().table)


def test_readers_of_parquet_need_nothing_of_ours(clean):
    result, folder = clean
    pandas = pytest.importorskip("pandas")
    frame = pandas.concat([pandas.read_parquet(folder / name) for name in parts(folder)])
    assert np.array_equal(frame["time"], result.time)
    assert frame["trial"].tolist() == list(range(result.trials))
    polars = pytest.importorskip("polars")
    other = polars.read_parquet(folder / "part-*.parquet")
    assert np.array_equal(other["kind"].to_numpy(), result.kind)
    duckdb = pytest.importorskip("duckdb")
    counted = duckdb.sql(f"select kind, count(*) from '{folder}/part-*.parquet' group by kind order by kind").fetchall()
    assert [count for _, count in counted] == list(result.counts().values())


KILLED = to_kill(group=1, pause=0.05)


def test_kill_9_loses_only_what_was_in_flight(tmp_path):
    folder = tmp_path / "killed"
    survived = []
    for wanted in (2, 5):
        with subprocess.Popen([sys.executable, "-c", KILLED, folder], cwd=HERE) as process:
            while process.poll() is None and len(parts(folder)) < wanted:
                time.sleep(0.005)
            process.send_signal(signal.SIGKILL)
        assert process.returncode == -signal.SIGKILL
        survived.append(parts(folder))
        assert wanted <= len(survived[-1]) < 20
    assert survived[0].items() <= survived[1].items()
    cut = tadcore.load_study(folder)
    missing = next(chunk for chunk in range(20) if part(chunk) not in survived[1])
    assert cut.trials == missing * CHUNK >= CHUNK
    assert "163,840 trials" in repr(cut)
    (folder / ".tadcore-abc.parquet").write_bytes(b"half a part")
    result = study(20 * CHUNK).run(store=folder)
    whole = study(20 * CHUNK).run(store=tmp_path / "whole")
    assert result.table.equals(whole.table)
    assert parts(folder) == parts(tmp_path / "whole")
    assert not list(folder.glob(".*"))


FORKED = """
import concurrent.futures, multiprocessing, sys
from study_cases import CHUNK, study
from tadcore.study import parts
parts.GROUP = 1
with concurrent.futures.ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("fork")) as pool:
    study(20 * CHUNK).run(store=sys.argv[1], executor=pool)
"""


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="this system does not fork")
def test_workers_that_outlive_a_killed_run_do_not_hold_its_store(tmp_path):
    folder = tmp_path / "store"
    with subprocess.Popen([sys.executable, "-c", FORKED, folder], cwd=HERE, start_new_session=True) as process:
        while process.poll() is None and not parts(folder):
            time.sleep(0.005)
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        assert study(CHUNK).run(store=folder).trials == CHUNK
        os.killpg(process.pid, signal.SIGKILL)  # the worker is still there


def test_finished_chunks_are_not_played_again(copied, clean, monkeypatch):
    monkeypatch.setattr("tadcore.study.plan.Plan.play", lambda *_, **__: pytest.fail("a game was played"))
    assert study().run(store=copied).table.equals(clean[0].table)
    shorter = study(CHUNK + 7).run(store=copied)
    assert shorter.table.equals(clean[0].table.slice(0, CHUNK + 7))
    assert Manifest.read(copied).trials == 2 * CHUNK + 500  # what was longer stays so
    assert parts(copied) == parts(clean[1])


def test_a_missing_part_is_played_again_alone(copied, clean):
    (copied / part(1)).unlink()
    assert tadcore.load_study(copied).trials == CHUNK
    before = (copied / part(0)).stat().st_mtime_ns
    assert study().run(store=copied).table.equals(clean[0].table)
    assert parts(copied) == parts(clean[1])
    assert (copied / part(0)).stat().st_mtime_ns == before


def test_more_trials_extend_a_store(copied, clean, tmp_path):
    longer = study(3 * CHUNK + 40)
    result = longer.run(store=copied)
    assert result.table.slice(0, clean[0].trials).equals(clean[0].table)
    assert parts(copied) == parts_of(longer, tmp_path / "at-once")
    assert tadcore.load_study(copied).table.equals(result.table)


def parts_of(wanted, folder):
    wanted.run(store=folder, threads=1)
    return parts(folder)


def test_a_stopped_study_is_read_back_as_it_stopped(tmp_path):
    class Two:
        def satisfied(self, counts, trials):
            return trials >= 2 * CHUNK

    folder = tmp_path / "store"
    study(4 * CHUNK).run(store=folder)
    stopped = study(4 * CHUNK).run(store=folder, until=Two())
    assert stopped.trials == tadcore.load_study(folder).trials == 2 * CHUNK
    assert study(4 * CHUNK).run(store=folder).trials == tadcore.load_study(folder).trials == 4 * CHUNK


@pytest.mark.parametrize(
    ("changes", "differs"),
    [
        ({"seed": 8}, "seed"),
        ({"design": "sobol"}, "design"),
        ({"vary": {"attacker.position": Box([0, 0], [1, 1])}}, "vary"),
        ({"sc": study().scenario.replace(horizon=0.5)}, "scenario"),
    ],
)
def test_another_study_is_refused_and_nothing_is_touched(copied, clean, changes, differs):
    with pytest.raises(StoreError, match=rf"it holds another study \(its {differs} differ\)"):
        study(**changes).run(store=copied)
    assert parts(copied) == parts(clean[1])
    assert (copied / "_manifest.json").read_bytes() == (clean[1] / "_manifest.json").read_bytes()


def spoiled(folder, name, change):
    path = folder / name
    path.write_bytes(change(bytearray(path.read_bytes())))


def flipped(data):
    data[len(data) // 2] ^= 0x10  # amid the pages, far from the footer
    return data


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda data: data[:-1], "truncated or no Parquet file"),
        (lambda data: data[: len(data) // 2], "truncated or no Parquet file"),
        (lambda data: data[:3], "truncated or no Parquet file"),
        (lambda data: b"", "truncated or no Parquet file"),
        (flipped, "damaged"),
    ],
)
@pytest.mark.parametrize("use", [lambda folder: study().run(store=folder), tadcore.load_study])
def test_a_truncated_or_damaged_part_is_named(copied, clean, change, words, use):
    spoiled(copied, part(1), change)
    with pytest.raises(StoreError, match=words) as caught:
        use(copied)
    assert caught.value.path == str(copied / part(1))
    assert "delete this file and run the study again" in str(caught.value)
    (copied / part(1)).unlink()
    assert study().run(store=copied).table.equals(clean[0].table)


def test_a_foreign_part_is_named(copied, tmp_path):
    study(CHUNK, seed=8).run(store=tmp_path / "other")
    shutil.copy(tmp_path / "other" / part(0), copied)
    with pytest.raises(StoreError, match=rf"{part(0)}: it belongs to another study"):
        study().run(store=copied)
    shutil.copy(copied / part(1), copied / part(0))
    with pytest.raises(StoreError, match=rf"{part(0)}: it holds the trials from 8192 on, not from 0"):
        tadcore.load_study(copied)
    pq.write_table(pq.read_table(copied / part(1)).replace_schema_metadata(None), copied / part(0))
    with pytest.raises(StoreError, match=rf"{part(0)}: it belongs to no study"):
        tadcore.load_study(copied)
    (copied / part(0)).rename(copied / "part-mine.parquet")
    with pytest.raises(StoreError, match=r"part-mine\.parquet: its name is not that of a part"):
        tadcore.load_study(copied)


@pytest.mark.parametrize(("drop", "words"), [(["time"], "its columns are"), ([], r"it has 8191 rows, says 8192")])
def test_a_part_with_other_columns_or_rows_is_named(copied, drop, words):
    path = copied / part(0)
    table = pq.read_table(path)
    pq.write_table(table.drop_columns(drop) if drop else table.slice(1), path)
    with pytest.raises(StoreError, match=words):
        study().run(store=copied)


def test_a_manifest_that_is_none_is_named(copied, tmp_path):
    for use in (tadcore.load_study, lambda folder: study().run(store=folder)):
        for changes in ({"seed": 8}, {"trials": 100}, {"stopped": 100}, {"columns": []}, {"tadcore_version": "0.0.1"}):
            before = (copied / "_manifest.json").read_bytes()
            edited(copied, **changes)
            with pytest.raises(StoreError, match=r"manifest\.json: its digest does not fit.*put back a copy"):
                use(copied)
            (copied / "_manifest.json").write_bytes(before)
    for other in (1, 2, 3, 99):
        edited(copied, format=other)
        with pytest.raises(StoreError, match=f"it has format {other}, and this version of tadcore reads 4; read"):
            study().run(store=copied)
    resealed(copied, format=4, tadcore_version="0.0.1")
    assert tadcore.load_study(copied).trials == study().trials
    with pytest.raises(StoreError, match=r"written by tadcore 0\.0\.1"):
        study().run(store=copied)
    (copied / "_manifest.json").write_text("{", encoding="utf-8")
    with pytest.raises(StoreError, match="it is no manifest of a study"):
        study().run(store=copied)
    (copied / "_manifest.json").unlink()
    with pytest.raises(StoreError, match="it holds parts but no manifest"):
        study().run(store=copied)
    for folder in (copied, tmp_path / "nowhere"):
        with pytest.raises(StoreError, match="there is no such file"):
            tadcore.load_study(folder)
    for use in (tadcore.load_study, lambda folder: study().run(store=folder)):
        with pytest.raises(StoreError, match=r"x{300}.*File name too long"):
            use(tmp_path / ("x" * 300))


def test_two_writers_are_refused(tmp_path):
    folder = tmp_path / "store"
    with subprocess.Popen([sys.executable, "-c", KILLED, folder], cwd=HERE) as process:
        while process.poll() is None and not parts(folder):
            time.sleep(0.005)
        with pytest.raises(StoreError, match="another run is writing to it"):
            study(20 * CHUNK).run(store=folder)
        process.kill()
    study(2 * CHUNK, seed=1).run(store=tmp_path / "other")
    inside, go = threading.Event(), threading.Event()

    class Waiting:
        def satisfied(self, counts, trials):
            inside.set()
            return go.wait(20)

    thread = threading.Thread(target=lambda: study(2 * CHUNK, seed=1).run(store=tmp_path / "other", until=Waiting()))
    thread.start()
    try:
        assert inside.wait(20)
        with pytest.raises(StoreError, match="another run is writing to it"):
            study(2 * CHUNK, seed=1).run(store=tmp_path / "other")
        assert tadcore.load_study(tmp_path / "other").trials == 2 * CHUNK  # readers are welcome
    finally:
        go.set()
        thread.join()


@contextmanager
def small_files(most):
    """Files that cannot grow past some size, which the system refuses as it does on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_a_full_disk_leaves_nothing_half_written(tmp_path, clean):
    folder = tmp_path / "store"
    study(CHUNK).run(store=folder)
    before = parts(folder)
    with small_files(20_000), pytest.raises(StoreError, match=r"part-[-\d]+\.parquet: it cannot be written") as caught:
        study().run(store=folder)
    assert isinstance(caught.value.__cause__, OSError)
    assert parts(folder) == before
    assert not list(folder.glob(".*"))
    assert study().run(store=folder).table.equals(clean[0].table)
    assert parts(folder) == parts(clean[1])


@contextmanager
def nobody():
    """Rights of an ordinary user, whom read-only folders stop; the superuser walks through them."""
    was = os.geteuid()
    if was == 0:
        os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(was)


def test_a_store_that_cannot_be_written_is_refused(copied, tmp_path):
    (tmp_path / "taken").write_text("", encoding="utf-8")
    with pytest.raises(StoreError, match="it cannot be written"):
        study().run(store=tmp_path / "taken")
    copied.chmod(0o555)
    (copied / "_store.lock").unlink(missing_ok=True)
    with nobody(), pytest.raises(StoreError, match="it cannot be written"):
        study(3 * CHUNK).run(store=copied)
    copied.chmod(0o755)


def test_a_callable_is_known_by_its_name_and_source(tmp_path):
    wanted = study(100, vary={"attacker.position": ring})
    result = wanted.run(store=tmp_path)
    said = Manifest.read(tmp_path).vary["attacker.position"]
    assert said["callable"] == "study_cases.ring"
    assert set(said) == {"callable", "source", "draws"}
    assert wanted.replace(trials=200).run(store=tmp_path).table.slice(0, 100).equals(result.table)
    loaded = tadcore.load_study(tmp_path)
    assert loaded.replay(5).outcome.time == result.time[5]
    with pytest.raises(tadcore.ScenarioError, match="given again as the object itself"):
        loaded.study.run()


def shifted(by):
    """Functions of one name and one source."""
    return lambda rng, size: ring(rng, size) + by


def drawn_from(values):
    return stats.rv_histogram(np.histogram(values, bins=5))()


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (ring, shifted(0.0)),
        (shifted(0.0), shifted(1.0)),
        (drawn_from([0.0, 1.0, 1.0, 2.0]), drawn_from([0.0, 1.0, 2.0, 2.0])),
        (stats.Normal(mu=0.0, sigma=1.0), stats.Normal(mu=0.0, sigma=1.5)),
        (stats.multivariate_t([0, 0], df=4), stats.multivariate_t([0, 0], df=5)),
        (stats.norm(0, 1), stats.norm(0, 2)),
    ],
)
def test_what_has_no_parameters_is_known_by_what_it_draws(tmp_path, one, other):
    result = study(100, vary={"attacker.position": one}).run(store=tmp_path)
    assert study(100, vary={"attacker.position": one}).run(store=tmp_path).table.equals(result.table)
    assert tadcore.load_study(tmp_path).replay(7).outcome.time == result.time[7]
    with pytest.raises(StoreError, match="its vary differ"):
        study(100, vary={"attacker.position": other}).run(store=tmp_path)


def test_infinite_radii_and_distributions_come_back(tmp_path):
    vary = {
        "defenders.0.visibility_radius": Choice([1.0, np.inf]),
        "defenders.1.visibility_radius": stats.triang(0.5, 1.0, scale=2),
        "target.position": stats.norm(loc=[0, 1], scale=0.1),
    }
    result = study(300, vary=vary).run(store=tmp_path)
    loaded = tadcore.load_study(tmp_path)
    assert "Infinity" not in (tmp_path / "_manifest.json").read_text(encoding="utf-8")
    assert loaded.study.run(store=tmp_path).table.equals(result.table)
    assert loaded.study.run().table.equals(result.table)
