"""What the faults share: the study, its undisturbed run, a process that can be killed, and the comparison."""

import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "python"))

import pyarrow as pa  # noqa: E402

import tadcore  # noqa: E402
import tadcore.study.parts  # noqa: E402
from study_cases import CHUNK, part, parts, study  # noqa: E402
from tadcore import StoreError, WorkerError  # noqa: E402

__all__ = [
    "CHUNK",
    "INSIDE",
    "TRIALS",
    "Bench",
    "WrongError",
    "child",
    "insist",
    "ipc",
    "part",
    "parts",
    "refused",
    "study",
]

tadcore.study.parts.GROUP = 1  # a part for every chunk, so that a fault meets one among many
TRIALS = 60 * CHUNK + 123
RUN = """
import sys
import tadcore
from study_cases import study
from tadcore.study import parts
parts.GROUP = 1
print("ready", flush=True)
try:
    study({trials}).run(store=sys.argv[1], threads=1)
except tadcore.StoreError as error:
    print(error, file=sys.stderr)
    sys.exit(3)
"""
# The process kills itself inside the writing of its second part: at the stage that is given.
INSIDE = """
import os, signal, sys
from pathlib import Path
stage, calls = sys.argv[2], 0
def armed(of, name):
    call = getattr(of, name)
    def instead(*given, **options):
        global calls
        calls += stage != "create" or ".tadcore-" in str(given[0])  # of all that is opened, what is to be written
        if calls == 4:  # the manifest, the first part, then the second (each is synced twice: the file, its folder)
            os.kill(os.getpid(), signal.SIGKILL)
        return call(*given, **options)
    setattr(of, name, instead)
of, name = {"create": (os, "open"), "sync": (os, "fsync"), "rename": (Path, "replace")}[stage]
armed(of, name)
"""


class WrongError(AssertionError):
    """What came of a fault is not what was promised."""


def insist(holds, words):
    if not holds:
        raise WrongError(words)


def child(folder, source=None, *more):
    """A process that runs the study; this returns when it is about to begin."""
    path = os.pathsep.join([str(Path(tadcore.__file__).parents[1]), str(ROOT / "tests" / "python")])
    code = (source or "") + RUN.format(trials=TRIALS)
    process = subprocess.Popen(
        [sys.executable, "-c", code, folder, *more],
        env={**os.environ, "PYTHONPATH": path},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    process.stdout.readline()
    return process


def ipc(table):
    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, table.schema) as stream:
        stream.write_table(table.combine_chunks())
    return sink.getvalue().to_pybytes()


class Bench:
    """One undisturbed run, and stores to be spoiled beside it."""

    def __init__(self, place, kills, rng):
        self.place, self.kills, self.rng = place, kills, rng
        began = time.perf_counter()
        self.whole = study(TRIALS).run(store=place / "whole", threads=1)
        self.length = time.perf_counter() - began
        self.bytes, self.parts = ipc(self.whole.table), parts(place / "whole")

    def fresh(self, name, copy=False):
        folder = self.place / name
        return Path(shutil.copytree(self.place / "whole", folder)) if copy else folder

    def same(self, folder):
        """Finish what is in the folder and compare it with the undisturbed run, in memory, read back and on disk."""
        result = study(TRIALS).run(store=folder, threads=1)
        insist(ipc(result.table) == self.bytes, "the final table differs")
        insist(ipc(tadcore.load_study(folder).table) == self.bytes, "the table read back differs")
        insist(parts(folder) == self.parts, "the parts on disk differ")
        insist(not list(folder.glob(".*")), "a half-written file was left")

    def killer(self, folder, victim):
        """Kill a process some time after the next part has appeared."""

        there, later = len(parts(folder)), self.rng.uniform(0, 0.3)

        def kill():
            while len(parts(folder)) <= there:
                time.sleep(0.005)
            time.sleep(later)
            os.kill(victim, signal.SIGKILL)

        thread = threading.Thread(target=kill)
        thread.start()
        return thread

    def kept(self, before, folder):
        """Parts that were finished before a fault and are not there, to the bit, after it."""
        lost = [name for name, data in before.items() if parts(folder).get(name) != data]
        insist(not lost, f"finished parts were lost: {lost}")


def refused(call, words):
    try:
        call()
    except (StoreError, WorkerError) as error:
        insist(words in str(error), f"the error does not say {words!r}: {error}")
        return str(error)
    raise WrongError(f"nothing was raised; expected an error that says {words!r}")
