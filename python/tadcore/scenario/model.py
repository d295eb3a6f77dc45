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

``sensing``, ``communication`` and ``disturbance``, of the scenario and of its players: see `tadcore.scenario.tables`.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal, Self

import numpy as np
import tomli_w
from pydantic import BaseModel, BeforeValidator, Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from tadcore._shared.arrays import Floats
from tadcore._shared.files import as_path, write_whole
from tadcore._shared.limits import MOST_DEFENDERS
from tadcore._shared.toml import parse_toml, read_text
from tadcore.errors import ScenarioError

from . import rules
from .checked import NO_FIELD, CheckedModel
from .fields import Gamma, Positive, is_team, refusal, table_of
from .hints import hint, wildcards
from .paths import beyond, expand
from .players import Attacker, Defender, Target
from .tables import Communication, Disturbance, Sensing
from .words import describe, html_of
from .worlds import World, world_of

_ARRAY = re.compile(r"\[\n([^\[\]]+)\]")


def _equal_weights(interaction: str) -> tuple[float, ...]:
    terms = rules.TERMS[interaction]
    return (1.0 / terms,) * terms


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
    feedback: Literal["finite", "receding"] | None = Field(
        default=None, description='"finite": P(t) up to T (the default); "receding": P of one prediction horizon'
    )
    prediction_horizon: Positive | None = Field(
        default=None, description="T_h, the horizon over which P is solved (receding only)"
    )
    criterion: Literal["paper", "component"] | None = Field(
        default=None,
        description='"paper": Θ over all rows (the default); "component": who knows all plays its equilibrium row',
    )
    sensing: Sensing | None = Field(default=None, description="the [sensing] table: failures of sensors and edges")
    communication: Communication | None = Field(
        default=None, description="the [communication] table: links between the players with limited sight"
    )
    disturbance: Disturbance | None = Field(default=None, description="the [disturbance] table: random displacements")
    attacker: Attacker = Field(description="the [attacker] table")
    target: Target = Field(description="the [target] table")
    defenders: Annotated[tuple[Defender, ...], BeforeValidator(is_team)] = Field(
        json_schema_extra={"minItems": 1, "maxItems": MOST_DEFENDERS},
        description="one [[defenders]] table for each defender",
    )

    @model_validator(mode="after")
    def _rules_across_fields(self) -> Self:
        problems = rules.problems(self)
        if problems:
            raise refusal(problems)
        return self

    def parts(self) -> list[tuple[tuple[str | int, ...], Attacker | Target | Defender]]:
        """Attacker, target and defenders, each with where it stands."""
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
        alone = len(self.constrained) == 1
        own = [name for name in _fields_of(type(self)) if name.partition(".")[0] not in _PLAYERS]
        for where, part in self.parts():
            belonging = (
                name
                for name in _fields_of(type(part))
                if part.belongs.get(name.partition(".")[0]) in (None, self.interaction)
            )
            own += [".".join(map(str, (*where, name))) for name in belonging]
        return tuple(name for name in own if not alone or "communication." not in name)

    @property
    def world(self) -> World | None:
        """What may fail, who may be told and what is disturbed; None where nothing is, which is the paper's game."""
        return world_of(self)

    @property
    def is_variant(self) -> bool:
        """Whether feedback or criterion are not the paper's: a receding horizon, or the team criterion."""
        return self.feedback == "receding" or self.criterion == "component"

    @property
    def is_random(self) -> bool:
        """Whether a game depends on ``seed`` and ``trial`` too: something fails at random, or is disturbed."""
        world = self.world
        return world is not None and world.is_random

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
        """A few lines for a reader: the players, the horizon, the radii, and what surrounds the game."""
        return describe(self)

    def __repr__(self) -> str:
        defenders = "1 defender" if self.n == 1 else f"{self.n} defenders"
        return f"Scenario({self.interaction}, {defenders}, dim={self.dim}, T={self.horizon:g}, δ={self.step:g})"

    __str__ = __repr__

    def _repr_html_(self) -> str:
        return html_of(self)

    @model_serializer(mode="wrap", return_type=dict[str, Any])  # pydantic 2.10 would look for Any where a model is made
    def _written(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """What is written can be read: fields of the other interaction are left out."""
        data = {name: value for name, value in handler(self).items() if value is not None}
        _prune(data, self.interaction)
        return data

    def _meant(self, path: Any, value: Any) -> Sequence[str]:
        names = super()._meant(path, value)
        if "*" in names[0]:
            field, _, axis = names[0].rpartition(".")
            tables = dict.fromkeys(name.rpartition(".")[0] for name in self.paths)
            names = expand(path, (*self.paths, *tables))
            names = names or [f"{name}.{axis}" for name in expand(field, self.paths)]
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
        for name, belongs in model.belongs.items():
            if belongs != interaction and isinstance(table, dict):
                table.pop(name, None)


_PLAYERS = ("attacker", "target", "defenders")


def _fields_of(model: type[BaseModel]) -> list[str]:
    """The fields of a model, those of a table of its own by their paths."""
    fields: list[str] = []
    for name in model.model_fields:
        table = None if name in _PLAYERS else table_of(model, name)
        fields += [name] if table is None else [f"{name}.{inner}" for inner in table.model_fields]
    return fields
