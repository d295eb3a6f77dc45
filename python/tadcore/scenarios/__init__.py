"""The eight runs of the paper's section VI, as scenario files.

>>> import tadcore
>>> tadcore.scenarios.names()[0]
'paper-i1'
>>> tadcore.scenarios.load("paper-i1").visibility_radii
array([5.  , 2.25, 1.25])
"""

from __future__ import annotations

import difflib
from importlib import resources
from typing import TYPE_CHECKING

from tadcore.errors import ScenarioError

if TYPE_CHECKING:
    from tadcore.scenario.model import Scenario

__all__ = ["load", "names", "summary", "text"]

_NAMES = (
    "paper-i1",
    "paper-i1-full",
    "paper-i1-suicidal",
    "paper-i1-suicidal-full",
    "paper-i2-full",
    "paper-i2-far",
    "paper-i2",
    "paper-i2-wide",
)


def names() -> tuple[str, ...]:
    """The bundled scenarios, in the order of the paper's text."""
    return _NAMES


def load(name: str) -> Scenario:
    """A bundled scenario; raises `ScenarioError` for a name that is not one, and suggests the nearest."""
    from tadcore.scenario.model import Scenario

    return Scenario.from_toml_string(text(name), name=f"{name}.toml")


def text(name: str) -> str:
    """The TOML file of a bundled scenario, comments included."""
    if name not in _NAMES:
        close = difflib.get_close_matches(str(name), _NAMES, n=2, cutoff=0.5)
        hint = f"did you mean {' or '.join(close)}?" if close else f"the names are {', '.join(_NAMES)}"
        raise ScenarioError("scenario name", name, f"the name of a bundled scenario; {hint}")
    return resources.files(__name__).joinpath(f"{name}.toml").read_text(encoding="utf-8")


def summary(name: str) -> str:
    """One line on a bundled scenario: the first line of its file."""
    return text(name).partition("\n")[0].lstrip("# ")
