"""Stores at URLs, in memory and on a server of S3, are those of a folder; leases where there are no locks."""

import concurrent.futures as futures
import json
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from pyarrow import fs

import tadcore
from study_cases import CHUNK, parts, study, to_kill
from tadcore import ScenarioError, StoreError
from tadcore.cli.app import main
from tadcore.study import lease, merge_store, verify_store
from tadcore.study.keepers import RowKeeper
from tadcore.study.lock import LOCK
from tadcore.study.parts import Joined
from tadcore.study.remote import Remote
from tadcore.study.where import as_place

HERE = Path(__file__).parents[1]
TRIALS = 5 * CHUNK + 50
SERVER = """
import logging, time
from moto.server import ThreadedMotoServer
logging.getLogger("werkzeug").setLevel(logging.ERROR)
server = ThreadedMotoServer("127.0.0.1", 0, verbose=False)
server.start()
print(server.get_host_and_port()[1], flush=True)
time.sleep(3600)
"""


class S3:
    """A bucket on a server of this machine."""

    def __init__(self, port):
        self.query = f"?endpoint_override=127.0.0.1:{port}&scheme=http&region=us-east-1"
        self.files, _ = fs.FileSystem.from_uri(f"s3://studies{self.query}&allow_bucket_creation=true")
        self.files.create_dir("studies")

    def url(self, name):
        return f"s3://studies/{name}{self.query}"

    def objects(self, name, begin="part-"):
        found = self.files.get_file_info(fs.FileSelector(f"studies/{name}", allow_not_found=True))
        wanted = [info for info in found if info.base_name.startswith(begin)]
        return {info.base_name: self.files.open_input_file(info.path).read() for info in wanted}

    def names(self, name):
        found = self.files.get_file_info(fs.FileSelector(f"studies/{name}", recursive=True))
        return {info.path.removeprefix(f"studies/{name}/") for info in found}

    def put(self, name, content):
        with self.files.open_output_stream(f"studies/{name}") as stream:
            stream.write(content)


@pytest.fixture(scope="module")
def s3():
    pytest.importorskip("moto", reason="moto, which serves S3, is not installed")
    pytest.importorskip("flask_cors", reason="moto's server is not installed")
    with (
        pytest.MonkeyPatch.context() as patch,
        subprocess.Popen([sys.executable, "-W", "ignore", "-c", SERVER], stdout=subprocess.PIPE, text=True) as server,
    ):
        for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
            patch.setenv(name, "testing")
        patch.setenv("AWS_EC2_METADATA_DISABLED", "true")
        try:
            yield S3(int(server.stdout.readline()))
        finally:
            server.kill()


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """The study in a folder."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tadcore.study.parts.GROUP", 2)
        folder = tmp_path_factory.mktemp("alone")
        return study(TRIALS).run(store=folder), folder


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Parts of two chunks, and leases that are renewed often."""
    monkeypatch.setattr("tadcore.study.parts.GROUP", 2)
    monkeypatch.setattr(lease, "BEAT", 0.2)
    monkeypatch.setattr(lease, "SILENCE", 1.0)


def test_a_store_of_objects_is_that_of_a_folder(s3, alone, monkeypatch):
    url = s3.url("whole")
    assert study(3 * CHUNK).run(store=url).trials == 3 * CHUNK
    assert study(TRIALS).run(store=url).table.equals(alone[0].table)  # extended
    assert s3.objects("whole") == parts(alone[1])
    assert s3.names("whole") == {"_manifest.json", *parts(alone[1])}
    loaded = tadcore.load_study(url)
    assert loaded.table.equals(alone[0].table)
    assert repr(loaded) == repr(alone[0])
    assert verify_store(url) == TRIALS
    monkeypatch.setattr("tadcore.study.keepers.EAGER", 100)
    pieces = list(tadcore.load_study(url).pieces())
    assert [len(piece) for piece in pieces] == [2 * CHUNK, 2 * CHUNK, CHUNK + 50]
    assert tadcore.load_study(url).tally == alone[0].tally
    assert tadcore.load_study(url).setup(9000) == alone[0].setup(9000)


@pytest.mark.parametrize("keep", ["all", "outcomes", "counts"])
def test_jobs_without_a_common_disk_share_a_bucket(s3, tmp_path, keep):
    whole = study(TRIALS).run(store=tmp_path, keep=keep)
    for i in (2, 1):
        study(TRIALS).run(store=s3.url(keep), keep=keep, part=(i, 2))
    assert not s3.objects(keep)
    merged = merge_store(s3.url(keep))
    assert (merged.parts, merged.trials, merged.wanted) == (2, TRIALS, TRIALS)
    assert s3.objects(keep) == parts(tmp_path)
    assert s3.objects(keep, "counts-") == {path.name: path.read_bytes() for path in tmp_path.glob("counts-*")}
    assert len(s3.names(keep)) == 1 + len(list(tmp_path.glob("[!_]*")))
    assert tadcore.load_study(s3.url(keep)).tally == whole.tally


