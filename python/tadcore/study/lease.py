"""One run at a time where there are no locks: a lease, which names its owner and is renewed while that run lives.

A lease whose owner was a process of this machine that is no more is taken over at once. Of another machine nobody can
know, so its lease is watched: where it is not renewed it is taken over, and where it is, the store is in use. No clocks
are compared. Two runs that begin in the same instant may both find nothing; the one whose lease was written over learns
so when it renews it, and writes no more. Until then both may have written: the same bytes, since a part is a function
of its study, so nothing is lost but time.
"""

from __future__ import annotations

import contextlib
import json
import os
import platform
import secrets
import threading
import time
import uuid
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from tadcore.errors import StoreError

from .lock import LOCK
from .place import Place, reason

BEAT = 10.0  # seconds between two renewals
SILENCE = 35.0  # seconds without one after which a lease is nobody's
_LARGEST = 4096
_READS = 5  # of a lease that is renewed just then: its length may be of one writing, its content of another


class Lease:
    """What this run has: `lost` says who has it instead."""

    def __init__(self, place: Place) -> None:
        self._place = place
        self._since = datetime.now(UTC).isoformat(" ", "minutes")
        self._token = secrets.token_hex(8)
        self._beats = 0
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._renew, name="tadcore-lease", daemon=True)
        self.lost: str | None = None

    def begin(self) -> None:
        """Write it, and go on renewing it; raises `StoreError` where another run wrote its own after this one."""
        self._write()
        if not self._mine():
            raise _taken(self._place, _read(self._place))
        self._thread.start()

    def end(self) -> None:
        """Give it back."""
        self._end.set()
        self._thread.join()
        with contextlib.suppress(StoreError):  # what is left is nobody's after a while
            if self._mine():
                self._place.remove(LOCK)

    def _write(self) -> None:
        said = {"token": self._token, "machine": _machine(), "host": platform.node(), "pid": os.getpid()}
        self._place.write(LOCK, json.dumps(said | {"since": self._since, "beat": self._beats}) + "\n")

    def _mine(self) -> bool:
        there = _read(self._place)
        return there is not None and there.get("token") == self._token

    def _renew(self) -> None:
        while not self._end.wait(BEAT):
            with contextlib.suppress(StoreError):  # a service that does not answer now may do so the next time
                there = _read(self._place)
                if there is not None and there.get("token") != self._token:
                    self.lost = _named(there)
                    return
                self._beats += 1
                self._write()


@contextlib.contextmanager
def leased(place: Place) -> Iterator[Lease]:
    """Have a place alone; raises `StoreError` where another run has it."""
    until = time.monotonic() + SILENCE
    first = there = _read(place)
    while there is not None and not _dead(there) and time.monotonic() < until:
        time.sleep(min(BEAT, SILENCE) / 10)
        there = _read(place)
        if there is not None and there != first:
            raise _taken(place, there)
    lease = Lease(place)
    lease.begin()
    try:
        yield lease
    finally:
        lease.end()


def _read(place: Place) -> dict[str, Any] | None:
    """What the lease of a place says; None where there is none, and nothing of what is no lease."""
    for attempt in range(_READS):
        try:
            said = json.loads(place.read(LOCK, _LARGEST))
        except FileNotFoundError:
            return None
        except OSError as error:
            raise StoreError(place.at(LOCK), f"it cannot be read ({reason(error)})", "check the place") from None
        except (ValueError, RecursionError):
            time.sleep(0.02 * attempt)
            continue
        return said if isinstance(said, dict) else {}
    return {}


def _dead(owner: dict[str, Any]) -> bool:
    """Whether it was a process of this machine, or container, and is no more."""
    pid = owner.get("pid")
    if owner.get("machine") != _machine() or type(pid) is not int or os.name != "posix":
        return False
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return True
    except OSError:
        return False
    return False


def _machine() -> str:
    """What tells this machine, since it was started, and this container from others."""
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
        return f"{platform.node()} {boot} {Path('/proc/self/ns/pid').readlink()}"
    except OSError:
        return f"{platform.node()} {uuid.getnode():x}"


def _named(owner: dict[str, Any] | None) -> str:
    if not owner:
        return "another run"
    return f"process {owner.get('pid')} on {owner.get('host')}, there since {owner.get('since')},"


def _taken(place: Place, owner: dict[str, Any] | None) -> StoreError:
    found = f"another run is writing to it: {_named(owner).rstrip(',')}"
    return StoreError(str(place), found, "wait for its end, or stop it")
