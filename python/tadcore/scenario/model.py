"""The scenario: everything that defines one game and one start, checked, immutable and written as TOML.

Names follow the paper (Singh and Reddy, *Dynamic network analysis of a target defense differential game with limited
observations*); everything is dimensionless, as there.

================================  =====================  =====================================
field                             paper                  meaning
================================  =====================  =====================================
``horizon``, ``step``             T, δ                   duration, sampling step
``control_weight``                r_p                    cost of a player's own effort
``running_weight``                q_{d_i a}, q_{τa}      weight on the distance to the attacker
``terminal_weight``               f_{d_i a}, f_{τa}      the same at T
``target_running_weight``         q_{aτ}                 attacker's weight on reaching the target
``evasion_running_weight``        q_{a d_i}              attacker's weight on evading the defender
``evasion``                       λ                      0 suicidal attacker, 1 evading attacker
``capture_radius``                σ_p                    within it the game ends
``visibility_radius``             ζ_p                    within it a player sees another
``synthesis_weights``             γ                      weights of the terms of Θ₁ or Θ₂
================================  =====================  =====================================
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
import tomli_w
from pydantic import BeforeValidator, Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from tadcore._shared.arrays import Floats
from tadcore._shared.files import as_path, write_whole
from tadcore._shared.html import as_html, line, thinned
from tadcore._shared.limits import MOST_DEFENDERS, can_be_told, sees_whom_it_intercepts, too_far
from tadcore._shared.toml import parse_toml, read_text
from tadcore.errors import ScenarioError

from .checked import NO_FIELD, CheckedModel
from .fields import (
    Fraction,
    Gamma,
    Position,
    Positive,
    Problem,
    Radius,
    Weight,
    is_team,
    refusal,
)
from .hints import hint, wildcards
from .paths import beyond, expand

_MOST_STEPS = 10_000_000
_DIVISION_TOLERANCE = 1e-9
_TERMS = {"I1": 4, "I2": 3}
_ARRAY = re.compile(r"\[\n([^\[\]]+)\]")


def _equal_weights(interaction: str) -> tuple[float, ...]:
    terms = _TERMS[interaction]
    return (1.0 / terms,) * terms


class Attacker(CheckedModel):
    """The attacker a: it sees everyone, wants the target and, unless suicidal, avoids the defenders."""

    _root: ClassVar[str] = "attacker"
    _belongs: ClassVar[dict[str, str]] = {"evasion": "I1"}

    position: Position = Field(description="X_a(0), the initial position, 2 or 3 finite numbers")
    control_weight: Weight = Field(description="r_a, the cost of effort")
    capture_radius: Positive = Field(description="σ_a, within which it captures the target")
    target_running_weight: Weight = Field(default=1.0, description="q_aτ, weight on the distance to the target")
    target_terminal_weight: Weight = Field(default=1.0, description="f_aτ, the same at T")
    evasion: Fraction = Field(default=1.0, description="λ: 0 suicidal, 1 evading (I1 only)")


class Target(CheckedModel):
    """The target τ: it flees the attacker."""

    _root: ClassVar[str] = "target"
    _belongs: ClassVar[dict[str, str]] = {
        "running_weight": "I1",
        "terminal_weight": "I1",
        "visibility_radius": "I2",
    }

    position: Position = Field(description="X_τ(0), the initial position, 2 or 3 finite numbers")
    control_weight: Weight = Field(description="r_τ, the cost of effort")
    running_weight: Weight = Field(default=1.0, description="q_τa, weight on the distance to the attacker (I1 only)")
    terminal_weight: Weight = Field(default=1.0, description="f_τa, the same at T (I1 only)")
    visibility_radius: Radius = Field(
        default=math.inf, description="ζ_τ, visibility radius; inf for unlimited (I2 only)"
    )


class Defender(CheckedModel):
    """A defender d_i: it wants to intercept the attacker, and sees only what is near."""

    _root: ClassVar[str] = "defender"
    _belongs: ClassVar[dict[str, str]] = {"running_weight": "I1", "terminal_weight": "I1"}

    position: Position = Field(description="X_d(0), the initial position, 2 or 3 finite numbers")
    control_weight: Weight = Field(description="r_d, the cost of effort")
    capture_radius: Positive = Field(description="σ_d, within which it intercepts the attacker")
    visibility_radius: Radius = Field(default=math.inf, description="ζ_d, visibility radius; inf for unlimited")
    running_weight: Weight = Field(default=1.0, description="q_da, weight on the distance to the attacker (I1 only)")
    terminal_weight: Weight = Field(default=1.0, description="f_da, the same at T (I1 only)")
    evasion_running_weight: Weight = Field(default=1.0, description="q_ad, the attacker's weight on evading it")
    evasion_terminal_weight: Weight = Field(default=1.0, description="f_ad, the same at T")


class Scenario(CheckedModel):
    """A game and a start, from TOML, a dict or keywords.

    A scenario cannot hold an invalid value: every way of making one checks every rule, and raises `ScenarioError`
    that names the field, the value and the rule.

    Examples
    --------
    >>> import tadcore
    >>> sc = tadcore.scenarios.load("paper-i1")
    >>> sc.n, sc.dim, sc.steps
    (3, 2, 1200)
    >>> sc.replace({"d2.visibility_radius": 4.0}).visibility_radii
    array([5.  , 4.  , 1.25])
    """

    interaction: Literal["I1", "I2"] = Field(
        description='"I1": defenders against attacker and target; "I2": defenders and target, one team'
    )
    horizon: Positive = Field(description="T, the duration")
    step: Positive = Field(default=0.005, description="δ, the sampling step; it must divide T")
    synthesis_weights: Gamma = Field(
        default_factory=lambda data: _equal_weights(data.get("interaction", "I1")),
        description="γ, weights of the terms of Θ: four in I1, three in I2; equal by default",
    )
    attacker: Attacker = Field(description="the [attacker] table")
    target: Target = Field(description="the [target] table")
    defenders: Annotated[tuple[Defender, ...], BeforeValidator(is_team)] = Field(
        json_schema_extra={"minItems": 1, "maxItems": MOST_DEFENDERS},
        description="one [[defenders]] table for each defender",
    )

    @model_validator(mode="after")
    def _rules_across_fields(self) -> Self:
        problems = [*self._grid_problems(), *self._part_problems()]
        if problems:
            raise refusal(problems)
        return self

    def _grid_problems(self) -> list[Problem]:
        ratio = self.horizon / self.step
        steps = round(ratio) if math.isfinite(ratio) else math.inf
        if steps > _MOST_STEPS:
            return [(("step",), self.step, f"at least the horizon ({self.horizon!r}) over {_MOST_STEPS:,}")]
        if steps < 1 or abs(ratio - steps) > _DIVISION_TOLERANCE * steps:
            return [(("step",), self.step, f"a divisor of the horizon ({self.horizon!r})")]
        return []

    def _part_problems(self) -> list[Problem]:
        problems: list[Problem] = []
        terms = _TERMS[self.interaction]
        if len(self.synthesis_weights) != terms:
            rule = f"a list of {terms} numbers in interaction {self.interaction}"
            problems.append((("synthesis_weights",), self.synthesis_weights, rule))
        for where, part in self._parts():
            for name, interaction in part._belongs.items():
                if name in part.model_fields_set and interaction != self.interaction:
                    rule = f"left out: it belongs to interaction {interaction}, and this is {self.interaction}"
                    problems.append(((*where, name), getattr(part, name), rule))
            if len(part.position) != self.dim:
                rule = f"a list of {self.dim} numbers, as attacker.position is"
                problems.append(((*where, "position"), part.position, rule))
        for i, d in enumerate(self.defenders):
            if not sees_whom_it_intercepts(d.capture_radius, d.visibility_radius):
                rule = f"larger than the capture radius ({d.capture_radius!r})"
                problems.append((("defenders", i, "visibility_radius"), d.visibility_radius, rule))
        return problems or self._range_problems()

    def _range_problems(self) -> list[Problem]:
        extent = float(np.abs(self.positions - self.positions[-1]).max())
        seers = self._parts()[2:] + self._parts()[1:2] * (self.interaction == "I2")
        return [
            ((*where, "visibility_radius"), radius, too_far(extent))
            for (where, _), radius in zip(seers, self.visibility_radii.tolist(), strict=True)
            if not can_be_told(radius, extent)
        ]

    def _parts(self) -> list[tuple[tuple[str | int, ...], Attacker | Target | Defender]]:
        team = [(("defenders", i), d) for i, d in enumerate(self.defenders)]
        return [(("attacker",), self.attacker), (("target",), self.target), *team]

    @property
    def n(self) -> int:
        """Number of defenders."""
        return len(self.defenders)

    @property
    def dim(self) -> int:
        """Number of axes: 2 in the plane (the paper), 3 in space."""
        return len(self.attacker.position)

    @property
    def steps(self) -> int:
        """K: the grid has the K + 1 instants t_k = k T / K."""
        return round(self.horizon / self.step)

    @property
    def players(self) -> tuple[str, ...]:
        """Labels, in the order of every array: d1 … dn, target, attacker."""
        return (*(f"d{i}" for i in range(1, self.n + 1)), "target", "attacker")

    @property
    def constrained(self) -> tuple[str, ...]:
        """Labels of the m players with limited sight: the defenders, and in I2 the target."""
        return self.players[: self.n + (self.interaction == "I2")]

    @property
    def paths(self) -> tuple[str, ...]:
        """Every field that the game has, as `replace` and `sweep` name it: `tadcore.scenario.paths` in normal form."""
        own = [name for name in type(self).model_fields if name not in ("attacker", "target", "defenders")]
        for where, part in self._parts():
            belonging = (
                name for name in type(part).model_fields if part._belongs.get(name) in (None, self.interaction)
            )
            own += [".".join(map(str, (*where, name))) for name in belonging]
        return tuple(own)

    @property
    def positions(self) -> Floats:
        """Initial positions, shape (n + 2, dim), in the order of `players`."""
        return np.array([*(d.position for d in self.defenders), self.target.position, self.attacker.position])

    @property
    def visibility_radii(self) -> Floats:
        """ζ of the `constrained` players, shape (n,) in I1 and (n + 1,) in I2."""
        radii = [d.visibility_radius for d in self.defenders]
        return np.array([*radii, self.target.visibility_radius] if self.interaction == "I2" else radii)

    @property
    def capture_radii(self) -> Floats:
        """σ_d1 … σ_dn and σ_a, shape (n + 1,)."""
        return np.array([*(d.capture_radius for d in self.defenders), self.attacker.capture_radius])

    @classmethod
    def from_toml(cls, path: str | os.PathLike[str]) -> Self:
        """Read a scenario file; raises `ScenarioError` for a file or a field that cannot be accepted."""
        return cls.from_toml_string(read_text(path), name=os.fspath(path))

    @classmethod
    def from_toml_string(cls, text: str, *, name: str = "scenario") -> Self:
        """Read a scenario from a TOML text; errors of syntax are reported under ``name``."""
        return cls.model_validate(parse_toml(text, name))

    def to_toml(self, path: str | os.PathLike[str] | None = None) -> str:
        """The scenario as TOML, every number exactly, and written to ``path`` if given."""
        # Arrays here hold a few numbers: they read better on one line.
        text = _ARRAY.sub(lambda lines: f"[{' '.join(lines[1].split())[:-1]}]", tomli_w.dumps(self.model_dump()))
        if path is not None:
            write_whole(as_path("path", path), text)
        return text

    def describe(self) -> str:
        """A few lines for a reader: the players, the horizon, the radii."""
        names = {
            "I1": "I1, defenders against attacker and target",
            "I2": "I2, defenders and target against attacker",
        }
        lines = [
            names[self.interaction],
            f"T = {self.horizon:g}, δ = {self.step:g}, {self.steps} steps, {self.dim} axes",
        ]
        if self.interaction == "I1":
            lines[0] += f" (λ = {self.attacker.evasion:g})"
        gamma = self.synthesis_weights
        if len(set(gamma)) > 1:
            lines.append(f"γ = ({', '.join(f'{g:g}' for g in gamma)})")
        first = 3 if self.interaction == "I1" else 1
        if missing := [f"γ{i + 1}" for i in range(first, len(gamma)) if gamma[i] == 0.0]:
            lines.append(f"{' = '.join(missing)} = 0: the gains are the limit of a small weight on S")
        sight = dict(zip(self.constrained, self.visibility_radii, strict=True))
        capture = dict(zip([*self.players[: self.n], "attacker"], self.capture_radii, strict=True))
        for label, position in zip(self.players, self.positions, strict=True):
            place = ", ".join(f"{x:g}" for x in position)
            line = f"{label:<8} at ({place}), {_reach(sight.get(label, math.inf))}"
            lines.append(line + (f", captures within {capture[label]:g}" if label in capture else ""))
        return "\n".join(lines)

    def __repr__(self) -> str:
        defenders = "1 defender" if self.n == 1 else f"{self.n} defenders"
        return f"Scenario({self.interaction}, {defenders}, dim={self.dim}, T={self.horizon:g}, δ={self.step:g})"

    __str__ = __repr__

    def _repr_html_(self) -> str:
        sight = dict(zip(self.constrained, self.visibility_radii, strict=True))
        capture = dict(zip([*self.players[: self.n], "attacker"], self.capture_radii, strict=True))
        efforts = [
            *(d.control_weight for d in self.defenders),
            self.target.control_weight,
            self.attacker.control_weight,
        ]
        rows = [
            [
                player,
                f"({', '.join(f'{x:g}' for x in at)})",
                f"{sight.get(player, math.inf):g}".replace("inf", "∞"),
                f"{capture[player]:g}" if player in capture else "–",
                f"{effort:g}",
                "",
            ]
            for player, at, effort in zip(self.players, self.positions, efforts, strict=True)
        ]
        head = ["", "starts at", "visibility ζ", "capture σ", "control weight r", ""]
        return as_html(self.describe().split("\n", 1)[0], head, thinned(rows), line(self.describe().splitlines()[1]))

    @model_serializer(mode="wrap")
    def _without_foreign_fields(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """What is written can be read: fields of the other interaction are left out."""
        data: dict[str, Any] = handler(self)
        _prune(data, self.interaction)
        return data

    def _meant(self, path: Any, value: Any) -> Sequence[str]:
        names = super()._meant(path, value)
        if "*" in names[0]:
            field, _, axis = names[0].rpartition(".")
            names = expand(path, self.paths) or [f"{name}.{axis}" for name in expand(field, self.paths)]
        if missing := beyond(self.n, path):
            raise ScenarioError(path, value, missing)
        if not names:
            rule = "the path of a field that some player of this game has"
            raise ScenarioError(path, value, self._rule_of(path, rule))
        return names

    def _rule_of(self, path: str, rule: str = NO_FIELD) -> str:
        nearest = hint(path, wildcards(self.paths))
        return f"{rule}{nearest and f'; {nearest}'}"

    def _plain(self, changes: Mapping[str, Any]) -> dict[str, Any]:
        data = self.model_dump()
        interaction = changes.get("interaction", self.interaction)
        if interaction != self.interaction:  # what belonged to the old interaction does not come along
            del data["synthesis_weights"]
            _prune(data, interaction)
        return data


def _prune(data: dict[str, Any], interaction: object) -> None:
    parts: list[tuple[type[Attacker | Target | Defender], Any]] = [
        (Attacker, data.get("attacker")),
        (Target, data.get("target")),
        *((Defender, d) for d in data.get("defenders") or ()),
    ]
    for model, table in parts:
        for name, belongs in model._belongs.items():
            if belongs != interaction and isinstance(table, dict):
                table.pop(name, None)


def _reach(radius: float) -> str:
    return "unlimited sight" if math.isinf(radius) else f"visibility radius {radius:g}"
