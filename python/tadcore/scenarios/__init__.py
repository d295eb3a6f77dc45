"""The eight runs of the paper's section VI, as scenario files.

>>> import tadcore
>>> tadcore.scenarios.names()[0]
'paper-i1'
>>> tadcore.scenarios.load("paper-i1").visibility_radii
array([5.  , 2.25, 1.25])
"""

from __future__ import annotations

from importlib import resources
from pathlib import Path

from tadcore._shared.files import as_path
from tadcore._shared.text import similar
from tadcore.errors import MISSING, ScenarioError
from tadcore.scenario.model import Scenario

__all__ = ["find", "load", "names", "summary", "text"]

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


def find(source: str, folder: Path | None = None, *, field: str = "") -> Scenario:
    """A scenario by its file, or else the bundled one of that name.

    Parameters
    ----------
    source : str
        A path, or a name from `names`.
    folder : path, optional
        What a relative path is relative to; the working folder by default.
    field : str, optional
        What errors call it; the source itself by default.

    Raises
    ------
    ScenarioError
        There is neither, or the file holds no scenario.
    """
    from tadcore.scenario.model import Scenario

    if not isinstance(source, str):
        raise ScenarioError(field or "source", source, "the path of a file, or the name of a bundled scenario")
    path = (Path() if folder is None else as_path("folder", folder)) / source
    try:
        there = "\0" in source or path.exists()
    except OSError as error:
        raise ScenarioError(field or source, error.strerror, "a file, or the name of a bundled scenario") from None
    if not there:
        if source in _NAMES:
            return load(source)
        hint = similar(source, _NAMES, cutoff=0.5)
        rule = f"a file, or the name of a bundled scenario{hint and f'; {hint}'}"
        raise ScenarioError(field or source, MISSING if not field else source, rule)
    try:
        return Scenario.from_toml(path)
    except ScenarioError as error:
        if not error.field.startswith(str(path)):
            error.add_note(f"(in {source})")
        raise


def text(name: str) -> str:
    """The TOML file of a bundled scenario, comments included."""
    if not isinstance(name, str) or name not in _NAMES:
        hint = similar(name, _NAMES, most=2, cutoff=0.5) or f"the names are {', '.join(_NAMES)}"
        raise ScenarioError("scenario name", name, f"the name of a bundled scenario; {hint}")
    return resources.files(__name__).joinpath(f"{name}.toml").read_text(encoding="utf-8")


def summary(name: str) -> str:
    """One line on a bundled scenario: the first line of its file."""
    return text(name).partition("\n")[0].lstrip("# ")
