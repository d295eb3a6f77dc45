"""A frozen pydantic model that can only be made valid, and that says `ScenarioError` when it cannot.

Pydantic turns a `ValueError` raised while it validates into its own `ValidationError`. The models here turn that back,
once, at the outermost entry: the constructor, ``model_validate`` and its relatives, ``model_copy`` and ``replace``.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Self, dataclass_transform

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from tadcore.errors import ScenarioError

from .fields import scenario_error

if TYPE_CHECKING:
    from pydantic._internal._model_construction import ModelMetaclass
else:
    ModelMetaclass = type(BaseModel)


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(Field,))
class _CheckedMeta(ModelMetaclass):
    """Only a call from outside comes through here; pydantic builds nested models without calling the class."""

    if not TYPE_CHECKING:  # a type checker knows the fields that the constructor takes

        def __call__(cls, *args: Any, **kwargs: Any) -> Any:  # noqa: N805
            try:
                return super().__call__(*args, **kwargs)
            except ValidationError as error:
                raise _translate(cls, error) from None


class CheckedModel(BaseModel, metaclass=_CheckedMeta):
    """The base of `tadcore.Scenario` and its parts."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        strict=False,
        validate_default=True,
        revalidate_instances="always",
        ser_json_inf_nan="constants",
    )

    _root: ClassVar[str] = ""
    """What the path of a field starts with when this model stands alone."""

    if not TYPE_CHECKING:  # a type checker knows that the fields are frozen

        def __setattr__(self, name: str, value: object) -> None:
            try:
                super().__setattr__(name, value)
            except ValidationError as error:
                raise _translate(type(self), error) from None

    @classmethod
    def model_validate(cls, obj: Any, **options: Any) -> Self:
        """Validate a dict or an instance; raises `ScenarioError`."""
        try:
            return super().model_validate(obj, **options)
        except ValidationError as error:
            raise _translate(cls, error) from None

    @classmethod
    def model_validate_json(cls, json_data: str | bytes | bytearray, **options: Any) -> Self:
        """Validate a JSON text; raises `ScenarioError`."""
        try:
            return super().model_validate_json(json_data, **options)
        except ValidationError as error:
            raise _translate(cls, error) from None

    @classmethod
    def model_validate_strings(cls, obj: Any, **options: Any) -> Self:
        """Validate a dict of strings; raises `ScenarioError`, since no string is taken for a number."""
        try:
            return super().model_validate_strings(obj, **options)
        except ValidationError as error:
            raise _translate(cls, error) from None

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A copy, with ``update`` validated like everything else."""
        return self.replace(update) if update else super().model_copy(deep=deep)

    def replace(self, updates: Mapping[str, Any] | None = None, /, **fields: Any) -> Self:
        """A new model with some fields changed, validated as a whole.

        Parameters
        ----------
        updates : mapping of str to object, optional
            Paths and their new values, such as ``{"defenders[1].visibility_radius": 2.0}``.
        **fields
            The same, for top-level fields.

        Raises
        ------
        ScenarioError
            A path leads nowhere, or the result breaks a rule.
        """
        changes = {**(updates or {}), **fields}
        data = self._plain(changes)
        for path, value in changes.items():
            _assign(data, path, value)
        return type(self).model_validate(data)

    def _plain(self, changes: Mapping[str, Any]) -> dict[str, Any]:
        """The fields to start a replacement from."""
        return self.model_dump()


def _translate(model: type[Any], error: ValidationError) -> ScenarioError:
    return scenario_error(error, model, model._root)


_PATH = re.compile(r"[A-Za-z_]\w*(\[\d+\])*(\.[A-Za-z_]\w*(\[\d+\])*)*")
_PART = re.compile(r"[A-Za-z_]\w*|\d+")


def _assign(data: dict[str, Any], path: str, value: Any) -> None:
    """Set the entry of a nested table that `path` names; tuples and models on the way are opened."""
    if not isinstance(path, str) or not _PATH.fullmatch(path):
        raise ScenarioError(str(path), value, "named by a path such as attacker.position or defenders[0].position")
    parts: list[str | int] = [int(part) if part.isdigit() else part for part in _PART.findall(path)]
    node: Any = data
    for part in parts[:-1]:
        node[part] = child = _open(_look_up(node, part, path, value))
        node = child
    last = parts[-1]
    if isinstance(last, int):
        _look_up(node, last, path, value)
    elif not isinstance(node, dict):
        raise ScenarioError(path, value, "the path of a field that exists")
    node[last] = value


def _look_up(node: Any, part: str | int, path: str, value: Any) -> Any:
    try:
        if isinstance(part, int) == isinstance(node, list):
            return node[part]
    except IndexError:
        rule = f"the path of a field that exists: the list holds {len(node)}, numbered from 0"
        raise ScenarioError(path, value, rule) from None
    except (KeyError, TypeError):
        pass
    raise ScenarioError(path, value, "the path of a field that exists")


def _open(child: Any) -> Any:
    if isinstance(child, BaseModel):
        return child.model_dump(exclude_unset=True)
    return list(child) if isinstance(child, tuple) else child
