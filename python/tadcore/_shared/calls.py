"""Calls that say what is wrong with them: an option that a function does not have, a flag that is none."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

from .arrays import as_flag
from .text import similar

_OF_ONE_GAME = dict.fromkeys(
    ("gains", "mirror"),
    "only tadcore.simulate and tadcore.synthesize have it: many games have scalar gains",
)
"""Options of single games that are asked of many."""

Parameters = ParamSpec("Parameters")
Returned = TypeVar("Returned")


def public(function: Callable[Parameters, Returned]) -> Callable[Parameters, Returned]:
    """The same function, which answers an option that it does not have with the nearest that it has.

    Options annotated as bool must be True or False: an array is neither, and of most objects nobody knows what they
    would mean.
    """
    taken = inspect.signature(function).parameters
    known = [name for name, parameter in taken.items() if parameter.kind is not inspect.Parameter.POSITIONAL_ONLY]
    flags = [name for name, parameter in taken.items() if parameter.annotation in ("bool", bool)]

    @functools.wraps(function)
    def call(*args: Parameters.args, **options: Parameters.kwargs) -> Returned:
        for name in options:
            if name not in taken:
                made = function.__name__ == "__init__"
                raise TypeError(_unknown(type(args[0]).__name__ if made else function.__qualname__, name, known))
        for name in flags:
            if name in options:
                as_flag(name, options[name])
        return function(*args, **options)

    return call


def _unknown(function: str, name: str, known: list[str]) -> str:
    options = [option for option in known if option != "self"]
    hint: Any = _OF_ONE_GAME.get(name) or similar(name, options) or f"it takes {', '.join(options)}"
    return f"{function}() has no option {name!r}; {hint}"
