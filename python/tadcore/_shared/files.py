"""Reading TOML with errors that name the line, and writing files that appear whole or not at all."""

from __future__ import annotations

import os
import re
import stat
import tempfile
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tadcore.errors import MISSING, ScenarioError

MOST = 8 << 20
"""Bytes of a text file that is read at all: what a reader makes of it takes many times as much."""

_DEEPEST = 100
_PART = r"""(?:[\w-]++|"[^"\\\n]*+(?:\\.[^"\\\n]*+)*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+"""
# A dotted key of n parts takes the parser n² of memory.
_LONG_KEY = re.compile(rf"(?<![\w-])(?:{_PART}){{{_DEEPEST}}}")
_KINDS = ((stat.S_ISREG, None), (stat.S_ISDIR, "a folder"), (stat.S_ISFIFO, "a pipe"), (stat.S_ISSOCK, "a socket"))


def as_path(field: str, value: Any) -> Path:
    """A path from a string or a path; raises `ScenarioError` for what cannot name anything."""
    name = value if isinstance(value, str) else value.__fspath__() if isinstance(value, os.PathLike) else None
    if not isinstance(name, str) or not name or "\0" in name:
        raise ScenarioError(field, value, "a path: a string or a pathlib.Path, without \\0")
    return Path(name)


def strange(path: str | os.PathLike[str]) -> str | None:
    """What is there instead of a file that ends: a folder, a pipe, a device; None for a file.

    A pipe is refused because opening one can wait for ever; raises OSError where nothing can be looked at.
    """
    mode = Path(path).stat().st_mode
    return next((word for holds, word in _KINDS if holds(mode)), "a device")


def read_text(path: str | os.PathLike[str]) -> str:
    """The text of a file; raises `ScenarioError` where there is none."""
    file = as_path("path", path)
    name = os.fspath(path)
    try:
        found = strange(file)
        if found is not None:
            raise ScenarioError(name, found, "a file")
        with file.open("rb") as stream:
            data = stream.read(MOST + 1)
        if len(data) > MOST:
            raise ScenarioError(name, "a larger one", f"a file of at most {MOST >> 20} MiB")
        return data.decode("utf-8-sig")
    except FileNotFoundError:
        raise ScenarioError(name, MISSING, "a file that exists") from None
    except UnicodeDecodeError as error:
        raise ScenarioError(name, error.object[error.start : error.end], "text in UTF-8") from None
    except OSError as error:
        raise ScenarioError(name, error.strerror or str(error), "a file that can be read") from None


def parse_toml(text: str, name: str) -> dict[str, Any]:
    """The tables of a TOML text; raises `ScenarioError` naming the line that cannot be read."""
    long = _LONG_KEY.search(text)
    if long is not None:
        line = text.count("\n", 0, long.start()) + 1
        raise ScenarioError(f"{name}, line {line}", long[0], f"valid TOML with keys of at most {_DEEPEST} parts")
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # a TOMLDecodeError, or a number or a nesting beyond all bounds
        place = re.search(r"\(at line (\d+), column \d+\)", str(error))
        reason = re.sub(r"\s*\(at [^)]*\)$", "", str(error))
        if "digits" in reason:
            reason = "an integer has too many digits"
        if isinstance(error, RecursionError):
            reason = "arrays or tables are nested too deeply"
        if place is None:
            last = "at end of document" in str(error)
            raise ScenarioError(f"{name}, at the end" if last else name, MISSING, f"valid TOML ({reason})") from None
        line = int(place[1])
        found = text.split("\n")[line - 1].strip() if line <= text.count("\n") + 1 else MISSING
        raise ScenarioError(f"{name}, line {line}", found, f"valid TOML ({reason})") from None


@contextmanager
def written(path: str | os.PathLike[str], *, durable: bool = False) -> Iterator[Path]:
    """A file beside the destination to write to; it takes that name if the block succeeds and is removed if not.

    So no reader meets half a file. Its suffix is the destination's, by which some writers choose a format. With
    ``durable`` bytes and name are on the disk at the end, safe from a loss of power.
    """
    destination = Path(path)
    descriptor, name = tempfile.mkstemp(
        prefix=f".{destination.name}.", suffix=destination.suffix.lower(), dir=destination.parent
    )
    os.close(descriptor)
    partial = Path(name)
    try:
        yield partial
        if durable:
            with partial.open("rb+") as stream:
                os.fsync(stream.fileno())
        partial.chmod(0o666 & ~_umask())
        partial.replace(destination)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise
    if durable:
        _sync_folder(destination.parent)


def write_whole(path: str | os.PathLike[str], content: str | bytes, *, durable: bool = False) -> None:
    """Write a file that appears whole or not at all; see `written`."""
    with written(path, durable=durable) as partial:
        partial.write_bytes(content.encode("utf-8") if isinstance(content, str) else content)


def _sync_folder(folder: Path) -> None:
    """Bring a new name to the disk, where the system can open folders at all."""
    if not hasattr(os, "O_DIRECTORY"):
        return
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
