"""Studies in parts, each by a job of its own, and many workers: what comes of them is the study of one process."""

import concurrent.futures as futures
import itertools
import shutil
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import tadcore
from study_cases import CHUNK, study
from tadcore import ScenarioError, StoreError
from tadcore.cli.app import main
from tadcore.statistics import Tally
from tadcore.study import merge_store
from tadcore.study.part import chunks_of
from tadcore.study.parts import Part
from tadcore.study.store import Store
from tadcore.study.task import Outcomes, Played
from tadcore.study.workers import Groups, Wanted, played_by

TRIALS = 7 * CHUNK + 11
KEEPS = ("all", "outcomes", "counts")


def files(folder):
    return {path.name: path.read_bytes() for path in Path(folder).glob("[!_]*")}


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Parts of three chunks, which the parts of a study do not respect."""
    monkeypatch.setattr("tadcore.study.parts.GROUP", 3)


@pytest.mark.parametrize("trials", [1, CHUNK, 5 * CHUNK + 1, 10**9])
@pytest.mark.parametrize("n", [1, 2, 3, 7, 100])
def test_parts_are_all_of_a_study_once(trials, n):
    covered = [chunks_of((i, n), trials) for i in range(1, n + 1)]
    assert covered[0].start == 0
    assert covered[-1].stop == -(-trials // CHUNK)
    assert all(one.stop == other.start for one, other in itertools.pairwise(covered))
    sizes = [len(chunks) for chunks in covered]
    assert max(sizes) - min(sizes) <= 1


@pytest.mark.parametrize("keep", KEEPS)
def test_merged_parts_are_the_study(keep, tmp_path):
    whole = study(TRIALS).run(store=tmp_path / "whole", keep=keep)
    found = [study(TRIALS).run(store=tmp_path / "parts", keep=keep, part=(i, 3), threads=1) for i in (3, 1, 2)]
    assert sum(part.trials for part in found) == TRIALS
    assert {name: sum(part.counts().get(name, 0) for part in found) for name in whole.counts()} == whole.counts()
    assert not files(tmp_path / "parts")  # readers of Parquet see nothing until all is there
    merged = merge_store(tmp_path / "parts")
    assert (merged.parts, merged.trials, merged.wanted) == (3, TRIALS, TRIALS)
    assert files(tmp_path / "parts") == files(tmp_path / "whole")
    assert {path.name for path in (tmp_path / "parts").glob("_*")} <= {"_manifest.json", "_store.lock"}
    assert tadcore.load_study(tmp_path / "parts").tally == whole.tally


def test_parts_are_listed_while_another_thread_adds_some(tmp_path, monkeypatch):
    """Two threads write: one looks through thousands of parts for those of its group while the other adds its own."""
    monkeypatch.setattr("tadcore.study.parts.GROUP", 1)
    there = [Part(i * CHUNK, (i + 1) * CHUNK) for i in range(99, 9999)]
    found = Store._found
    monkeypatch.setattr(Store, "_found", lambda store: found(store) | set(there))
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        study(16 * CHUNK).run(store=tmp_path, keep="outcomes")
    finally:
        sys.setswitchinterval(interval)
    assert len(files(tmp_path)) == 16


@pytest.mark.parametrize("keep", KEEPS)
def test_a_part_that_is_missing_is_played_or_merged_later(keep, tmp_path, monkeypatch):
    whole = study(TRIALS).run(store=tmp_path / "whole", keep=keep)
    for i in (1, 3):
        study(TRIALS).run(store=tmp_path / "parts", keep=keep, part=(i, 3))
    later = shutil.copytree(tmp_path / "parts", tmp_path / "later")
    merged = merge_store(tmp_path / "parts")
    assert (merged.parts, merged.trials, merged.wanted) == (2, 2 * CHUNK, TRIALS)
    assert study(TRIALS).run(store=tmp_path / "parts", keep=keep).tally == whole.tally
    assert merge_store(later).trials == 2 * CHUNK
    study(TRIALS).run(store=later, keep=keep, part=(2, 3))
    monkeypatch.setattr("tadcore.study.plan.Plan.play", lambda *_: pytest.fail("a game was played"))
    assert merge_store(later).trials == TRIALS
    assert files(later) == files(tmp_path / "whole")


def test_a_part_goes_on_where_it_was_cut_off(tmp_path, monkeypatch):
    study(TRIALS).run(store=tmp_path, part=(2, 2))
    monkeypatch.setattr("tadcore.study.plan.Plan.play", lambda *_: pytest.fail("a game was played"))
    again = study(TRIALS).run(store=tmp_path, part=(2, 2))
    assert (again.part, again.first, again.trials) == ((2, 2), 4 * CHUNK, 3 * CHUNK + 11)
    assert repr(again).startswith("StudyPart(2 of 2: 24,587 trials from 32,768 on: ")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"part": (0, 3)}, r"part\[0\]: got 0, must be a whole number in \[1, 3\]"),
        ({"part": (4, 3)}, r"part\[0\]: got 4"),
        ({"part": (1, 0)}, r"part\[1\]: got 0"),
        ({"part": 3}, r"part: got 3, must be \(i, n\)"),
        ({"part": (1, 2), "store": None}, "part: .*given with store"),
        ({"part": (1, 2), "until": tadcore.HalfWidth(0.1)}, "until: .*a part has only its own"),
    ],
)
def test_parts_that_are_none_are_refused(options, words, tmp_path):
    with pytest.raises(ScenarioError, match=words):
        study(100).run(**{"store": tmp_path / "store", **options})
    assert not (tmp_path / "store").exists()


def test_parts_of_other_studies_are_not_merged(tmp_path):
    with pytest.raises(StoreError, match="it holds no parts of a study"):
        merge_store(tmp_path)
    study(TRIALS).run(store=tmp_path, part=(1, 2))
    study(TRIALS, seed=8).run(store=tmp_path, part=(2, 2))
    with pytest.raises(StoreError, match="another study"):
        merge_store(tmp_path)
    shutil.rmtree(tmp_path / "_part-00002-of-00002")
    study(TRIALS + 1).run(store=tmp_path, part=(2, 2))
    with pytest.raises(
        StoreError, match=r"it is of a study of 57,356 trials, and _part-00001-of-00002 of one of 57,355"
    ):
        merge_store(tmp_path)


def test_the_command_line_plays_and_merges_parts(tmp_path, capsys):
    study(3).scenario.to_toml(tmp_path / "calm.toml")
    file = tmp_path / "study.toml"
    file.write_text(
        f'scenario = "calm.toml"\ntrials = {TRIALS}\nkeep = "counts"\n'
        '[vary]\n"attacker.position" = { box = [[-3, -3], [3, 3]] }\n'
    )
    for part in ("1/2", "2/2"):
        with pytest.raises(SystemExit, match="0"):
            main(["study", str(file), "--store", str(tmp_path / "out"), "--part", part])
        assert "tadcore store merge" in " ".join(capsys.readouterr().out.split())
    with pytest.raises(SystemExit, match="0"):
        main(["store", "merge", str(tmp_path / "out")])
    assert f"2 parts merged: {TRIALS:,} of {TRIALS:,} trials" in " ".join(capsys.readouterr().out.split())
    assert tadcore.load_study(tmp_path / "out").tally == tadcore.Study.from_toml(file).run().tally
    with pytest.raises(SystemExit, match="2"):
        main(["study", str(file), "--store", str(tmp_path / "out"), "--part", "1"])
    assert "I/N, such as 3/100" in " ".join(capsys.readouterr().err.split())


class Instant:
    """A game whose outcomes are there at once."""

    def simulate_batch(self, starts, *_, **__):
        m = len(starts)
        return (*(np.zeros(m, dtype=t) for t in (np.int8, np.int32)), np.ones(m), *(np.zeros(m, dtype=bool),) * 2)

    def equilibrium(self):
        """Nothing to solve."""


def test_groups_last_as_long_as_they_should_and_shrink_to_the_end():
    wanted = Wanted(range(2000), 2000 * CHUNK, "outcomes", apart=False)
    groups, sizes = Groups(wanted, 4, seconds=1.0), []
    while (task := groups.take()) is not None:
        sizes.append(len(task.chunks()))
        groups.note(played_of(task, seconds=len(task.chunks()) / 20))  # 20 chunks a second
    assert sum(sizes) == 2000
    assert sizes[0] == 1
    assert set(sizes[1:90]) <= {19, 20}  # by the rounding of the speed
    assert sizes[-1] == 1
    assert sizes[-40:] == sorted(sizes[-40:], reverse=True)


def played_of(task, seconds):
    return Played(task, (), (), seconds)


class Crowd(futures.Executor):
    """A thousand workers that have every answer at once: what a head can take from them."""

    _max_workers = 1000

    def __init__(self, steps):
        self.groups, self.steps = [], steps
        self.tally = None

    def submit(self, fn, /, sent, task, threads):
        future = futures.Future()
        if self.tally is None:
            rng = np.random.default_rng(0)
            kind, step = rng.integers(0, 3, 10**5), rng.integers(0, self.steps + 1, 10**5)
            self.tally = Tally.of(kind, np.where(kind == 2, 0, -1), np.zeros(10**5, bool), step, 3, self.steps)
        scaled = Tally(3, self.steps, self.tally.cells, self.tally.count * 0)
        scaled.count[0] = task.trials
        self.groups.append(task.trials)
        future.set_result(Played(task, (scaled,), (), task.trials / 2e5))  # as fast as two cores
        return future


@pytest.mark.parametrize("steps", [20, 1200])
def test_a_head_takes_what_a_thousand_workers_give(steps):
    """Also on the grid of the paper, where a tally has thousands of cells."""
    wanted = study(2 * 10**9, keep="counts", sc=study().scenario.replace(step=1.0 / steps))
    crowd = Crowd(steps)
    began = time.process_time()
    result = wanted.run(executor=crowd)
    took = time.process_time() - began
    assert result.trials == 2 * 10**9 == sum(crowd.groups)
    assert 2 * 10**9 / took > 2e8


def test_threads_are_all_at_work_and_none_is_left():
    """More threads than chunks share the chunks; Ctrl-C and errors leave no thread behind."""
    before = threading.active_count()
    seen = []
    plan = study(3 * CHUNK).plan
    real = plan.run

    def run(task, threads, stop=None):
        seen.append(threads)
        return real(task, threads, stop)

    object.__setattr__(plan, "run", run)
    assert len(list(played_by(plan, Wanted(range(3), 3 * CHUNK, "counts", apart=False), None, 8))) == 3
    assert sum(seen[:3]) >= 6
    broken = played_by(plan, Wanted(range(3), 3 * CHUNK, "counts", apart=False), None, 2)
    next(broken)
    broken.close()
    assert threading.active_count() == before


def test_workers_read_the_saved_table(tmp_path):
    whole = study(100).run(table=tmp_path / "gains")
    with futures.ThreadPoolExecutor(1) as pool:
        assert study(100).run(executor=pool, table=tmp_path / "gains").tally == whole.tally


def test_outcomes_and_their_counts_are_of_one_chunk(monkeypatch):
    monkeypatch.setattr("tadcore.study.plan.Plan.game", Instant())
    plan = study(CHUNK).plan
    assert isinstance(plan.play(plan.draw(0), 0, 1), Outcomes)
