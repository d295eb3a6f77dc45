"""Every fault that a long study meets, done to a real one, and one table of what came of it.

    python tests/faults [--kills 50] [--seed 0]

Every fault must end in the outcomes of one undisturbed run, to the bit, or in a `StoreError` or `WorkerError` that
names the place. The script leaves with 1 if one does not. Moments, bits and lengths are drawn from the seed.
"""

import argparse
import concurrent.futures as futures
import multiprocessing
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from bench import CHUNK, INSIDE, TRIALS, Bench, WrongError, child, insist, ipc, part, parts, refused, study

import tadcore
from tadcore import StoreError


def killed(b):
    folder, before, halves, on_the_way = b.fresh("killed"), {}, 0, 0
    for i in range(b.kills):
        with child(folder) as process:
            # Every fifth while the study begins; the others after as many new parts as leave some to the last.
            share = (len(b.parts) - 5 - len(before)) / (b.kills - i)
            wanted = len(before) + int(share + b.rng.random()) if i % 5 else 0
            while len(list(folder.glob("part-*.parquet"))) < wanted and process.poll() is None:
                time.sleep(0.001)
            time.sleep(b.rng.uniform(0, b.length / len(b.parts)))
            process.send_signal(signal.SIGKILL)
        on_the_way += process.returncode == -signal.SIGKILL
        b.kept(before, folder)
        before = parts(folder)
        halves += len(list(folder.glob(".*.*")))
    insist(on_the_way >= 0.9 * b.kills, f"only {on_the_way} runs were still going when killed")
    insist(len(before) > min(b.kills, len(b.parts)) // 2, f"only {len(before)} parts were written between the kills")
    b.same(folder)
    there = f"{len(before)} of {len(b.parts)} were there after the last kill"
    return b.kills, f"no finished part; {there}; {halves} half-written files seen and removed"


def killed_inside(b):
    done = 0
    for stage in ("create", "sync", "rename"):
        folder = b.fresh(f"inside-{stage}")
        for _ in range(3):
            before = parts(folder)
            with child(folder, INSIDE, stage) as process:
                process.wait(120)
            insist(process.returncode == -signal.SIGKILL, f"{stage}: it ended with {process.returncode}")
            b.kept(before, folder)
            done += 1
        b.same(folder)
    return done, "the part being written, never a finished one"


def disk_full(b):
    if os.geteuid() != 0:
        return 0, "skipped: a small file system can be mounted by the superuser only"
    folder = b.fresh("small")
    folder.mkdir()
    done = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=2m", "none", folder], capture_output=True, check=False)
    if done.returncode:
        return 0, f"skipped: {done.stderr.decode().strip()}"
    store = folder / "store"
    try:
        for size in ("2m", "4m", "6m"):
            subprocess.run(["mount", "-o", f"remount,size={size}", folder], check=True)
            before = parts(store)
            error = refused(lambda: study(TRIALS).run(store=store, threads=1), "cannot be written")
            insist("No space left" in error, error)
            b.kept(before, store)
            insist(len(parts(store)) > len(before), "no part fitted")
            insist(not list(store.glob(".*")), "a half-written file was left")
        subprocess.run(["mount", "-o", "remount,size=100m", folder], check=True)
        b.same(store)
        subprocess.run(["mount", "-o", "remount,ro", folder], check=True)
        insist(ipc(tadcore.load_study(store).table) == b.bytes, "a read-only store is not read")
        refused(lambda: study(TRIALS + CHUNK).run(store=store), "cannot be written")
    finally:
        subprocess.run(["umount", "-l", folder], check=True)
    return 3, "the part that did not fit; then read-only: read, and refused to writers"


def read_only(b):
    folder = b.fresh("read-only", copy=True)
    (folder / part(7)).unlink()
    (folder / "_store.lock").unlink(missing_ok=True)
    folder.chmod(0o555)
    b.place.chmod(0o755)
    was = os.geteuid()
    try:
        if was == 0:
            os.seteuid(65534)
        refused(lambda: study(TRIALS).run(store=folder, threads=1), "cannot be written")
        insist(tadcore.load_study(folder).trials == 7 * CHUNK, "what is there is not read")
    finally:
        os.seteuid(was)
        folder.chmod(0o755)
    b.same(folder)
    return 1, "nothing"


def two_writers(b):
    refusals = 0
    for i in range(5):
        folder = b.fresh(f"two-{i}")
        writers = [child(folder) for _ in range(3)]
        ends = [(writer.communicate(timeout=300)[1], writer.returncode) for writer in writers]
        insist(sorted(code for _, code in ends)[0] == 0, f"no writer finished: {ends}")
        for words, code in ends:
            insist(code == 0 or (code == 3 and "another run is writing" in words), f"{code}: {words}")
            refusals += code == 3
        b.same(folder)
    insist(refusals > 0, "no writer met another")
    return 5, f"nothing; of 15 writers {refusals} were refused"


def spoiled(b, name, change, times, harmless):
    """Parts changed on disk, one after another: each is named, or reads as it was written; without it all is well."""
    folder, named = b.fresh(name, copy=True), 0
    for _ in range(times):
        part = b.rng.choice(sorted(b.parts))
        (folder / part).write_bytes(change(bytearray(b.parts[part])))
        for use in (lambda: tadcore.load_study(folder), lambda: study(TRIALS).run(store=folder, threads=1)):
            try:
                table = use().table
            except StoreError as error:
                insist(error.path == str(folder / part), f"the error names {error.path}, not {part}")
                named += 1
            else:
                insist(harmless and ipc(table) == b.bytes, f"{part} was taken as whole")
        (folder / part).write_bytes(b.parts[part])
    (folder / part).unlink()
    b.same(folder)
    return times, f"the part alone; {named} of {2 * times} reads refused, the others were right"


def truncated(b):
    return spoiled(b, "truncated", lambda data: data[: b.rng.randrange(len(data))], 12, harmless=False)


def flipped(b):
    def change(data):
        # Half of the bits from the last twentieth: the footer, which Parquet does not protect.
        first = 0 if b.rng.random() < 0.5 else len(data) * 19 // 20
        bit = b.rng.randrange(8 * first, 8 * len(data))
        data[bit // 8] ^= 1 << bit % 8
        return data

    return spoiled(b, "flipped", change, 60, harmless=True)


def manifest_changed(b):
    """One byte becomes another, half of the times a digit another digit: nothing may be misread."""
    folder, named, times = b.fresh("manifest", copy=True), 0, 400
    path = folder / "_manifest.json"
    whole = path.read_bytes()
    digits = [at for at, byte in enumerate(whole) if chr(byte).isdigit()]
    for i in range(times):
        at, data = b.rng.choice(digits) if i % 2 else b.rng.randrange(len(whole)), bytearray(whole)
        others = b"0123456789" if i % 2 else bytes(range(256))
        data[at] = b.rng.choice([other for other in others if other != whole[at]])
        path.write_bytes(data)
        try:
            table = tadcore.load_study(folder).table
        except StoreError as error:
            insist(error.path == str(path), f"the error names {error.path}, not {path}")
            named += 1
        else:
            insist(ipc(table) == b.bytes, f"byte {at} as {data[at]} was taken as whole")
    path.write_bytes(whole)
    b.same(folder)
    return times, f"nothing; {named} of {times} reads refused, the others were right"


def foreign(b):
    study(TRIALS, seed=8).run(store=b.place / "other", threads=1)
    strange = parts(b.place / "other")
    swapped = list(b.parts.values())
    return spoiled(b, "foreign", lambda data: b.rng.choice([*strange.values(), *swapped[:1]]), 8, harmless=True)


def pool_worker(b):
    folder, done = b.fresh("pool"), 0
    for _ in range(3):
        before = parts(folder)
        with futures.ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as pool:
            list(pool.map(abs, range(8)))
            victim = b.rng.choice(list(pool._processes))
            killer = b.killer(folder, victim)
            refused(lambda: study(TRIALS).run(store=folder, executor=pool), "run the study again with this store")
            killer.join()
        b.kept(before, folder)
        done += 1
    b.same(folder)
    return done, "chunks in flight"


def dask_worker(b):
    try:
        import distributed
    except ImportError:
        return 0, "skipped: Dask is not installed"
    folder = b.fresh("dask")
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None, "silence_logs": 60}
    with distributed.LocalCluster(processes=True, **options) as cluster, distributed.Client(cluster) as client:
        pids = client.run(os.getpid)
        victim = b.rng.choice(list(pids.values()))
        killer = b.killer(folder, victim)
        result = study(TRIALS).run(store=folder, executor=client.get_executor())
        killer.join()
        insist(victim not in client.run(os.getpid).values(), "the worker was not killed")
    insist(ipc(result.table) == b.bytes, "the final table differs")
    b.same(folder)
    return 1, "chunks of the worker, given to another at once"


FAULTS = {
    "kill -9 at random moments, each resumed": killed,
    "kill -9 inside the writing of a part": killed_inside,
    "disk full, thrice; then read-only disk": disk_full,
    "read-only folder": read_only,
    "three writers at once": two_writers,
    "a part truncated": truncated,
    "a foreign or misplaced part": foreign,
    "a bit flipped in a part": flipped,
    "a byte changed in the manifest": manifest_changed,
    "a worker of a process pool killed": pool_worker,
    "a worker of a Dask cluster killed": dask_worker,
}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="faults whose name contains this")
    options = parser.parse_args()
    failed = 0
    with tempfile.TemporaryDirectory(prefix="tadcore-faults-") as name:
        wanted = Bench(Path(name), options.kills, random.Random(options.seed))
        print(f"a study of {TRIALS:,} trials in {len(wanted.parts)} parts, {wanted.length:.1f} s undisturbed\n")
        print("| fault | times | what was lost | final table | verdict |\n|---|---|---|---|---|")
        for fault, test in FAULTS.items():
            if options.only not in fault:
                continue
            try:
                times, lost = test(wanted)
                table, verdict = ("equal to the bit", "ok") if times else ("–", "skipped")
            except (WrongError, tadcore.TadcoreError, OSError, subprocess.SubprocessError) as error:
                times, lost, table, verdict = "–", str(error), "–", "FAILED"
                failed += 1
            print(f"| {fault} | {times} | {lost} | {table} | {verdict} |", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
