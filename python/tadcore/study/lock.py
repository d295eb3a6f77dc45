"""One run at a time in a store.

A lock of the operating system ends with the process that has it. On a file system without such locks (some network and
FUSE mounts) the lock is a file that names its owner: it is taken over from a dead process of the same machine, and of
another machine nobody can know, so the error says who left it, when, and what to do.
"""

from __future__ import annotations

import contextlib
import errno
import os
import re
import secrets
import time
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from filelock import FileLock, SoftFileLock, Timeout

from tadcore._shared.files import PARTIAL, strange
from tadcore.errors import StoreError

LOCK = "_store.lock"
"""The name of the lock in a store."""

_UNSUPPORTED = {errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP, errno.EINVAL, errno.ENOLCK}
_HELD = {errno.EAGAIN, errno.EWOULDBLOCK, errno.EACCES}
_STALE = 60.0  # seconds after which a lock file without an owner is what a lock of the system left
_OWNER = re.compile(
    r"(?:filelock/2\s+)?(?:pid=)?(?P<pid>\d+)\n(?:host=)?(?P<host>[^\n]+)\n"
)  # of filelock, old and new


class Owner(NamedTuple):
    """Who wrote a lock file."""

    pid: int
    host: str


@contextlib.contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Keep other runs out of a store meanwhile.

    Raises `StoreError` where another run is in it, OSError where nobody can write.
    """
    path = folder / LOCK
    if path.is_symlink():
        raise StoreError(str(path), "it is a link, and a store writes nothing outside its folder", "remove the link")
    found = strange(path) if path.exists() else None
    if found is not None:
        raise StoreError(str(path), f"it is {found}, not a file", "move it out of this folder")
    native = _has_locks(path)
    lock = FileLock(path, timeout=0) if native else SoftFileLock(path, timeout=0)
    if not native:
        _tidy(path)
    try:
        lock.acquire()
    except Timeout:
        raise _taken(path) from None
    try:
        # A lock of the system writes no owner: this one is a lock file, perhaps of a machine that has no other lock.
        owner = _owner(path) if native else None
        if owner is not None and not _dead(owner, folder):
            raise _taken(path)
        yield
    finally:
        lock.release()


def _has_locks(path: Path) -> bool:
    """Whether the file system has locks of the operating system; a lock file made to find out does not stay."""
    try:
        import fcntl
    except ImportError:
        return True  # Windows, whose locks are always there
    made = True
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666)
    except FileExistsError:
        made, descriptor = False, os.open(path, os.O_RDWR)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in _HELD:
            return True
        if error.errno not in _UNSUPPORTED:
            raise
        if made:  # by this very call, so it is nobody's lock
            path.unlink(missing_ok=True)
        return False
    finally:
        os.close(descriptor)
    return True


def _owner(path: Path) -> Owner | None:
    try:
        with path.open("rb") as stream:
            match = _OWNER.match(stream.read(1024).decode(errors="replace"))
    except OSError:
        return None
    return None if match is None else Owner(int(match["pid"]), match["host"])


def _dead(owner: Owner, folder: Path) -> bool:
    """Whether the owner of a lock file was a process of this machine, or container, and is no more."""
    probe = folder / f"{PARTIAL}{secrets.token_hex(8)}.lock"
    with SoftFileLock(probe, timeout=0):
        us = _owner(probe)  # how a lock file calls this machine
    if us is None or owner.host != us.host or os.name != "posix":
        return False
    try:
        os.kill(owner.pid, 0)
    except ProcessLookupError:
        return True
    except (OSError, OverflowError):
        return False
    return False


def _tidy(path: Path) -> None:
    """Remove a lock file without an owner, which a lock of the system left: a lock file never is empty for long."""
    with contextlib.suppress(FileNotFoundError):
        there = path.stat()
        if there.st_size == 0 and time.time() - there.st_mtime > _STALE:
            path.unlink()


def _taken(path: Path) -> StoreError:
    """Who has the lock, and what to do, as far as the lock file tells."""
    owner = _owner(path)
    wait = "wait for its end, or stop it"
    if owner is None:
        return StoreError(str(path.parent), "another run is writing to it", f"{wait}; if there is none, remove {path}")
    with contextlib.suppress(OSError):
        since = datetime.fromtimestamp(path.stat().st_mtime, UTC).isoformat(" ", "minutes")
        found = f"another run is writing to it: process {owner.pid} on {owner.host}, since {since}"
        return StoreError(str(path.parent), found, f"{wait}; if that process is no more, remove {path}")
    return StoreError(str(path.parent), "another run is writing to it", wait)
