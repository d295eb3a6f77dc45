"""The oracle and the reference tables for every test, and the Hypothesis profiles.

Profiles (HYPOTHESIS_PROFILE): "quick" is the default, "ci" draws the same examples every time, "thorough" many.
"""

import json
import os
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

HERE = Path(__file__).parent
if str(HERE) not in sys.path:
    sys.path.insert(0, str(HERE))

_slow = [HealthCheck.too_slow, HealthCheck.data_too_large]
settings.register_profile("quick", max_examples=15, deadline=None, suppress_health_check=_slow)
settings.register_profile("ci", max_examples=25, deadline=None, derandomize=True, suppress_health_check=_slow)
settings.register_profile("thorough", max_examples=400, deadline=None, suppress_health_check=_slow)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci" if os.environ.get("CI") else "quick"))


@pytest.fixture(scope="session")
def reference():
    """Load one of the tables of tests/reference by its name."""

    def load(name):
        return json.loads((HERE.parent / "reference" / f"{name}.json").read_text(encoding="utf-8"))

    return load


@pytest.fixture(scope="module")
def agg():
    """Draw without a display for the length of a module."""
    import matplotlib as mpl

    before = mpl.get_backend()
    mpl.use("Agg")
    yield
    mpl.use(before)


@pytest.fixture(scope="session")
def runs():
    """Play every bundled scenario once."""
    import tadcore

    return {name: tadcore.simulate(tadcore.scenarios.load(name)) for name in tadcore.scenarios.names()}


@pytest.fixture(autouse=True)
def _figures_are_closed():
    """Close what a test drew with pyplot: Matplotlib keeps every figure, and warns, which fails, from the 21st on."""
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")
