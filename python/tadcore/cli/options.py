"""What commands share: the scenario they take, changes to it, and folders they write into."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tadcore import scenarios as bundled
from tadcore._shared.files import parse_toml
from tadcore.errors import ScenarioError
from tadcore.scenario.model import Scenario

FAILED = 1
"""The exit code of a game without an equilibrium, and of a check that failed."""

UNDECIDED = 3
"""The exit code of a verification in which nothing failed and something could not be decided."""

Source = Annotated[str, typer.Argument(metavar="SCENARIO", help="A TOML file, or the name of a bundled scenario.")]
Changes = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="PATH=VALUE", help="Change a field, such as d1.visibility_radius=2; repeatable."),
]


def read(source: str, changes: list[str] | None) -> Scenario:
    """The scenario with the changes made; a value is written as in TOML."""
    found: dict[str, object] = {}
    for change in changes or ():
        path, equals, value = change.partition("=")
        if not equals:
            raise ScenarioError("--set", change, "PATH=VALUE, such as d1.visibility_radius=2")
        found[path.strip()] = parse_toml(f"value = {value}", f"--set {path}")["value"]
    sc = bundled.find(source)
    return sc.replace(found) if found else sc


def usable(out: Path | None) -> None:
    """Refuse a destination that cannot be a folder before anything is computed."""
    if out is not None:
        try:
            out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ScenarioError("--out", str(out), f"a folder that can be written ({error.strerror})") from None
