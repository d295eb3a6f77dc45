"""A study from a TOML file.

.. code-block:: toml

    scenario = "paper-i1"        # a bundled name, a file beside this one, or a [scenario] table
    trials = 100_000
    seed = 7                     # 0 by default
    design = "sobol"             # "random" by default, or "latin"
    termination = "continuous"   # "sampled" by default
    keep = "outcomes"            # "all" by default, or "counts"
    passes = true                # a column of passes within a capture radius; false by default

    [vary]
    "attacker.position" = { box = [[-3, -3], [3, 3]] }
    "target.position" = { disk = { center = [0, 1], radius = 0.5 } }
    "d*.visibility_radius" = { scipy = "uniform", loc = 1, scale = 4 }
    "d1.capture_radius" = { values = [0.1, 0.2] }
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from tadcore import scenarios
from tadcore._shared.text import similar
from tadcore._shared.toml import parse_toml, read_text
from tadcore.errors import MISSING, ScenarioError
from tadcore.sampling.adapters import from_table
from tadcore.scenario.model import Scenario
from tadcore.scenario.paths import is_owner

_KEYS = {
    "scenario": "a bundled scenario's name, a file, or a table",
    "trials": "the number of games",
    "seed": "a whole number",
    "design": '"random", "sobol" or "latin"',
    "termination": '"sampled" or "continuous"',
    "passes": "true or false",
    "keep": '"all", "outcomes" or "counts"',
    "vary": "a table of paths and samplers",
}


def read_study(path: str | os.PathLike[str]) -> dict[str, Any]:
    """What a file gives to `tadcore.Study`; raises `ScenarioError`."""
    return parse_study(read_text(path), os.fspath(path), Path(path).parent)


def parse_study(text: str, name: str, folder: Path) -> dict[str, Any]:
    """What a text gives to `tadcore.Study`: errors of syntax are reported under a name, files are found in a folder."""
    data = parse_toml(text, name)
    for key, value in data.items():
        if key not in _KEYS:
            hint = similar(key, _KEYS) or f"the keys are {', '.join(_KEYS)}"
            raise ScenarioError(key, value, f"left out: a study has no such key; {hint}")
    for key in ("scenario", "trials", "vary"):
        if key not in data and (key != "vary" or not _is_random(data["scenario"], folder)):
            raise ScenarioError(key, MISSING, f"given: {_KEYS[key]}")
    varied = data.get("vary", {})
    if not isinstance(varied, dict):
        raise ScenarioError("vary", varied, _KEYS["vary"])
    vary = {name: from_table(f'vary["{name}"]', table) for name, table in _flat(varied).items()}
    options: dict[str, Any] = {
        key: data[key] for key in ("seed", "design", "termination", "passes", "keep") if key in data
    }
    return {"sc": _scenario(data["scenario"], folder), "vary": vary, "trials": data["trials"], **options}


def _is_random(source: Any, beside: Path) -> bool:
    """Whether a study needs to vary nothing; what is no scenario is refused when it is read as one."""
    try:
        return _scenario(source, beside).is_random
    except ScenarioError:
        return True


def _scenario(source: Any, beside: Path) -> Scenario:
    if isinstance(source, dict):
        return Scenario.model_validate(source)
    if not isinstance(source, str):
        raise ScenarioError("scenario", source, _KEYS["scenario"])
    return scenarios.find(source, beside, field="scenario")


def _flat(tables: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Paths without their quotes, ``attacker.position = {…}``, which TOML nests."""
    flat: dict[str, Any] = {}
    for key, value in tables.items():
        name = f"{prefix}{key}"
        if isinstance(value, dict) and (name == "defenders" or is_owner(name)):
            flat |= _flat(value, f"{name}.")
        else:
            flat[name] = value
    return flat
