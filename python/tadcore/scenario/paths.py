"""The one grammar of paths, which name the quantities of a scenario wherever one is named.

==========================================  ===============================================
path                                        what it means
==========================================  ===============================================
``horizon``                                 a field of the scenario
``attacker.position``, ``target.position``  a field of a player
``d1.position``                             of the first defender; ``defenders.0.position``
                                            and ``defenders[0].position`` are the same
``attacker.position.x``                     a coordinate; ``attacker.position[0]`` too
``d*.position``                             of every defender; ``defenders.*.position`` and
                                            ``defenders[*].position`` are the same
``*.position``                              of every player that has the field
==========================================  ===============================================

The normal form names columns and coordinates: ``defenders.0.position.x``, defenders numbered from 0 behind a dot.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any, TypeVar, overload

from tadcore.errors import ScenarioError

Value = TypeVar("Value")
Other = TypeVar("Other")

AXES = "xyz"
_EXAMPLES = "a path such as attacker.position or d1.visibility_radius"
_INDEX = re.compile(r"\[(\d+|\*)\]")
_LABEL = re.compile(r"^d([1-9]\d{0,8}|\*)(?=\.|$)")
_TEAM = re.compile(r"^defenders\.(\d{1,9}|\*)(?=\.|$)")
_AXIS = re.compile(r"(?<=position\.)[012]$")
_OWNER = re.compile(r"attacker|target|\*|defenders(\.(\d+|\*))?")


def normal(path: Any, field: str = "path") -> str:
    """``d1.position[0]`` as ``defenders.0.position.x``; raises `ScenarioError` for what is no string."""
    if not isinstance(path, str):
        raise ScenarioError(field, path, _EXAMPLES)
    name = _INDEX.sub(r".\1", path)
    name = _LABEL.sub(lambda d: f"defenders.{d[1] if d[1] == '*' else int(d[1]) - 1}", name)
    return _AXIS.sub(lambda axis: AXES[int(axis[0])], name)


def short(path: str) -> str:
    """``defenders.0.position`` as ``d1.position``, which messages and labels show."""
    return _TEAM.sub(lambda d: f"d{d[1] if d[1] == '*' else int(d[1]) + 1}", normal(path))


def label(player: Any) -> Any:
    """The label of a player, such as ``"d1"``, from any way of naming it; what names none comes back as it is."""
    return short(player) if isinstance(player, str) else player


class ByPath(dict[str, Value]):
    """A dict whose keys are paths in normal form, and which finds them by any other spelling too."""

    def __missing__(self, key: object) -> Value:
        name = normal(key) if isinstance(key, str) else key
        if name in self.keys():
            return self[name]
        raise KeyError(f"{short(key) if isinstance(key, str) else repr(key)}; there is {', '.join(map(short, self))}")

    def __contains__(self, key: object) -> bool:
        return super().__contains__(normal(key) if isinstance(key, str) else key)

    @overload
    def get(self, key: str, default: None = None, /) -> Value | None: ...
    @overload
    def get(self, key: str, default: Value, /) -> Value: ...
    @overload
    def get(self, key: str, default: Other, /) -> Value | Other: ...
    def get(self, key: str, default: Any = None, /) -> Any:
        """As of a dict, by any spelling."""
        return super().get(normal(key) if isinstance(key, str) else key, default)


def is_owner(path: str) -> bool:
    """Whether a path is one of a player, or of several, without a field."""
    return _OWNER.fullmatch(normal(path)) is not None


def expand(path: Any, names: Iterable[str]) -> list[str]:
    """Those of the names, in their normal form, that a path means."""
    pattern = re.escape(normal(path)).replace(r"defenders\.\*\.", r"defenders\.\d+\.")
    if pattern.startswith(r"\*\."):
        pattern = r"(attacker|target|defenders\.\d+)\." + pattern[4:]
    return [name for name in names if re.fullmatch(pattern, name)]


def beyond(n: int, path: str) -> str:
    """What the path of a defender that is not among n must be; empty where the path is of no such defender."""
    numbered = re.match(r"(d|defenders\.)(\d+)(\.|$)", normal(path))
    if numbered is None:
        return ""
    place = int(numbered[2][-10:]) - (numbered[1] == "d")
    if len(numbered[2]) < 10 and 0 <= place < n:
        return ""
    return (
        f"the path of a defender of this game, which has {'1 defender, d1' if n == 1 else f'{n} defenders, d1 to d{n}'}"
    )
