"""What a store says about itself: ``_manifest.json``, read only when it is whole.

The last entry is a digest of all others, so that a digit that was changed, by a hand or by a disk, is not taken for
another study.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
from dataclasses import dataclass, field
from importlib import metadata
from typing import Any, TypeVar

from tadcore import _core
from tadcore._shared.files import MOST
from tadcore.errors import StoreError, shorten
from tadcore.sampling.adapters import as_plain, from_plain
from tadcore.sampling.design import CHUNK, STREAM
from tadcore.simulation.termination import Termination, as_termination

from .keeping import Keep, as_keep
from .place import Place, reason
from .where import as_place

Kind = TypeVar("Kind")

MANIFEST = "_manifest.json"
"""Its name: readers of a folder of Parquet files pass over what begins with an underscore."""

FORMAT = 4
"""Version of the layout of a store; 3 had a part for every chunk, 2 no ``outcome``, 1 no digest of the manifest."""

_OLD = "manifest.json"  # its name up to format 2

SEAL = "manifest_sha256"
"""The entry with the digest of all others."""


@dataclass(frozen=True)
class Manifest:
    """What a store says about itself.

    Attributes
    ----------
    scenario : str
        The scenario as TOML.
    vary : dict of str to dict
        The sampler of every varied path, as a table.
    seed, design, chunk, stream
        Where the draws come from; ``chunk`` is the number of trials in a chunk, ``stream`` the version of the draws.
    trials : int
        The length of the longest study that was asked for.
    stopped : int or None
        The trials after which a stopping rule held.
    rule : dict or None
        The rule that was asked, whether it held or not: how it prints, and its level.
    columns : tuple of str
        Names of the inputs.
    termination : {"sampled", "continuous"}
        When a game ends; written where it is not the sampled definition.
    passes : bool
        Whether passes within a capture radius are looked for; written where they are.
    keep : {"all", "outcomes", "counts"}
        What the store keeps of every trial.
    version, created : str
        The version of this library, and when the store was made (UTC).
    environment : dict of str to str
        What else the last bit of a draw may depend on: the machine, Python, NumPy and SciPy.
    """

    scenario: str
    vary: dict[str, dict[str, Any]]
    seed: int
    design: str
    trials: int
    columns: tuple[str, ...]
    stopped: int | None = None
    rule: dict[str, Any] | None = None
    termination: Termination = "sampled"
    passes: bool = False
    keep: Keep = "all"
    chunk: int = CHUNK
    stream: int = STREAM
    version: str = _core.__version__
    created: str = ""
    environment: dict[str, str] = field(default_factory=dict)

    @property
    def study(self) -> str:
        """Digest of everything that decides an outcome: scenario, vary, seed, design, chunk and stream."""
        decides: list[object] = [self.scenario, as_plain(self.vary), self.seed, self.design, self.chunk, self.stream]
        decides += [self.termination] if self.termination != "sampled" else []
        decides += ["passes"] if self.passes else []
        return hashlib.sha256(json.dumps(decides, sort_keys=True).encode()).hexdigest()

    def to_json(self) -> str:
        """The text of ``_manifest.json``."""
        content = {
            "format": FORMAT,
            "tadcore_version": self.version,
            "created": self.created,
            "environment": self.environment,
            "study_sha256": self.study,
            "scenario_sha256": hashlib.sha256(self.scenario.encode()).hexdigest(),
            "stream": self.stream,
            "seed": self.seed,
            "design": self.design,
            "chunk": self.chunk,
            "trials": self.trials,
            "stopped": self.stopped,
            "keep": self.keep,
            "columns": list(self.columns),
            "vary": as_plain(self.vary),
            "scenario": self.scenario,
            **({"termination": self.termination} if self.termination != "sampled" else {}),
            **({"passes": True} if self.passes else {}),
        }
        if self.rule is not None:
            content["rule"] = self.rule
        return json.dumps(content | {SEAL: seal(content)}, indent=2, ensure_ascii=False) + "\n"

    def same(self, wanted: Manifest, place: Place) -> None:
        """Raise `StoreError` where this is not the manifest of the study that is wanted, or of what it keeps."""
        if self.study != wanted.study:
            decides = ("scenario", "vary", "seed", "design", "chunk", "stream", "termination", "passes")
            differ = ", ".join(name for name in decides if getattr(self, name) != getattr(wanted, name))
            raise StoreError(str(place), f"it holds another study (its {differ} differ)", "name another folder")
        if self.keep != wanted.keep:
            found = f"it keeps {self.keep!r} of every trial, and this run {wanted.keep!r}"
            raise StoreError(str(place), found, f"name another folder, or run with keep={self.keep!r}")

    @classmethod
    def read(cls, folder: Place | str | os.PathLike[str]) -> Manifest:
        """The manifest of a store; raises `StoreError` where there is none that can be read."""
        place = as_place("folder", folder)
        path = place.at(MANIFEST)
        refuse_old(place)
        try:
            found = place.strange(MANIFEST) if place.exists(MANIFEST) else None
            if found is not None:
                raise StoreError(path, f"it is {found}, not a file", "name the folder of a study")
            data = place.read(MANIFEST, MOST + 1)
        except FileNotFoundError:
            raise StoreError(path, "there is no such file", "name the folder of a study") from None
        except OSError as error:
            raise StoreError(path, f"it cannot be read ({reason(error)})", "check the path") from None
        if len(data) > MOST:
            raise StoreError(path, f"it has more than {MOST >> 20} MiB", "name the folder of a study")
        return cls.from_json(data, path)

    @classmethod
    def from_json(cls, data: bytes, path: str) -> Manifest:
        """The manifest that these bytes are; raises `StoreError` naming ``path`` where they are none, or damaged."""
        try:
            content = json.loads(data.decode("utf-8"))
            if content["format"] != FORMAT:
                raise _other_format(path, shorten(content["format"]))
            if content.pop(SEAL) != seal(content):
                found = "its digest does not fit its content: it was edited or damaged"
                raise StoreError(path, found, "put back a copy of this file, or run the study anew in another folder")
            columns = _entry(content, "columns", list)
            manifest = cls(
                scenario=_entry(content, "scenario", str),
                vary=from_plain(_entry(content, "vary", dict)),
                seed=_whole(content, "seed"),
                design=_entry(content, "design", str),
                trials=_whole(content, "trials"),
                columns=tuple(_entry({"columns": name}, "columns", str) for name in columns),
                termination=as_termination(content.get("termination", "sampled")),
                keep=as_keep(content["keep"]),
                passes=_entry({"passes": False} | content, "passes", bool),
                stopped=None if content["stopped"] is None else _whole(content, "stopped"),
                rule=_entry(content, "rule", dict) if "rule" in content else None,
                chunk=_whole(content, "chunk"),
                stream=_whole(content, "stream"),
                version=_entry(content, "tadcore_version", str),
                created=_entry(content, "created", str),
                environment=_entry(content, "environment", dict),
            )
        except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError) as error:
            lacks = f"it has no entry {error}" if isinstance(error, KeyError) else error
            raise StoreError(path, f"it is no manifest of a study ({lacks})", "name another folder") from None
        if manifest.chunk != CHUNK:  # what a part may hold at most: an untrusted file does not decide how much is read
            found = f"its chunks have {manifest.chunk} trials, and this version of tadcore reads {CHUNK}"
            raise StoreError(path, found, "read it with the version that wrote it")
        return manifest


def refuse_old(place: Place) -> None:
    """Raise `StoreError` for a store of an earlier format."""
    if place.exists(_OLD) and not place.exists(MANIFEST):
        raise _other_format(place.at(_OLD), "1 or 2")


def _other_format(path: str, number: str) -> StoreError:
    found = f"it has format {number}, and this version of tadcore reads {FORMAT}"
    remedy = (
        "read it with the version that wrote it, its parts with any reader of Parquet, or run the study anew elsewhere"
    )
    return StoreError(path, found, remedy)


def environment() -> dict[str, str]:
    """What else the last bit of a draw may depend on."""
    packages = {name: metadata.version(name) for name in ("numpy", "scipy", "pyarrow")}
    return {"machine": platform.platform(), "python": platform.python_version(), **packages}


def _entry(content: dict[str, Any], name: str, kind: type[Kind]) -> Kind:
    """An entry of its kind; nothing is taken for what it is not."""
    value = content[name]
    if type(value) is not kind:
        raise ValueError(f"its {name} is {shorten(value)}")
    return value


def _whole(content: dict[str, Any], name: str) -> int:
    value = _entry(content, name, int)
    if not 0 <= value < 2**64:
        raise ValueError(f"its {name} is {shorten(value)}")
    return value


def seal(content: dict[str, Any]) -> str:
    """SHA-256 of a manifest's content in one canonical text, whatever its spaces and the order of its fields."""
    return hashlib.sha256(json.dumps(content, sort_keys=True, separators=(",", ":")).encode()).hexdigest()
