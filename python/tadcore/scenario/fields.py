"""The kinds of field a scenario is made of, and how a refusal becomes a `ScenarioError`.

Each kind has one rule, written once: the validator here, the bound in the JSON schema beside it, and the words that a
reader sees. Nothing is coerced: a string, a bool or a decimal is never taken for a number.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Annotated, Any, TypeAlias, get_args

import numpy as np
from pydantic import BaseModel, BeforeValidator, Field, ValidationError
from pydantic_core import ErrorDetails, PydanticCustomError

from tadcore._shared.limits import (
    COORDINATE,
    DISTURBANCE,
    FARTHEST,
    FINITE,
    FRACTION,
    HEAVIEST,
    LIGHTEST,
    LINK_RADIUS,
    MEAN_TIME,
    MOST_DEFENDERS,
    POSITIVE,
    RADIUS,
    WEIGHT,
    Rule,
)
from tadcore._shared.text import similar
from tadcore.errors import MISSING, ScenarioError

Location: TypeAlias = tuple[str | int, ...]
Problem: TypeAlias = tuple[Location, object, str]
"""Where (relative to the field that refuses), what was found, and what it must be."""


class _Problems(tuple[Problem, ...]):
    """Problems on their way through pydantic, which prints what it carries: a value may be too long for that."""

    __slots__ = ()

    def __repr__(self) -> str:
        return f"{len(self)} problems"


def refusal(problems: Iterable[Problem]) -> PydanticCustomError:
    """An error that pydantic carries outward and `scenario_error` unfolds."""
    found = _Problems(problems)
    return PydanticCustomError(
        "tadcore", "must be {rules}", {"problems": found, "rules": "; ".join(rule for _, _, rule in found)}
    )


def refuse(value: object, rule: str) -> PydanticCustomError:
    """The refusal of one value."""
    return refusal([((), value, rule)])


def as_number(value: object, rule: str) -> float:
    """A Python float from an int, a float or a NumPy scalar; anything else is refused."""
    plain = value.item() if isinstance(value, np.generic) else value
    if isinstance(plain, bool) or not isinstance(plain, int | float):
        raise refuse(value, rule)
    try:
        return float(plain)
    except OverflowError:
        raise refuse(value, rule) from None


def _kind(rule: Rule) -> Callable[[object], float]:
    def check(value: object) -> float:
        number = as_number(value, rule.words)
        if not rule.holds(number):
            raise refuse(value, rule.words)
        return number

    return check


is_positive, is_radius, is_fraction = _kind(POSITIVE), _kind(RADIUS), _kind(FRACTION)
is_mean_time, is_link_radius, is_disturbance = _kind(MEAN_TIME), _kind(LINK_RADIUS), _kind(DISTURBANCE)
_is_bounded_weight, _is_near, _is_finite = _kind(WEIGHT), _kind(COORDINATE), _kind(FINITE)


def is_weight(value: object) -> float:
    """A positive finite number within the bounds of weights."""
    return _is_bounded_weight(is_positive(value))


def _is_coordinate(value: object) -> float:
    return _is_near(_is_finite(value))


def _sequence(value: object, rule: str) -> list[Any]:
    if isinstance(value, np.ndarray) and value.ndim == 1:
        return list(value)
    if isinstance(value, list | tuple):
        return list(value)
    raise refuse(value, rule)


def _each(values: list[Any], check: Callable[[object], float]) -> tuple[float, ...]:
    """Every entry through `check`, with all refusals gathered under their index."""
    numbers: list[float] = []
    problems: list[Problem] = []
    for index, value in enumerate(values):
        try:
            numbers.append(check(value))
        except PydanticCustomError as error:
            context = error.context or {}
            problems += [((index, *where), found, rule) for where, found, rule in context["problems"]]
    if problems:
        raise refusal(problems)
    return tuple(numbers)


def is_position(value: object) -> tuple[float, ...]:
    """Two or three finite coordinates."""
    rule = "a list of 2 or 3 finite numbers"
    values = _sequence(value, rule)
    if len(values) not in (2, 3):
        raise refuse(value, rule)
    return _each(values, _is_coordinate)


def is_gamma(value: object) -> tuple[float, ...]:
    """Three or four weights in [0, 1], not all of them zero."""
    rule = "a list of 4 (I1) or 3 (I2) numbers in [0, 1]"
    values = _sequence(value, rule)
    if len(values) not in (3, 4):
        raise refuse(value, rule)
    numbers = _each(values, is_fraction)
    if not any(numbers):
        raise refuse(value, "positive in at least one entry")
    return numbers


def is_count(value: object) -> int:
    """A whole number, 0 or more."""
    rule = f"a whole number from 0 to {MOST_DEFENDERS}"
    plain = value.item() if isinstance(value, np.generic) else value
    if isinstance(plain, bool) or not isinstance(plain, int) or not 0 <= plain <= MOST_DEFENDERS:
        raise refuse(value, rule)
    return plain


def is_team(value: object) -> object:
    """At least one defender, and no more than any game could play."""
    rule = "a list of at least one defender ([[defenders]] tables in TOML)"
    team = _sequence(value, rule)
    if not team:
        raise refuse(value, rule)
    if len(team) > MOST_DEFENDERS:
        raise refuse(f"{len(team):,} defenders", f"a list of at most {MOST_DEFENDERS:,} defenders")
    return value


Positive = Annotated[float, Field(gt=0.0), BeforeValidator(is_positive)]
Weight = Annotated[float, Field(ge=LIGHTEST, le=HEAVIEST), BeforeValidator(is_weight)]
Radius = Annotated[float, Field(gt=0.0), BeforeValidator(is_radius)]
Fraction = Annotated[float, Field(ge=0.0, le=1.0), BeforeValidator(is_fraction)]
LinkRadius = Annotated[float, Field(gt=0.0), BeforeValidator(is_link_radius)]
MeanTime = Annotated[float, Field(gt=0.0), BeforeValidator(is_mean_time)]
Disturbed = Annotated[float, Field(ge=0.0, le=FARTHEST), BeforeValidator(is_disturbance)]
Relays = Annotated[int, Field(ge=0, le=MOST_DEFENDERS), BeforeValidator(is_count)]
Position = Annotated[tuple[float, ...], Field(min_length=2, max_length=3), BeforeValidator(is_position)]
Gamma = Annotated[tuple[float, ...], Field(min_length=3, max_length=4), BeforeValidator(is_gamma)]


def path_of(location: Location, root: str = "") -> str:
    """``("defenders", 1, "position")`` as ``"defenders[1].position"``."""
    path = root
    for part in location:
        path += f"[{part}]" if isinstance(part, int) else f".{part}" if path else str(part)
    return path


def table_of(model: type[BaseModel], name: str) -> type[BaseModel] | None:
    """The model of a field that is a table, or a list of tables; None for any other field."""
    field = model.model_fields.get(name)
    if field is None:
        return None
    inner = [field.annotation, *get_args(field.annotation)]
    return next((c for c in inner if isinstance(c, type) and issubclass(c, BaseModel)), None)


def owner_of(model: type[BaseModel], location: Location) -> type[BaseModel] | None:
    """The model whose field the last part of `location` names."""
    found: type[BaseModel] | None = model
    for part in location[:-1]:
        if isinstance(part, str) and found is not None:
            found = table_of(found, part)
    return found


def _missing(owner: type[BaseModel] | None, name: str) -> str:
    field = owner.model_fields.get(name) if owner else None
    return f"given: {field.description}" if field and field.description else "given"


_HINTS = 100  # unknown fields for which a known one is looked up; a file may hold a million


def _unknown(owner: type[BaseModel] | None, name: str, hint: bool) -> str:
    if owner is None or not hint:
        return "left out: there is no such field"
    inner = [t for t in owner.model_fields if (table := table_of(owner, t)) and name in table.model_fields]
    meant = f"did you mean {inner[0]}.{name}?" if len(inner) == 1 else similar(name, owner.model_fields)
    known = meant or f"the fields are {', '.join(owner.model_fields)}"
    return f"left out: there is no such field; {known}"


def _unfold(detail: ErrorDetails, model: type[BaseModel], root: str, hint: bool) -> list[ScenarioError]:
    location: Location = detail["loc"]
    kind = detail["type"]
    name = str(location[-1]) if location else ""
    if kind == "tadcore":
        problems: tuple[Problem, ...] = detail["ctx"]["problems"]
        return [ScenarioError(path_of((*location, *sub), root) or "scenario", v, rule) for sub, v, rule in problems]
    if kind == "default_factory_not_called":  # a consequence of another field's error
        return []
    field = path_of(location, root) or "scenario"
    if kind == "missing":
        return [ScenarioError(field, MISSING, _missing(owner_of(model, location), name))]
    if kind == "extra_forbidden":
        return [ScenarioError(field, detail["input"], _unknown(owner_of(model, location), name, hint))]
    if kind == "literal_error":
        return [ScenarioError(field, detail["input"], str(detail["ctx"]["expected"]).replace("'", '"'))]
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        return [ScenarioError(field, detail["input"], "a table of fields")]
    if kind == "json_invalid":
        return [ScenarioError(field, detail["input"], f"valid JSON ({detail['ctx']['error']})")]
    rule = detail["msg"].removeprefix("Input should be ")
    return [ScenarioError(field, detail["input"], rule)]


def scenario_error(error: ValidationError, model: type[BaseModel], root: str = "") -> ScenarioError:
    """What pydantic found, in the words of this library; fields are named from `root`."""
    return ScenarioError.collect(
        single
        for number, detail in enumerate(error.errors(include_url=False))
        for single in _unfold(detail, model, root, number < _HINTS)
    )
