"""Paths from outside, and files that appear whole or not at all."""

from __future__ import annotations

import errno
import os
import secrets
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO

from tadcore.errors import ScenarioError

MOST = 8 << 20
"""Bytes of a text file that is read at all: what a reader makes of it takes many times as much."""

PARTIAL = ".tadcore-"
"""How the name of a file begins that is not whole yet: short, so that every legal name can be written."""

_UNSUPPORTED = {errno.EINVAL, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS, errno.EPERM}
_REFUSED = (
    (stat.S_ISDIR, (errno.EISDIR, "it is a folder, and must be a file to write")),
    (stat.S_ISSOCK, (errno.ENXIO, "it is a socket, and must be a file to write")),
)
_THROUGH = os.O_WRONLY | getattr(os, "O_NOCTTY", 0) | getattr(os, "O_NONBLOCK", 0)
_PATIENCE = 10.0  # seconds until a pipe without a reader is refused
_LINKS = 40  # in a chain, as many as Linux follows
_KINDS = ((stat.S_ISREG, None), (stat.S_ISDIR, "a folder"), (stat.S_ISFIFO, "a pipe"), (stat.S_ISSOCK, "a socket"))


def as_path(field: str, value: Any) -> Path:
    """A path from a string or a path; raises `ScenarioError` for what cannot name anything."""
    name = value if isinstance(value, str) else value.__fspath__() if isinstance(value, os.PathLike) else None
    if not isinstance(name, str) or not name or "\0" in name or not _encodable(name):
        raise ScenarioError(field, value, "a path: a string or a pathlib.Path, without \\0")
    return Path(name)


def _encodable(name: str) -> bool:
    """Whether the system can write the name: not where it holds half of a surrogate pair."""
    try:
        os.fsencode(name)
    except UnicodeEncodeError:
        return False
    return True


def strange(path: str | os.PathLike[str]) -> str | None:
    """What is there instead of a file that ends: a folder, a pipe, a device; None for a file.

    A pipe is refused because opening one can wait for ever; raises OSError where nothing can be looked at.
    """
    mode = Path(path).stat().st_mode
    return next((word for holds, word in _KINDS if holds(mode)), "a device")


