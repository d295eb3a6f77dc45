"""Every example in a docstring runs."""

import doctest
import importlib
from pathlib import Path

import pytest

import tadcore

PACKAGE = Path(tadcore.__file__).parent
FILES = sorted(file for file in PACKAGE.rglob("*.py") if ">>>" in file.read_text(encoding="utf-8"))
MODULES = [".".join(("", *file.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(".__init__") for file in FILES]


def test_the_examples_are_found():
    assert len(MODULES) > 20
    assert {"", ".scenarios", ".game.network", ".verification.bound.sampled"} <= set(MODULES)


@pytest.mark.parametrize("name", MODULES)
def test_the_examples_of(name):
    module = importlib.import_module(f"tadcore{name}")
    failed, tried = doctest.testmod(module, extraglobs={"VisibilityNetwork": _network()})
    assert tried > 0
    assert failed == 0


def _network():
    from tadcore import VisibilityNetwork

    return VisibilityNetwork
