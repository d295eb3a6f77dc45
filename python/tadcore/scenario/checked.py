"""A frozen pydantic model that can only be made valid, and that says `ScenarioError` when it cannot.

Pydantic turns a `ValueError` raised while it validates into its own `ValidationError`. The models here turn that back,
once, at the outermost entry: the constructor, ``model_validate`` and its relatives, ``model_copy`` and ``replace``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar, dataclass_transform

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    ValidationError,
    model_serializer,
)

from tadcore.errors import ScenarioError

from .described import DEPRECATED, described, plain_signature
from .fields import owner_of, path_of, scenario_error
from .paths import AXES, normal

if TYPE_CHECKING:
    from pydantic._internal._model_construction import ModelMetaclass
else:
    ModelMetaclass = type(BaseModel)

Model = TypeVar("Model")

NO_FIELD = "the path of a field that exists, such as attacker.position or d1.position"
_IMMUTABLE = "left as it is: scenarios are immutable, use replace"


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(Field,))
class _CheckedMeta(ModelMetaclass):
    """Only a call from outside comes through here; pydantic builds nested models without calling the class."""

    def __dir__(cls) -> list[str]:  # noqa: N805
        return [name for name in super().__dir__() if name not in DEPRECATED]

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

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        """Say in the docstring what every field is, and in the signature what it takes, in plain types."""
        super().__pydantic_init_subclass__(**kwargs)
        cls.__doc__ = described(cls)
        cls.__signature__ = plain_signature(cls)

    def __dir__(self) -> list[str]:
        return [name for name in super().__dir__() if name not in DEPRECATED]

    if not TYPE_CHECKING:  # a type checker knows that the fields are frozen

        def __setattr__(self, name: str, value: object) -> None:
            raise ScenarioError(path_of((name,), self._root), value, _IMMUTABLE)

        def __delattr__(self, name: str) -> None:
            raise ScenarioError(path_of((name,), self._root), "del", _IMMUTABLE)

    def __repr_args__(self) -> Iterable[tuple[str | None, Any]]:
        """A field that is None is one that is left out."""
        return ((name, value) for name, value in super().__repr_args__() if value is not None)

    @model_serializer(mode="wrap", return_type=dict[str, Any])  # pydantic 2.10 would look for Any where a model is made
    def _written(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """What is left out is not written."""
        return {name: value for name, value in handler(self).items() if value is not None}

    def __setstate__(self, state: dict[Any, Any]) -> None:
        """Take what a pickle holds, if it is valid: it may have been written by another version, or by hand."""
        try:
            super().__setstate__(state)
        except (KeyError, TypeError, AttributeError):
            raise ScenarioError(self._root or "scenario", state, "the state of a pickled one") from None
        super().__setstate__(type(self).model_validate(self).__getstate__())

    @classmethod
    def model_validate(cls, obj: Any, **options: Any) -> Self:
        """Validate a dict or an instance; raises `ScenarioError`."""
        return _validated(cls, super().model_validate, obj, options)

    @classmethod
    def model_validate_json(cls, json_data: str | bytes | bytearray, **options: Any) -> Self:
        """Validate a JSON text; raises `ScenarioError`."""
        return _validated(cls, super().model_validate_json, json_data, options)

    @classmethod
    def model_validate_strings(cls, obj: Any, **options: Any) -> Self:
        """Validate a dict of strings; raises `ScenarioError`, since no string is taken for a number."""
        return _validated(cls, super().model_validate_strings, obj, options)

    @classmethod
    def model_construct(cls, _fields_set: set[str] | None = None, **values: Any) -> Self:  # type: ignore[override]
        """A model from its fields, validated: there is no way around the rules."""
        return cls(**values)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A copy, with ``update`` validated like everything else."""
        return super().model_copy(deep=deep) if update is None else self.replace(update)

    def copy(self, *, include: Any = None, exclude: Any = None, update: Any = None, deep: bool = False) -> Self:
        """The same as `model_copy`; a copy without some of the fields would be none."""
        for name, value in (("include", include), ("exclude", exclude)):
            if value is not None:
                raise ScenarioError(name, value, "left out: a copy has every field; model_dump takes some of them")
        return self.model_copy(update=update, deep=deep)

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
        if not isinstance(updates, Mapping | None):
            raise ScenarioError("updates", updates, 'a dict of paths and values, such as {"d1.visibility_radius": 2.0}')
        changes = {**(updates or {}), **fields}
        data = self._plain(changes)
        taken: dict[str, str] = {}
        for path, value in changes.items():
            for name in self._meant(path, value):
                if name in taken:
                    raise ScenarioError(path, value, f'set once only: "{taken[name]}" sets it too')
                taken[name] = path
                try:
                    _assign(data, name, value, type(self))
                except LookupError:
                    raise ScenarioError(path, value, self._rule_of(path)) from None
        return type(self).model_validate(data)

    def _meant(self, path: Any, value: Any) -> Sequence[str]:
        """The fields that a path means, in normal form."""
        if not isinstance(path, str):
            raise ScenarioError(str(path), value, "named by a path such as attacker.position or d1.position")
        return [normal(path)]

    def _rule_of(self, path: str, rule: str = NO_FIELD) -> str:
        """What a path that leads nowhere must be."""
        return rule

    def _plain(self, changes: Mapping[str, Any]) -> dict[str, Any]:
        """The fields to start a replacement from."""
        return self.model_dump()


def _validated(model: type[Any], validate: Callable[..., Model], given: Any, options: dict[str, Any]) -> Model:
    """What pydantic makes of something, under the rules of the model whatever the options are."""
    if options.get("extra") not in (None, "forbid"):
        raise ScenarioError("extra", options["extra"], 'left out, or "forbid": what is no field is refused')
    try:
        return validate(given, **options)
    except ValidationError as error:
        raise _translate(model, error) from None


def _translate(model: type[Any], error: ValidationError) -> ScenarioError:
    return scenario_error(error, model, model._root)


def _assign(data: dict[str, Any], name: str, value: Any, model: type[BaseModel]) -> None:
    """Set the entry of a nested table that `name` means, or raise LookupError; tuples and models are opened."""
    node: Any = data
    *way, last = name.split(".")
    location: tuple[str | int, ...] = ()
    for part in way:
        location += (int(part) if part.isdecimal() and len(part) < 10 else part,)
        if isinstance(node, dict) and node.get(part) is None and owner_of(model, (*location, "")) is not None:
            node[part] = {}  # a table that is left out is begun
        key = _key(node, part)
        node[key] = node = _open(node[key])
    if isinstance(node, dict) and last.isidentifier():
        node[last] = value  # a field that does not exist is refused by the model, which knows the others
    else:
        node[_key(node, last)] = value


def _key(node: Any, part: str) -> str | int:
    """The key of a part of a path in a table or a list."""
    if isinstance(node, dict) and part in node:
        return part
    if isinstance(node, list):
        place = AXES.find(part) if part in ("x", "y", "z") else int(part) if part.isdecimal() and len(part) < 10 else -1
        if 0 <= place < len(node):
            return place
    raise LookupError(part)


def _open(child: Any) -> Any:
    if isinstance(child, BaseModel):
        return child.model_dump(exclude_unset=True)
    return list(child) if isinstance(child, tuple) else child
