"""Where a store is: what its files are asked of, whether they lie in a folder or elsewhere."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from contextlib import AbstractContextManager
from typing import Any, Protocol

from tadcore.errors import StoreError


class Place(Protocol):
    """Files under one name. All but `read` raise `StoreError` for what the system refuses.

    `str` of it is what messages call it. It can be sent to other processes.
    """

    threads: int
    """How many may write or read there at once with profit."""

    def at(self, name: str) -> str:
        """What messages call a file."""

    def absolute(self) -> Place:
        """The same, for a process that works in another folder."""

    def inside(self, name: str) -> Place:
        """The place of that name within this one, whether it is there or not."""

    def names(self) -> list[str]:
        """What is directly in it, in order; nothing where it does not exist."""

    def exists(self, name: str) -> bool:
        """Whether there is anything of that name."""

    def strange(self, name: str) -> str | None:
        """What is there instead of a file that ends, in words; None for a file."""

    def read(self, name: str, most: int) -> bytes:
        """The beginning of a file, at most so many bytes; raises OSError."""

    def source(self, name: str) -> Any:
        """A file, open for Arrow to read from, to be closed; raises OSError."""

    def write(self, name: str, content: str | bytes | memoryview) -> None:
        """Write a file, which appears whole or not at all."""

    def remove(self, name: str) -> None:
        """Remove a file, if it is there."""

    def take(self, name: str, other: Place) -> None:
        """Move a file of that name here, from a place within this one."""

    def make(self) -> None:
        """Make the place, if it is not there."""

    def discard(self) -> None:
        """Remove the place, which is empty."""

    def alone(self) -> AbstractContextManager[None]:
        """Keep other runs out meanwhile; raises `StoreError` where one is there."""


@contextlib.contextmanager
def faults(path: object) -> Iterator[None]:
    """What the operating system refuses, in the words of a store."""
    try:
        yield
    except OSError as error:
        found = f"it cannot be written or read ({reason(error)})"
        remedy = "nothing that was finished is lost: make room or name a folder that can be written, and run again"
        raise StoreError(str(path), found, remedy) from error


def reason(error: OSError) -> str:
    """What the operating system says, without the path."""
    return error.strerror or str(error)
