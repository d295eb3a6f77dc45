"""Text from outside, read within bounds; TOML with errors that name the line."""

from __future__ import annotations

import codecs
import os
import re
import sys
import tomllib
from typing import Any, BinaryIO

from tadcore.errors import MISSING, ScenarioError

from .files import MOST, as_path, strange

STDIN = "-"
"""What stands for standard input wherever the command line takes a file of text."""

_DEEPEST = 100
_PART = r"""(?:[\w-]++|"[^"\\\n]*+(?:\\[^\n][^"\\\n]*+)*+"|'[^'\n]*+')"""
_DOT = r"[ \t]*+\.[ \t]*+"
# Comments, strings and dotted keys, each taken whole, an unfinished one too, so that no character is read more than
# a few times. What a key has beyond the deepest is a group: a dotted key of n parts takes the parser n² of memory.
_TOKEN = re.compile(
    rf"""\#[^\n]*+
    |\"""(?:[^"\\]++|\\.|"(?!""))*+\\?+(?:"{{3,5}}+)?+
    |'''(?:[^']++|'(?!''))*+(?:'{{3,5}}+)?+
    |{_PART}(?:{_DOT}{_PART}){{0,{_DEEPEST - 1}}}+((?:{_DOT}{_PART})++)?+
    |"[^"\\\n]*+(?:\\[^\n][^"\\\n]*+)*+
    |'[^'\n]*+""",
    re.VERBOSE | re.DOTALL,
)
_ENCODED = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),  # begins as UTF-16 does
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_TEXT = "text in UTF-8, or in UTF-16 with a byte-order mark"


def read_text(path: str | os.PathLike[str]) -> str:
    """The text of a file; raises `ScenarioError` where there is none."""
    file = as_path("path", path)
    name = os.fspath(path)
    try:
        found = strange(file)
        if found is not None:
            raise ScenarioError(name, found, "a file")
        with file.open("rb") as stream:
            return _read(stream, name)
    except FileNotFoundError:
        raise ScenarioError(name, MISSING, "a file that exists") from None
    except OSError as error:
        raise ScenarioError(name, error.strerror or str(error), "a file that can be read") from None


def read_stdin() -> str:
    """The text on standard input, whatever the locale takes its bytes for; raises `ScenarioError`."""
    if sys.stdin is None:
        raise ScenarioError(STDIN, MISSING, "a text on standard input")
    try:
        return _read(sys.stdin.buffer, "standard input")
    except OSError as error:
        raise ScenarioError(STDIN, error.strerror or str(error), "a text on standard input") from None


def _read(stream: BinaryIO, name: str) -> str:
    data = stream.read(MOST + 1)
    if len(data) > MOST:
        raise ScenarioError(name, "a larger one", f"a file of at most {MOST >> 20} MiB")
    encoding = next((encoding for mark, encoding in _ENCODED if data.startswith(mark)), "utf-8")
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError as error:
        raise ScenarioError(name, error.object[error.start : error.end], _TEXT) from None
    if "\0" in text:
        raise ScenarioError(name, "bytes of 0, as UTF-16 without a byte-order mark has them", _TEXT)
    return text


def parse_toml(text: str, name: str) -> dict[str, Any]:
    """The tables of a TOML text; raises `ScenarioError` naming the line that cannot be read."""
    if not isinstance(text, str):
        raise ScenarioError(name, text, "a text in TOML")
    long = _long_key(text)
    if long is not None:
        line = text.count("\n", 0, long.start()) + 1
        raise ScenarioError(f"{name}, line {line}", long[0], f"valid TOML with keys of at most {_DEEPEST} parts")
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # a TOMLDecodeError, or a number or a nesting beyond all bounds
        # Split from the end: the reason may hold a key, and a key may hold anything.
        reason, _, end = str(error).rpartition(" (at ")
        place = re.fullmatch(r"line (\d+), column \d+\)", end)
        reason = reason or end
        if "digits" in reason:
            reason = "an integer has too many digits"
        if isinstance(error, RecursionError):
            reason = "arrays or tables are nested too deeply"
        if place is None:
            last = end == "end of document)"
            raise ScenarioError(f"{name}, at the end" if last else name, MISSING, f"valid TOML ({reason})") from None
        line = int(place[1])
        found = text.split("\n")[line - 1].strip() if line <= text.count("\n") + 1 else MISSING
        raise ScenarioError(f"{name}, line {line}", found, f"valid TOML ({reason})") from None


def _long_key(text: str) -> re.Match[str] | None:
    if text.count(".") < _DEEPEST:
        return None
    return next((token for token in _TOKEN.finditer(text) if token[1]), None)
