"""Studies on executors: threads, spawned processes, Dask, MPI; workers that die; what cannot be sent."""

import concurrent.futures as futures
import multiprocessing
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import tadcore
from study_cases import CHUNK, FLAG, lethal, parts, study
from tadcore import ScenarioError, WorkerError

HERE = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def here():
    """The study as this process computes it."""
    return study().run(threads=2)


def spawned(workers=2):
    return futures.ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn"))


def test_spawned_processes_give_the_same_bits(here, tmp_path):
    with spawned() as pool:
        result = study().run(executor=pool, store=tmp_path / "pool")
        short = study(50, design="sobol").run(executor=pool, threads=2)
    assert result.table.equals(here.table)
    assert short.table.equals(study(50, design="sobol").run().table)
    study().run(store=tmp_path / "alone")
    assert parts(tmp_path / "pool") == parts(tmp_path / "alone")


def test_threads_give_the_same_bits_and_stop_at_the_same_chunk(here):
    class One:
        def satisfied(self, counts, trials):
            return trials >= CHUNK

    with futures.ThreadPoolExecutor(2) as pool:
        assert study().run(executor=pool).table.equals(here.table)
        assert study().run(executor=pool, until=One()).table.equals(here.table.slice(0, CHUNK))


class Counting(futures.ThreadPoolExecutor):
    """An executor that notes how many chunks are in flight."""

    def __init__(self):
        super().__init__(2)
        self.most = self.running = 0

    def submit(self, fn, /, *args, **kwargs):
        self.running += 1
        self.most = max(self.most, self.running)
        future = super().submit(fn, *args, **kwargs)
        future.add_done_callback(self._done)
        return future

    def _done(self, future):
        self.running -= 1


def test_few_chunks_are_in_flight():
    with Counting() as pool:
        result = study(8 * CHUNK).run(executor=pool)
    assert 2 <= pool.most <= 4
    assert result.table.equals(study(8 * CHUNK).run().table)


class Backwards(futures.Executor):
    """An executor that finishes what it was given in the reverse order."""

    def __init__(self):
        self.given = []

    def submit(self, fn, /, *args, **kwargs):
        future = futures.Future()
        self.given.append((future, fn, args, kwargs))
        if len(self.given) == 3:
            for waiting, call, arguments, options in reversed(self.given):
                waiting.set_result(call(*arguments, **options))
        return future


def test_the_order_in_which_chunks_finish_does_not_matter(here, tmp_path):
    assert study().run(executor=Backwards(), store=tmp_path).table.equals(here.table)


@pytest.fixture
def flag(tmp_path, monkeypatch):
    """A file that makes the first worker process that sees it die."""
    place = tmp_path / "flag"
    place.touch()
    monkeypatch.setenv(FLAG, str(place))
    return place


def dying(trials=4 * CHUNK):
    return study(trials, vary={"attacker.position": lethal})


def test_a_worker_that_dies_loses_nothing_that_was_finished(flag, tmp_path):
    flag.unlink()
    store = tmp_path / "store"
    dying(2 * CHUNK).run(store=store)
    before = parts(store)
    flag.touch()
    with spawned(1) as pool, pytest.raises(WorkerError, match="run the study again with this store") as caught:
        dying().run(executor=pool, store=store)
    assert not flag.exists()
    assert (caught.value.done, caught.value.chunks, caught.value.store) == (2, 4, str(store))
    assert parts(store) == before
    with spawned(1) as pool:
        result = dying().run(executor=pool, store=store)
    whole = dying().run(store=tmp_path / "whole")
    assert result.table.equals(whole.table)
    assert parts(store) == parts(tmp_path / "whole")


def test_without_a_store_a_dead_worker_says_that_a_store_would_help(flag):
    with spawned(1) as pool, pytest.raises(WorkerError, match="with store=… a study keeps them"):
        dying().run(executor=pool)


def test_what_cannot_be_sent_is_named():
    with spawned(1) as pool, pytest.raises(ScenarioError, match=r'vary\["attacker\.position"\]: .*top of a module'):
        study(10, vary={"attacker.position": lambda rng, size: rng.uniform(-1, 1, (size, 2))}).run(executor=pool)


def test_an_error_of_a_callable_comes_through_as_it_is():
    calls = []

    def late(rng, size):
        calls.append(size)
        if len(calls) > 3:
            raise OSError("the map is gone")
        return rng.uniform(-1, 1, (size, 2))

    with futures.ThreadPoolExecutor(1) as pool, pytest.raises(OSError, match="the map is gone") as caught:
        study(2 * CHUNK, vary={"attacker.position": late}).run(executor=pool)
    assert "chunk 1" in caught.value.__notes__[0]


@pytest.mark.filterwarnings("ignore")  # what Dask warns of while it starts and stops is its own affair
def test_a_dask_cluster_gives_the_same_bits_and_outlives_a_worker(here, flag, tmp_path):
    distributed = pytest.importorskip("distributed")
    flag.unlink()
    cluster = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
    )
    with cluster, distributed.Client(cluster) as client:
        assert study().run(executor=client.get_executor()).table.equals(here.table)
        flag.touch()
        result = dying().run(executor=client.get_executor(), store=tmp_path / "dask")
        assert not flag.exists()  # a worker died, and Dask gave its chunk to another
        cluster.scheduler.allowed_failures = 0
        flag.touch()
        with pytest.raises(WorkerError, match="KilledWorker"):
            dying().run(executor=client.get_executor())
        with pytest.raises(ScenarioError, match=r"client\.get_executor\(\)"):
            study().run(executor=client)
    dying().run(store=tmp_path / "alone")
    assert parts(tmp_path / "dask") == parts(tmp_path / "alone")
    assert result.table.equals(tadcore.load_study(tmp_path / "alone").table)


MPI = """
import sys
from mpi4py.futures import MPIPoolExecutor
from study_cases import study
if __name__ == "__main__":
    with MPIPoolExecutor() as pool:
        study().run(executor=pool, store=sys.argv[1])
"""


def test_mpi_gives_the_same_bits(here, tmp_path):
    pytest.importorskip("mpi4py", reason="MPI is not present")
    mpiexec = shutil.which("mpiexec", path=os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]))
    if mpiexec is None:
        pytest.skip("MPI is not present: no mpiexec")
    script = tmp_path / "study_mpi.py"
    script.write_text(MPI, encoding="utf-8")
    command = [mpiexec, "-n", "2", sys.executable, "-m", "mpi4py.futures", script, tmp_path / "store"]
    path = os.pathsep.join([str(HERE), os.environ.get("PYTHONPATH", "")])
    root = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    done = subprocess.run(
        command,
        env={**os.environ, "PYTHONPATH": path, **root},
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert tadcore.load_study(tmp_path / "store").table.equals(here.table)
