"""A store in a folder: of this machine, or of a file system that several machines share."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

import pyarrow as pa

from tadcore._shared.files import strange, write_whole
from tadcore.errors import StoreError

from .lock import LOCK, alone
from .place import Place, faults


class Folder:
    """The files of a folder; a `Place`."""

    threads = 2

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)

    def __str__(self) -> str:
        return str(self.path)

    def at(self, name: str) -> str:
        """The path of a file."""
        return str(self.path / name)

    def absolute(self) -> Folder:
        """From the root."""
        return Folder(self.path.absolute())

    def inside(self, name: str) -> Folder:
        """A folder in it."""
        return Folder(self.path / name)

    def names(self) -> list[str]:
        """What is in it."""
        with faults(self.path), contextlib.suppress(FileNotFoundError):
            return sorted(entry.name for entry in os.scandir(self.path))
        return []

    def exists(self, name: str) -> bool:
        """Whether there is anything, links followed."""
        with faults(self.path / name):
            return (self.path / name).exists()

    def strange(self, name: str) -> str | None:
        """A folder, a pipe or a device."""
        with faults(self.path / name):
            return strange(self.path / name)

    def read(self, name: str, most: int) -> bytes:
        """The beginning of a file."""
        with (self.path / name).open("rb") as stream:
            return stream.read(most)

    def source(self, name: str) -> pa.NativeFile:
        """A file to read from."""
        return pa.OSFile(self.at(name), "rb")

    def write(self, name: str, content: str | bytes | memoryview) -> None:
        """Beside its name first, then renamed; raises `StoreError` for a link, too."""
        path = self.path / name
        if path.is_symlink():  # a store that came from elsewhere must not decide what else is written
            found = "it is a link, and a store writes nothing outside its folder"
            raise StoreError(str(path), found, "remove the link")
        with faults(path):
            write_whole(path, content)

    def remove(self, name: str) -> None:
        """Unlink a file."""
        with faults(self.path / name):
            (self.path / name).unlink(missing_ok=True)

    def take(self, name: str, other: Place) -> None:
        """Rename a file."""
        with faults(other.at(name)):
            Path(other.at(name)).replace(self.path / name)

    def make(self) -> None:
        """The folder and those above it."""
        with faults(self.path):
            self.path.mkdir(parents=True, exist_ok=True)

    def discard(self) -> None:
        """The folder, and the file of its lock."""
        with faults(self.path):
            (self.path / LOCK).unlink(missing_ok=True)
            self.path.rmdir()

    @contextlib.contextmanager
    def alone(self) -> Iterator[None]:
        """Under a lock of the operating system, or a lock file."""
        with contextlib.ExitStack() as until_the_end:
            with faults(self.path):
                until_the_end.enter_context(alone(self.path))
            yield