@contextmanager
def written(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A file to write to, whose content the destination has if the block succeeds, and has nothing of if not.

    * A regular file, or a name that is free: the content is written beside it, brought to the disk and renamed, so no
      reader meets half a file. A file that was there keeps its mode and, where the system lets it, its owner; a new one
      has the mode that the umask gives. Its other names (hard links) keep the old content. A file that is a mount point
      can only be written in place.
    * A symbolic link stays, and what it leads to is written.
    * A device, a pipe, ``/dev/stdout`` or another open descriptor receives the content, and stays what it is.

    The suffix is that of ``path``, by which some writers choose a format.

    Raises
    ------
    OSError
        It is a folder, a socket or a write-protected file, or the system refuses; the destination is named.
    """
    name = os.fspath(path)
    with _named(name):
        number = _descriptor(name)
        there = destination(name)
        if number is None and (there is None or stat.S_ISREG(there.st_mode)):
            target = Path(os.path.realpath(name) if Path(name).is_symlink() else name)
            with _beside(target, there, _suffix(Path(name))) as partial:
                yield partial
            return
    with tempfile.TemporaryDirectory(prefix=PARTIAL) as folder:
        partial = Path(folder) / f"content{_suffix(Path(name))}"
        partial.touch()
        yield partial
        with _named(name), partial.open("rb") as content:
            _pour(content, _opened(name) if number is None else os.dup(number))


def write_whole(path: str | os.PathLike[str], content: str | bytes | memoryview) -> None:
    """Write a file that appears whole or not at all; see `written`."""
    with written(path) as partial:
        partial.write_bytes(content.encode("utf-8") if isinstance(content, str) else content)


def destination(path: str | os.PathLike[str]) -> os.stat_result | None:
    """What is at a place to be written, links followed; None where the name is free.

    Tells before long work what `written` would refuse: raises OSError for a folder, a socket, a write-protected file.
    """
    number = _descriptor(os.fspath(path))
    if number is not None:
        return os.fstat(number)
    try:
        there = Path(path).stat()
    except FileNotFoundError:
        return None
    refused = next((words for holds, words in _REFUSED if holds(there.st_mode)), None)
    if refused is None and not os.access(path, os.W_OK, effective_ids=os.access in os.supports_effective_ids):
        refused = (errno.EACCES, "it is write-protected")
    if refused is not None:
        raise OSError(*refused, os.fspath(path))
    return there


@contextmanager
def _beside(target: Path, there: os.stat_result | None, suffix: str) -> Iterator[Path]:
    """The destination's content under a short name in its folder, until it is whole."""
    mode = 0o666 if there is None else stat.S_IMODE(there.st_mode) & 0o777
    partial = target.with_name(f"{PARTIAL}{secrets.token_hex(8)}{suffix}")
    # Made with the mode, less the umask: never more open than the destination, and none to be set where it is new.
    os.close(os.open(partial, os.O_CREAT | os.O_EXCL | os.O_WRONLY, mode | 0o600))
    try:
        yield partial
        with partial.open("rb+") as stream, _if_supported():
            os.fsync(stream.fileno())
        if there is not None:
            _dress(partial, there, mode)
        try:
            partial.replace(target)
        except OSError as error:
            if error.errno != errno.EBUSY:
                raise
            shutil.copyfile(partial, target)  # a single file mounted into a container cannot be another file
            partial.unlink()
    except BaseException:
        with suppress(OSError):
            partial.unlink()
        raise
    _sync_folder(target.parent)


def _dress(partial: Path, there: os.stat_result, mode: int) -> None:
    """Owner and mode of the file that is replaced, as far as the file system knows of them."""
    ours = partial.stat()
    if (ours.st_uid, ours.st_gid) != (there.st_uid, there.st_gid):
        with _if_supported():
            os.chown(partial, there.st_uid, there.st_gid)
    if stat.S_IMODE(partial.stat().st_mode) != mode:
        with _if_supported():
            partial.chmod(mode)


def _sync_folder(folder: Path) -> None:
    """Bring a new name to the disk, where the system can open folders at all."""
    if not hasattr(os, "O_DIRECTORY"):
        return
    with _if_supported(errno.EBADF, errno.EACCES):
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


@contextmanager
def _if_supported(*more: int) -> Iterator[None]:
    """Go on where a file system has no such operation (network, FUSE and object-store mounts); nothing else passes."""
    try:
        yield
    except OSError as error:
        if error.errno not in _UNSUPPORTED and error.errno not in more:
            raise


@contextmanager
def _named(name: str) -> Iterator[None]:
    """Name the destination in errors that name the partial file or nothing."""
    try:
        yield
    except OSError as error:
        if error.errno is None or not (error.filename is None or PARTIAL in str(error.filename)):
            raise
        raise OSError(error.errno, error.strerror, name) from error


def _descriptor(name: str) -> int | None:
    """The open descriptor that a path leads to, such as /dev/stdout, which must not be opened a second time.

    Where the shell sent it to a file, a second descriptor would begin at the file's start, over what is there.
    """
    folders = {os.path.realpath(folder) for folder in ("/dev/fd", "/proc/self/fd", "/proc/thread-self/fd")}
    path = Path(name)
    for _ in range(_LINKS):
        if path.name.isascii() and path.name.isdigit() and os.path.realpath(path.parent) in folders:
            return int(path.name)
        try:
            path = path.parent / path.readlink()
        except OSError:
            return None
    return None


def _opened(name: str) -> int:
    """A device or a pipe, open to be written; a pipe that nobody reads is refused after a while, not waited for."""
    until = time.monotonic() + _PATIENCE
    while True:
        try:
            descriptor = os.open(name, _THROUGH)
        except OSError as error:
            if error.errno != errno.ENXIO:
                raise
            if time.monotonic() > until:
                raise OSError(errno.ENXIO, "nobody reads this pipe") from None
            time.sleep(0.01)
        else:
            os.set_blocking(descriptor, True)
            return descriptor


def _pour(content: BinaryIO, descriptor: int) -> None:
    """Write all of a file to an open descriptor, behind what this process has printed."""
    with os.fdopen(descriptor, "wb") as stream:
        for printed in (sys.stdout, sys.stderr):
            if printed is not None and not printed.closed:
                printed.flush()
        shutil.copyfileobj(content, stream)


def _suffix(path: Path) -> str:
    """The suffix, by which some writers choose a format; none where it is too long to be one."""
    return path.suffix.lower() if len(os.fsencode(path.suffix)) <= 16 else ""
