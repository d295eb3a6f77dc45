"""The order of the wings: a wing of the package imports only from wings below it, and none of its files go in a circle.

Every import counts: those of annotations and those inside functions too, in modules and in stubs.
"""

import ast
import re
from pathlib import Path

import pytest

import tadcore

SOURCES = Path(tadcore.__file__).parent
FLOORS = (
    ("cli",),
    ("explorer",),
    ("analysis",),
    ("study", "verification", "reproduce"),
    ("simulation", "report"),
    ("plotting",),
    ("statistics",),
    ("game",),
    ("scenarios",),
    ("scenario",),
    ("sampling",),
    ("_shared",),
    ("errors",),
    ("_core",),
)
"""From the top; wings of one floor do not import one another."""

FLOOR = {wing: floor for floor, wings in enumerate(FLOORS) for wing in wings}


def modules():
    """Every module and stub with its dotted name, but for the interface of the whole and ``python -m``."""
    for path in sorted([*SOURCES.rglob("*.py"), *SOURCES.rglob("*.pyi")]):
        parts = path.relative_to(SOURCES).with_suffix("").parts
        if parts[-1] == "__init__":
            parts = parts[:-1]
        if parts and parts[0] not in ("__main__", "_core"):
            yield ".".join(("tadcore", *parts)), path


KNOWN = dict(modules()) | {"tadcore._core": None}


def imported(name, path, text):
    """The modules of the package that a module imports anywhere."""
    package = name if path.stem == "__init__" else name.rpartition(".")[0]
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name.partition(".")[0] == "tadcore")
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) + 1 - node.level] if node.level else []
            source = ".".join([*above, *([node.module] if node.module else [])])
            if source.partition(".")[0] == "tadcore":
                for alias in node.names:
                    inner = f"{source}.{alias.name}"
                    yield inner if inner in KNOWN else source


def upward(name, path, text):
    """The imports of a module that do not point down."""
    own = name.split(".")[1]
    for other in imported(name, path, text):
        wing = other.split(".")[1] if "." in other else "the interface of the whole"
        if wing != own and FLOOR.get(wing, -1) <= FLOOR[own]:
            yield f"{name} imports {other}"


def test_every_wing_has_its_floor():
    assert {name.split(".")[1] for name in KNOWN} == set(FLOOR)


def test_contributing_shows_the_same_order():
    page = (Path(__file__).parents[3] / "CONTRIBUTING.md").read_text(encoding="utf-8")
    table = page.partition("<!-- wings")[2].partition("<!-- end of wings")[0]
    rows = re.findall(r"^\| \d+ \| (.+?) \|", table, flags=re.MULTILINE)
    assert tuple(tuple(re.findall(r"`(\w+)`", row)) for row in rows) == FLOORS[:-1]


def test_every_import_points_down():
    found = [line for name, path in modules() for line in upward(name, path, path.read_text(encoding="utf-8"))]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    "planted",
    [
        "from tadcore.study import Study",
        "import tadcore.cli.app",
        "def late():\n    from tadcore import analysis",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from ..study.plan import Plan",
        "from tadcore import simulate",
        "from tadcore.report import report",
    ],
)
def test_a_planted_import_is_found(planted):
    assert list(upward("tadcore.simulation.run", SOURCES / "simulation" / "run.py", planted))


def circle(arrows):
    """A circle of modules, if there is one: what is left when all that import nothing left are taken away."""
    left = {name: set(others) for name, others in arrows.items()}
    while free := [name for name, others in left.items() if not others & left.keys()]:
        for name in free:
            del left[name]
    return sorted(left)


def test_no_modules_import_one_another_in_a_circle():
    arrows = {
        name: set(imported(name, path, path.read_text(encoding="utf-8"))) - {name}
        for name, path in modules()
        if path.stem != "__init__"
    }
    assert circle(arrows) == []
    assert circle({"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": set()}) == ["a", "b", "c"]
