"""One writer in a store, with locks of the system and without: named where it lives, replaced where it is dead."""

import contextlib
import errno
import fcntl
import os
import re
import signal
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest
from filelock import SoftFileLock

from study_cases import CHUNK, parts, study
from tadcore import StoreError

HERE = Path(__file__).parents[1]
NO_LOCKS = [errno.ENOSYS, errno.ENOTSUP, errno.EINVAL, errno.ENOLCK]


def without_locks(monkeypatch, number=errno.ENOSYS):
    def flock(*given):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(fcntl, "flock", flock)


@pytest.fixture(params=[False, True], ids=["locks", "no locks"])
def mount(request, monkeypatch):
    """A file system with locks of the system, and one without."""
    if request.param:
        without_locks(monkeypatch)


@pytest.mark.parametrize("number", NO_LOCKS)
def test_a_file_system_without_locks_keeps_a_store(tmp_path, monkeypatch, number, recwarn):
    without_locks(monkeypatch, number)
    result = study(300).run(store=tmp_path / "store")
    longer = study(CHUNK + 300).run(store=tmp_path / "store")
    assert longer.table.slice(0, 300).equals(result.table)
    assert {path.name for path in (tmp_path / "store").iterdir()} == {"_manifest.json", *parts(tmp_path / "store")}
    assert not recwarn.list


@pytest.mark.parametrize("number", [errno.EINVAL, errno.EPERM, errno.ENOTSUP])
def test_a_mount_that_has_next_to_nothing_keeps_a_store(tmp_path, monkeypatch, number):
    """No locks, no modes, no owners, no hard links, no fsync of folders: as of object stores, FUSE, CIFS and WSL."""
    without_locks(monkeypatch)
    fsync = os.fsync

    def refused(*given, **named):
        raise OSError(number, os.strerror(number))

    def of_files(descriptor):
        return refused() if stat.S_ISDIR(os.fstat(descriptor).st_mode) else fsync(descriptor)

    monkeypatch.setattr(os, "fsync", of_files)
    for name in ("chmod", "fchmod", "chown", "fchown", "link", "symlink"):
        monkeypatch.setattr(os, name, refused)
    folder = tmp_path / "store"
    result = study(CHUNK + 300).run(store=folder, table=tmp_path / "table")
    assert study(CHUNK + 300).run(store=folder, table=tmp_path / "table").table.equals(result.table)
    assert not list(tmp_path.rglob(".*"))


@pytest.mark.parametrize("number", [errno.EIO, errno.EBADF])
def test_a_lock_that_fails_for_another_reason_is_an_error(tmp_path, monkeypatch, number):
    without_locks(monkeypatch, number)
    with pytest.raises(StoreError, match=f"it cannot be written or read .{re.escape(os.strerror(number))}"):
        study(300).run(store=tmp_path / "store")


LEFT = ["4711\nnode7\n", "4711\nnode7\n123456\n", "filelock/2\npid=4711\nhost=node7\nmode=exclusive\nstart=99\n"]


@pytest.mark.usefixtures("mount")
@pytest.mark.parametrize("record", LEFT)
def test_a_lock_file_of_another_machine_is_named_and_can_be_removed(tmp_path, record):
    folder = tmp_path / "store"
    study(300).run(store=folder)
    lock = folder / "_store.lock"
    lock.write_text(record, encoding="utf-8")
    os.utime(lock, (1.7e9, 1.7e9))  # 2023-11-14 22:13:20 UTC
    before = parts(folder)
    for _ in range(2):
        with pytest.raises(StoreError) as caught:
            study(CHUNK + 1).run(store=folder)
    assert str(caught.value) == (
        f"{folder}: another run is writing to it: process 4711 on node7, since 2023-11-14 22:13+00:00; "
        f"wait for its end, or stop it; if that process is no more, remove {lock}"
    )
    assert parts(folder) == before
    lock.unlink()
    assert study(CHUNK + 1).run(store=folder).trials == CHUNK + 1


HOLDS = """
import errno, fcntl, os, sys, time
def flock(*given):
    raise OSError(errno.ENOSYS, "no locks here")
fcntl.flock = flock
from study_cases import study
class Waiting:
    def satisfied(self, counts, trials):
        print("inside", flush=True)
        time.sleep(60)
study(300).run(store=sys.argv[1], until=Waiting())
"""


@pytest.mark.usefixtures("mount")
def test_a_run_without_locks_is_named_while_it_lives_and_replaced_when_it_is_dead(tmp_path):
    folder = tmp_path / "store"
    with subprocess.Popen([sys.executable, "-c", HOLDS, folder], cwd=HERE, stdout=subprocess.PIPE) as process:
        assert process.stdout.readline() == b"inside\n"
        with pytest.raises(StoreError, match=rf"another run is writing to it: process {process.pid} on .*, since 20"):
            study(300).run(store=folder)
        process.send_signal(signal.SIGKILL)
    assert (folder / "_store.lock").stat().st_size > 0
    assert study(300).run(store=folder).trials == 300
    assert study(CHUNK + 1).run(store=folder).trials == CHUNK + 1


def test_what_a_lock_of_the_system_leaves_does_not_shut_a_store_for_ever(tmp_path, monkeypatch):
    folder = tmp_path / "store"
    study(300).run(store=folder)
    (folder / "_store.lock").touch()
    without_locks(monkeypatch)
    with pytest.raises(StoreError, match=r"another run is writing to it; .* if there is none, remove .*_store\.lock"):
        study(CHUNK + 1).run(store=folder)
    os.utime(folder / "_store.lock", (time.time() - 100,) * 2)
    assert study(CHUNK + 1).run(store=folder).trials == CHUNK + 1


@pytest.mark.usefixtures("mount")
def test_a_lock_file_that_names_nobody_is_survived(tmp_path):
    folder = tmp_path / "store"
    study(300).run(store=folder)
    for content in (b"\xff\xfe\n\n", b"99999999999999999999\nhost\n", b"-1\nhost\n", b"0\nhost\n", b"x" * 100_000):
        (folder / "_store.lock").write_bytes(content)
        with contextlib.suppress(StoreError):
            study(CHUNK + 1).run(store=folder)
    (folder / "_store.lock").unlink(missing_ok=True)
    with SoftFileLock(folder / "_store.lock"), pytest.raises(StoreError, match=f"process {os.getpid()} on"):
        study(2 * CHUNK).run(store=folder)
