"""Which quantities of a scenario a study varies: paths, wildcards, and where each value goes.

A path is a player, a dot and a field: ``attacker.position``, ``defenders.0.visibility_radius``; ``defenders[0]`` is
accepted too, a single coordinate is ``target.position.x``, and a wildcard in place of the player, or of the number of
a defender, stands for all that have the field.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tadcore.errors import ScenarioError
from tadcore.sampling.adapters import as_sampler
from tadcore.sampling.shapes import Sampler

if TYPE_CHECKING:
    from tadcore.scenario.model import Scenario

__all__ = ["Quantity", "component", "quantities", "setups"]

_AXES = "xyz"
_PURPOSES = {"position": 0, "visibility_radius": 1, "capture_radius": 2, "x": 3, "y": 4, "z": 5}
_INDEXED = re.compile(r"\[(\d+|\*)\]")


@dataclass(frozen=True)
class Quantity:
    """One position, coordinate or radius of one player."""

    path: str
    field: str
    row: int
    """The player's place in the order of the arrays of a batch: positions, or radii."""
    axis: int | None
    """The coordinate, where only one of a position varies."""
    components: int
    purpose: int
    """Number of the stream: 8 times the player's (attacker 0, target 1, then the defenders) plus the field's."""

    @property
    def owner(self) -> str:
        """Path of the scenario's field that holds it."""
        return self.path if self.axis is None else self.path.rpartition(".")[0]

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of its columns in the table of a study."""
        if self.field != "position" or self.axis is not None:
            return (self.path,)
        return tuple(f"{self.path}.{_AXES[axis]}" for axis in range(self.components))


def quantities(sc: Scenario, vary: Mapping[str, Any]) -> tuple[tuple[Quantity, Sampler], ...]:
    """Every quantity that varies, with its sampler, in the order attacker, target, defenders.

    Raises
    ------
    ScenarioError
        A path leads nowhere or to a weight, two paths mean the same quantity, or a sampler does not fit.
    """
    known = _known(sc)
    found: dict[str, tuple[Quantity, Sampler, str]] = {}
    for path, value in vary.items():
        field = f'vary["{path}"]'
        sampler = as_sampler(field, value)
        for quantity in _matching(sc, known, path):
            for earlier, _, other in found.values():
                if _same(earlier, quantity):
                    raise ScenarioError(field, quantity.path, f'varied once only: "{other}" varies it too')
            sampler.check(field, quantity.components)
            found[quantity.path] = quantity, sampler, path
    return tuple((q, sampler) for q, sampler, _ in sorted(found.values(), key=lambda entry: entry[0].purpose))


def normal(path: Any) -> str:
    """``defenders[0].position`` as ``defenders.0.position``; refuses what is no path at all."""
    if not isinstance(path, str):
        raise ScenarioError("vary", path, "keyed by paths such as attacker.position")
    return _INDEXED.sub(r".\1", path)


def indexed(path: str) -> str:
    """``defenders.0.position`` as ``defenders[0].position``, which `Scenario.replace` reads."""
    return re.sub(r"\.(\d+)", r"[\1]", path)


def _known(sc: Scenario) -> dict[str, Quantity]:
    """Every quantity that can vary, by its path."""
    team = range(sc.n)
    players = [("attacker", sc.n + 1, sc.n), ("target", sc.n, None), *((f"defenders.{i}", i, i) for i in team)]
    known: dict[str, Quantity] = {}
    for number, (player, place, capture) in enumerate(players):
        parts: list[tuple[str, str, int, int | None, int]] = [("position", "position", place, None, sc.dim)]
        parts += [("position", _AXES[axis], place, axis, 1) for axis in range(sc.dim)]
        if place < len(sc.constrained):
            parts.append(("visibility_radius", "visibility_radius", place, None, 1))
        if capture is not None:
            parts.append(("capture_radius", "capture_radius", capture, None, 1))
        for field, part, row, axis, components in parts:
            path = f"{player}.{field}" + ("" if axis is None else f".{part}")
            known[path] = Quantity(path, field, row, axis, components, 8 * number + _PURPOSES[part])
    return known


def _same(one: Quantity, other: Quantity) -> bool:
    """Whether two quantities share a column."""
    together = one.field == other.field and one.row == other.row
    return together and (one.axis is None or other.axis is None or one.axis == other.axis)


def _matching(sc: Scenario, known: Mapping[str, Quantity], path: str) -> list[Quantity]:
    matched = expand(path, known)
    if not matched:
        raise _refused(sc, known, path)
    return [known[name] for name in matched]


def expand(path: str, names: Iterable[str]) -> list[str]:
    """The names that a path means: a wildcard stands for one player, or for the number of a defender."""
    pattern = re.escape(normal(path)).replace(r"defenders\.\*\.", r"defenders\.\d+\.")
    if pattern.startswith(r"\*\."):
        pattern = r"(attacker|target|defenders\.\d+)\." + pattern[4:]
    return [name for name in names if re.fullmatch(pattern, name)]


def _refused(sc: Scenario, known: Mapping[str, Quantity], path: str) -> ScenarioError:
    """The error for a path that cannot vary: what would be right instead."""
    pattern = normal(path)
    if expand(path, game_fields(sc)):
        way = f'tadcore.sweep(study, {{"{path}": [...]}})'
        return ScenarioError(
            f'vary["{path}"]', path, f"a position or a radius: anything else makes another game, which {way} varies"
        )
    if sc.interaction == "I1" and pattern == "target.visibility_radius":
        return ScenarioError(
            f'vary["{path}"]', path, "left out: it belongs to interaction I2, and this is I1, where the target sees all"
        )
    if beyond(sc, pattern):
        return ScenarioError(f'vary["{path}"]', path, beyond(sc, pattern))
    wild = {re.sub(r"^defenders\.\d+", "defenders.*", name) for name in known if name.startswith("defenders")}
    close = difflib.get_close_matches(pattern, [*known, *wild], n=1, cutoff=0.4)
    hint = f"; did you mean {close[0]}?" if close else ""
    some = "attacker.position, defenders.*.visibility_radius or defenders.0.capture_radius"
    return ScenarioError(f'vary["{path}"]', path, f"the path of a position or a radius, such as {some}{hint}")


def beyond(sc: Scenario, path: str) -> str:
    """What the path of a defender that is not there must be; nothing where the path is of no such defender."""
    numbered = re.match(r"defenders\.(\d+)(\.|$)", path)
    if numbered is None or (len(numbered[1]) < 10 and int(numbered[1]) < sc.n):
        return ""
    team = "1 defender, number 0" if sc.n == 1 else f"{sc.n} defenders, numbered from 0 to {sc.n - 1}"
    return f"the path of a defender of this game, which has {team}"


def game_fields(sc: Scenario) -> list[str]:
    """Paths of the fields that a study cannot vary: weights, horizon, step."""
    tables: list[tuple[str, Any]] = [("", sc), ("attacker.", sc.attacker), ("target.", sc.target)]
    tables += [(f"defenders.{i}.", d) for i, d in enumerate(sc.defenders)]
    apart = {"position", "visibility_radius", "capture_radius", "attacker", "target", "defenders"}
    return [f"{prefix}{name}" for prefix, table in tables for name in type(table).model_fields if name not in apart]


def component(sc: Scenario, name: str) -> Quantity:
    """The single number of that name, such as ``attacker.position.x`` or ``defenders.0.visibility_radius``."""
    found = _known(sc).get(name) if isinstance(name, str) else None
    if found is None or found.components > 1 or found.path.endswith(".position"):
        rule = "a number that varies within one game, such as attacker.position.x or defenders.0.visibility_radius"
        missing = beyond(sc, name) if isinstance(name, str) else ""
        raise ScenarioError("input", name, missing or f"{rule}, of a player of this game")
    return found


def setups(
    sc: Scenario, varied: tuple[Quantity, ...], values: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Positions (M, n + 2, dim), visibility and capture radii from one column for each component.

    Radii have one row for each trial, (M, m) and (M, n + 1), or where none of their kind varies one for all.
    """
    games = len(values)
    arrays = {"visibility_radius": sc.visibility_radii, "capture_radius": sc.capture_radii}
    arrays |= {"position": sc.positions}
    for name in {"position"} | {quantity.field for quantity in varied}:
        arrays[name] = np.repeat(arrays[name][np.newaxis], games, axis=0)
    column = 0
    for quantity in varied:
        drawn = values[:, column : column + quantity.components]
        column += quantity.components
        if quantity.field != "position":
            arrays[quantity.field][:, quantity.row] = drawn[:, 0]
        elif quantity.axis is None:
            arrays["position"][:, quantity.row, :] = drawn
        else:
            arrays["position"][:, quantity.row, quantity.axis] = drawn[:, 0]
    return arrays["position"], arrays["visibility_radius"], arrays["capture_radius"]
