"""The public surface: what is exported, what importing costs, what signatures accept."""

import importlib
import inspect
import re
import subprocess
import sys

import pytest

import tadcore

HEAVY = ("xarray", "scipy", "matplotlib", "pyarrow", "pandas", "rich", "typer", "numpy", "pydantic")


def loaded_after(code):
    """Which heavy packages a fresh interpreter has loaded after some code."""
    check = f"{code}\nimport sys; print(*[m for m in {HEAVY!r} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", check], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_import_loads_nothing_heavy():
    assert loaded_after("import tadcore") == set()


def test_a_scenario_needs_only_numpy_and_pydantic():
    assert loaded_after("import tadcore; tadcore.scenarios.load('paper-i1').to_toml()") <= {"numpy", "pydantic"}


def test_maps_and_statistics_load_scipy_only_when_they_need_it():
    assert loaded_after("import tadcore.analysis, tadcore.statistics") <= {"numpy", "pydantic", "pyarrow"}


def test_everything_exported_is_there_and_documented():
    assert sorted(tadcore.__all__) == list(tadcore.__all__) or set(tadcore.__all__) <= set(dir(tadcore))
    for name in tadcore.__all__:
        thing = getattr(tadcore, name)
        assert name in dir(tadcore)
        assert name == "__version__" or inspect.getdoc(thing), name


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match=r"No tadcore attribute simulat$"):
        tadcore.simulat  # noqa: B018


def test_an_unknown_keyword_is_refused_everywhere():
    sc = tadcore.scenarios.load("paper-i1")
    for call in (
        lambda: tadcore.simulate(sc, seeds=1),
        lambda: tadcore.simulate_batch(sc, [sc.positions], workers=2),
        lambda: tadcore.solve_equilibrium(sc, rtol=1e-9),
        lambda: tadcore.synthesize(sc, step=0, adjacency=[[0] * 4] * 3, warm=True),
        lambda: tadcore.synthesize(sc, 0, [[0] * 4] * 3),
        lambda: tadcore.outcome_map(sc, size=10),
        lambda: tadcore.radius_curve(sc, [sc.positions], "d1", [1.0]),
    ):
        with pytest.raises(TypeError):
            call()
    with pytest.raises(tadcore.ScenarioError):
        tadcore.Scenario(**sc.model_dump(), colour="red")


STUDIED = ["study", "plotting", "report", "statistics"]


@pytest.mark.parametrize("name", ["game", "simulation", "analysis", *STUDIED])
def test_every_parameter_is_documented(name):
    module = importlib.import_module(f"tadcore.{name}")
    for public in module.__all__:
        thing = getattr(module, public)
        if inspect.isfunction(thing):
            text = inspect.getdoc(thing)
            for parameter in inspect.signature(thing).parameters:
                documented = re.search(rf"^(\w+, )*{parameter}(, \w+)* : ", text, re.MULTILINE)
                assert documented or public == "theta_terms", (public, parameter)


def test_one_version():
    assert tadcore.__version__ == importlib.import_module("tadcore._core").__version__