@pytest.mark.parametrize("way", ["spawn", "fork"])
def test_workers_write_to_a_bucket(s3, alone, way, monkeypatch):
    """A forked process cannot use its parent's connections: it sends its rows."""
    if way not in multiprocessing.get_all_start_methods():
        pytest.skip(f"this system has no {way}")
    seen, add = [], RowKeeper.add
    monkeypatch.setattr(RowKeeper, "add", lambda keeper, played: (seen.append(played), add(keeper, played))[1])
    with futures.ProcessPoolExecutor(2, mp_context=multiprocessing.get_context(way)) as pool:
        result = study(TRIALS).run(store=s3.url(way), executor=pool)
    assert all(bool(one.written) == (way == "spawn") for one in seen if not isinstance(one, Joined))
    assert result.table.equals(alone[0].table)
    assert s3.objects(way) == parts(alone[1])
    assert s3.names(way) == {"_manifest.json", *parts(alone[1])}


@pytest.mark.filterwarnings("ignore")  # what Dask warns of while it starts and stops is its own affair
def test_a_dask_cluster_writes_to_a_bucket(s3, alone):
    distributed = pytest.importorskip("distributed")
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None, "silence_logs": 50}
    with distributed.LocalCluster(processes=True, **options) as cluster, distributed.Client(cluster) as client:
        result = study(TRIALS).run(store=s3.url("dask"), executor=client.get_executor())
    assert result.table.equals(alone[0].table)
    assert s3.objects("dask") == parts(alone[1])


KILLED = to_kill(group=2, pause=0.1)


def child(url):
    path = os.pathsep.join([str(HERE), str(Path(tadcore.__file__).parents[1])])
    return subprocess.Popen([sys.executable, "-c", KILLED, url], env={**os.environ, "PYTHONPATH": path})


def test_kill_9_is_resumed_and_meanwhile_the_store_is_in_use(s3, tmp_path, monkeypatch):
    monkeypatch.setattr(lease, "SILENCE", 60.0)
    with child(s3.url("killed")) as process:
        while process.poll() is None and len(s3.objects("killed")) < 2:
            time.sleep(0.02)
        owner = json.loads(s3.objects("killed", LOCK)[LOCK])
        assert owner["pid"] == process.pid
        s3.put(f"killed/{LOCK}", json.dumps(owner | {"machine": "another"}).encode())
        waiting = threading.Timer(0.5, lambda: s3.put(f"killed/{LOCK}", json.dumps(owner | {"beat": 1}).encode()))
        waiting.start()
        with pytest.raises(StoreError, match=rf"another run is writing to it: process {process.pid} on .*; wait for"):
            study(20 * CHUNK).run(store=s3.url("killed"))
        waiting.join()
        process.send_signal(signal.SIGKILL)
    there = s3.objects("killed")
    began = time.monotonic()
    study(20 * CHUNK).run(store=s3.url("killed"))
    assert time.monotonic() - began < 30.0  # a dead process of this machine is not waited for
    study(20 * CHUNK).run(store=tmp_path)
    assert there.items() <= s3.objects("killed").items()
    assert s3.objects("killed") == parts(tmp_path)


def test_a_damaged_object_is_named_and_a_missing_one_played_again(s3, alone):
    url = s3.url("damaged")
    study(TRIALS).run(store=url)
    name, content = next(iter(s3.objects("damaged").items()))
    s3.put(f"damaged/{name}", content[:-9])
    for use in (tadcore.load_study, verify_store, lambda url: study(TRIALS).run(store=url)):
        with pytest.raises(StoreError, match="truncated or no Parquet file") as caught:
            use(url)
        assert caught.value.path == f"s3://studies/damaged/{name}"
    s3.files.delete_file(f"studies/damaged/{name}")
    assert study(TRIALS).run(store=url).table.equals(alone[0].table)
    with pytest.raises(StoreError, match="it holds another study"):
        study(TRIALS, seed=8).run(store=url)


def test_the_command_line_takes_urls(s3, tmp_path, capsys):
    study(3).scenario.to_toml(tmp_path / "calm.toml")
    file = tmp_path / "study.toml"
    vary = '[vary]\n"attacker.position" = { box = [[-3, -3], [3, 3]] }\n'
    file.write_text(f'scenario = "calm.toml"\ntrials = {2 * CHUNK}\n{vary}')
    url = s3.url("commands")
    page = tmp_path / "page.html"
    steps = (
        ["study", str(file), "--store", url, "--part", "1/2"],
        ["study", str(file), "--store", url, "--part", "2/2"],
        ["store", "merge", url],
        ["store", "verify", url],
        ["study", str(file), "--store", url, "--resume"],
        ["report", url, "--out", str(page)],
    )
    for step in steps:
        with pytest.raises(SystemExit, match="0"):
            main(step)
    said = " ".join(capsys.readouterr().out.split())
    assert f"2 parts merged: {2 * CHUNK:,} of {2 * CHUNK:,} trials" in said
    assert "all as they were written" in said
    assert page.stat().st_size > 10_000


