"""Every example in a docstring runs."""

import doctest
import importlib

import pytest

MODULES = ["", ".scenario.model", ".scenarios", ".game.equilibrium", ".game.network", ".game.synthesis"]
MODULES += [
    ".simulation.play",
    ".simulation.batch",
    ".sampling.shapes",
    ".study.study",
    ".analysis.sweeps",
    ".analysis.maps",
    ".analysis.certified",
    ".analysis.rare_events",
]
MODULES += [".statistics.incidence", ".statistics.intervals", ".statistics.sequences"]
MODULES += [".verification.every_check", ".verification.continuous.events"]


@pytest.mark.parametrize("name", MODULES)
def test_the_examples_of(name):
    module = importlib.import_module(f"tadcore{name}")
    failed, tried = doctest.testmod(module, extraglobs={"VisibilityNetwork": _network()})
    assert tried > 0
    assert failed == 0


def _network():
    from tadcore import VisibilityNetwork

    return VisibilityNetwork
