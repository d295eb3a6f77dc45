"""The scenario that somebody means: one that is made, the file of one, or the name of a bundled one."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TypeAlias

from tadcore.errors import ScenarioError
from tadcore.scenario.model import Scenario

from . import find

ScenarioLike: TypeAlias = Scenario | str | os.PathLike[str]
"""A scenario, the path of its TOML file, or the name of a bundled one: whatever plays a game takes any of them."""

_RULE = "a Scenario, the path of a TOML file, or the name of a bundled scenario"


def as_scenario(given: object) -> Scenario:
    """The scenario that is given, read or bundled; raises `ScenarioError`, also for one that was tampered with."""
    if isinstance(given, str):
        if "\n" in given:
            raise ScenarioError("scenario", given, f"{_RULE}; Scenario.from_toml_string reads a text")
        return find(given, field="scenario")
    if isinstance(given, Path):
        return Scenario.from_toml(given)
    if not isinstance(given, Scenario):
        raise ScenarioError("scenario", given, _RULE)
    try:
        valid = Scenario.model_validate(given)
    except AttributeError:  # made by __new__ alone
        raise ScenarioError("scenario", f"a {type(given).__name__} without fields", _RULE) from None
    if valid.__dict__ != given.__dict__:
        raise ScenarioError("scenario", "one whose fields were overwritten", _RULE)
    return given
