"""Every example in a docstring runs."""

import doctest
import importlib

import pytest

pytest.importorskip("tadcore._core")

ROOMS = ["", ".scenario", ".scenarios", ".equilibrium", ".network", ".synthesis", ".simulation", ".batch"]
ROOMS += [".sampling", ".study", ".sweeps"]
ROOMS += [".maps", ".statistics.incidence", ".statistics.intervals", ".statistics.sequences"]
ROOMS += [".verification", ".verification.events"]


@pytest.mark.parametrize("room", ROOMS)
def test_the_examples_of(room):
    module = importlib.import_module(f"tadcore{room}")
    failed, tried = doctest.testmod(module, extraglobs={"VisibilityNetwork": _network()})
    assert tried > 0
    assert failed == 0


def _network():
    from tadcore import VisibilityNetwork

    return VisibilityNetwork
