"""A frozen pydantic model that can only be made valid, and that says `ScenarioError` when it cannot.

Pydantic turns a `ValueError` raised while it validates into its own `ValidationError`. The models here turn that back,
once, at the outermost entry: the constructor, ``model_validate`` and its relatives, ``model_copy`` and ``replace``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Self, dataclass_transform

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from tadcore.errors import ScenarioError

from .fields import scenario_error
from .paths import AXES, normal

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
            Paths and their new values, such as ``{"d1.visibility_radius": 2.0}``, or with a wildcard
            ``{"d*.visibility_radius": 2.0}``; `tadcore.scenario.paths` has the grammar.
        **fields
            The same, for top-level fields.

        Raises
        ------
        ScenarioError
            A path leads nowhere, or the result breaks a rule.
        """
        changes = {**(updates or {}), **fields}
        data = self._plain(changes)
        taken: dict[str, str] = {}
        for path, value in changes.items():
            for name in self._meant(path, value):
                if name in taken:
                    raise ScenarioError(path, value, f'set once only: "{taken[name]}" sets it too')
                taken[name] = path
                _assign(data, name, path, value)
        return type(self).model_validate(data)

    def _meant(self, path: Any, value: Any) -> Sequence[str]:
        """The fields that a path means, in normal form."""
        if not isinstance(path, str):
            raise ScenarioError(str(path), value, "named by a path such as attacker.position or d1.position")
        return [normal(path)]

    def _plain(self, changes: Mapping[str, Any]) -> dict[str, Any]:
        """The fields to start a replacement from."""
        return self.model_dump()


def _translate(model: type[Any], error: ValidationError) -> ScenarioError:
    return scenario_error(error, model, model._root)


_NO_FIELD = "the path of a field that exists, such as attacker.position or d1.position"


def _assign(data: dict[str, Any], name: str, path: str, value: Any) -> None:
    """Set the entry of a nested table that `name` means; tuples and models on the way are opened."""
    node: Any = data
    *way, last = name.split(".")
    for part in way:
        key = _key(node, part, path, value)
        node[key] = node = _open(node[key])
    if isinstance(node, dict) and last.isidentifier():
        node[last] = value  # a field that does not exist is refused by the model, which knows the others
    else:
        node[_key(node, last, path, value)] = value


def _key(node: Any, part: str, path: str, value: Any) -> str | int:
    """The key of a part of a path in a table or a list."""
    if isinstance(node, dict) and part in node:
        return part
    if isinstance(node, list):
        place = AXES.find(part) if part in ("x", "y", "z") else int(part) if part.isdecimal() and len(part) < 10 else -1
        if 0 <= place < len(node):
            return place
    raise ScenarioError(path, value, _NO_FIELD)


def _open(child: Any) -> Any:
    if isinstance(child, BaseModel):
        return child.model_dump(exclude_unset=True)
    return list(child) if isinstance(child, tuple) else child