def test_memory_holds_a_store_through_fsspec(alone):
    pytest.importorskip("fsspec")
    url = "memory://studies/whole"
    with futures.ThreadPoolExecutor(2) as pool:
        assert study(TRIALS).run(store=url, executor=pool).table.equals(alone[0].table)
    assert tadcore.load_study(url, storage_options={}).table.equals(alone[0].table)
    assert as_place("store", url).names() == ["_manifest.json", *parts(alone[1])]
    for i in (1, 2):
        study(TRIALS).run(store="memory://studies/parts", part=(i, 2), storage_options={})
    assert merge_store("memory://studies/parts", storage_options={}).trials == TRIALS
    assert verify_store("memory://studies/parts", storage_options={}) == TRIALS
    assert as_place("store", "memory://studies/parts").names() == ["_manifest.json", *parts(alone[1])]


def test_a_file_url_is_a_folder(tmp_path, alone):
    study(TRIALS).run(store=f"file://{tmp_path}/a%20b")
    assert parts(tmp_path / "a b") == parts(alone[1])


@pytest.mark.parametrize(
    ("store", "options", "words"),
    [
        ("nope://somewhere", None, "store: got 'nope://somewhere', must be a URL that Arrow or fsspec can open"),
        ("s3://bucket/x?colour=red", None, "Unexpected query parameter"),
        (Path("s3://bucket/x"), None, "a URL as a string: pathlib makes one slash of its two"),
        ("here", {"key": "hidden"}, "storage_options: got 'key', must be left out: here is a folder"),
        ("memory://x", ["key"], "storage_options: got 'list', must be a mapping"),
        ("memory://x", {"nonsense": 1, "key": "hidden"}, None),
    ],
)
def test_places_that_are_none_are_refused(store, options, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    if words is None:
        assert study(100).run(store=store, storage_options=options).trials == 100  # fsspec's memory takes anything
        return
    with pytest.raises(ScenarioError, match=words) as caught:
        study(100).run(store=store, storage_options=options)
    assert "hidden" not in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_messages_hold_no_credentials(s3):
    place = as_place("store", f"s3://me:hidden@nobody/x{s3.query}")
    assert (str(place), place.at("y"), str(place.inside("z"))) == (
        "s3://nobody/x",
        "s3://nobody/x/y",
        "s3://nobody/x/z",
    )
    with pytest.raises(
        StoreError, match=r"s3://nobody/x: it cannot be written or read \(there is no bucket nobody"
    ) as caught:
        study(100).run(store=f"s3://me:hidden@nobody/x{s3.query}")
    assert "hidden" not in str(caught.value)


def memory(name):
    pytest.importorskip("fsspec")
    return Remote(f"memory://leases/{name}")


def test_of_two_runs_one_has_the_place():
    place, other = memory("two"), memory("two")
    with place.alone():
        assert LOCK in place.names()
        with pytest.raises(StoreError, match=f"another run is writing to it: process {os.getpid()} on"), other.alone():
            pytest.fail("both have it")
        place.write("_x", "1")
    assert LOCK not in place.names()


def test_a_lease_that_is_renewed_while_it_is_read_is_read_again():
    whole = b'{"token": "a", "beat": 10}'

    class Torn:
        reads = 0

        def read(self, name, most):
            self.reads += 1
            return whole[:-1] if self.reads < 3 else whole

    place = Torn()
    assert lease._read(place) == json.loads(whole)
    assert place.reads == 3


@pytest.mark.parametrize("left", [b"no lease", b"[]", b"{}", json.dumps({"pid": 1, "machine": "another"}).encode()])
def test_a_lease_that_is_not_renewed_is_taken_over(left):
    place = memory("silent")
    place.write(LOCK, left)
    began = time.monotonic()
    with place.alone():
        assert time.monotonic() - began >= lease.SILENCE
        assert json.loads(place.read(LOCK, 4096))["pid"] == os.getpid()


def test_a_run_whose_lease_was_taken_writes_no_more():
    place = memory("taken")
    with place.alone():
        memory("taken").write(LOCK, json.dumps({"token": "x", "pid": 7, "host": "far", "since": "noon"}))
        until = time.monotonic() + 10.0
        while place._lease.lost is None and time.monotonic() < until:
            time.sleep(0.02)
        with pytest.raises(StoreError, match=r"process 7 on far, there since noon, has taken it over"):
            place.write("_x", "1")
    assert json.loads(place.read(LOCK, 4096))["token"] == "x"  # it is not this run's to remove


def test_a_service_that_fails_for_a_while_does_not_end_a_lease(monkeypatch):
    place, fail = memory("failing"), [2]
    read = Remote.read

    def failing(self, *given):
        if threading.current_thread().name == "tadcore-lease" and fail[0]:
            fail[0] -= 1
            raise OSError("no route")
        return read(self, *given)

    monkeypatch.setattr(Remote, "read", failing)
    with place.alone():
        until = time.monotonic() + 10.0
        while json.loads(place.read(LOCK, 4096))["beat"] < 2 and time.monotonic() < until:
            time.sleep(0.02)
        assert json.loads(place.read(LOCK, 4096))["beat"] >= 2
        place.write("_x", "1")
