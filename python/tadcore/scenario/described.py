"""What ``help`` and completion say of a model: its fields with their meaning, its signature in plain types."""

from __future__ import annotations

import inspect
import operator
import re
from functools import reduce
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic_core import PydanticUndefined

DEPRECATED = frozenset(
    {
        "construct", "copy", "dict", "from_orm", "json", "parse_file", "parse_obj", "parse_raw", "schema",
        "schema_json", "update_forward_refs", "validate",
    }
)  # fmt: skip
"""Methods that pydantic keeps from its first version; completion leaves them out."""


def described(model: type[BaseModel]) -> str:
    """The docstring of a model with a section on every field, before its examples."""
    text = inspect.cleandoc(model.__doc__ or "")
    fields = [f"{name} : {_words(it)}\n    {it.description or ''}".rstrip() for name, it in model.model_fields.items()]
    if not fields or "Parameters\n-----" in text:
        return text
    section = "\n".join(["Parameters", "----------", *fields])
    before, mark, after = text.partition("\n\nExamples\n")
    return f"{before}\n\n{section}{mark}{after}"


def plain_signature(model: type[BaseModel]) -> inspect.Signature:
    """The signature of a model without what pydantic makes of its annotations."""
    parameters = [
        inspect.Parameter(
            name,
            inspect.Parameter.KEYWORD_ONLY,
            default=inspect.Parameter.empty if field.is_required() else _default(field),
            annotation=_plain(field.annotation),
        )
        for name, field in model.model_fields.items()
    ]
    return inspect.Signature(parameters, return_annotation=None)


def _plain(kind: Any) -> Any:
    """A type without what pydantic is told of it."""
    if get_origin(kind) is Annotated:
        return _plain(get_args(kind)[0])
    if get_origin(kind) in (Union, UnionType):
        return reduce(operator.or_, map(_plain, get_args(kind)))
    return kind


class _ByTheGame:
    """Stands for a default that depends on the interaction."""

    def __repr__(self) -> str:
        return "equal"


def _default(field: Any) -> Any:
    return _ByTheGame() if field.default is PydanticUndefined else field.default


def _words(field: Any) -> str:
    kind = re.sub(r"\b(tadcore\.scenario\.\w+|typing)\.", "", inspect.formatannotation(_plain(field.annotation)))
    return kind if field.is_required() else f"{kind}, default {_default(field)!r}"
