"""Copies and pickles of what the package returns: every number and every label, and what was read-only still is."""

import copy
import dataclasses
import pickle

import numpy as np
import pyarrow as pa
import pytest
import xarray as xr
from pydantic import BaseModel
from scipy import stats

import tadcore
from tadcore import sampling
from tadcore.plotting import Animation

SC = tadcore.scenarios.load("paper-i1").replace({"horizon": 0.5, "step": 0.05})
VARY = {"attacker.position": sampling.Box([-3, -3], [3, 3]), "d1.visibility_radius": stats.uniform(1, 2)}


def made():
    run = tadcore.simulate(SC)
    study = tadcore.Study(SC, vary=VARY, trials=60)
    result = study.run()
    network = tadcore.VisibilityNetwork.from_positions(SC)
    yield from (SC, SC.attacker, run, run.outcome, run.network_changes, study, result, network)
    yield tadcore.simulate(tadcore.scenarios.load("paper-i2"))
    yield tadcore.solve_equilibrium(SC)
    yield tadcore.solve_equilibrium(tadcore.scenarios.load("paper-i2"))
    yield tadcore.synthesize(SC, step=2, adjacency=network)
    yield tadcore.simulate_batch(SC, [SC.positions] * 3)
    yield tadcore.outcome_map(SC, x=(-2, 2, 3), y=(-2, 2, 3))
    yield tadcore.certified_map(SC, x=(-2, 2), y=(-2, 2), resolution=0.5)
    start = {"attacker.position": sampling.Gaussian([-0.7, 0.7], 0.1)}
    yield tadcore.rare(tadcore.Study(SC, start, trials=1), error=0.5)
    yield tadcore.sweep(study, {"horizon": [0.5, 1.0]})
    yield tadcore.radius_curve(result, player="d2", radii=[1.0, 2.0, 3.0], refine=True)
    yield from (result.probabilities(), result.incidence(), tadcore.HalfWidth(0.1), tadcore.verify(SC))
    yield tadcore.verification.step_study(SC)
    yield from (tadcore.NoEquilibriumError(1.0, 2.0, 0.1), tadcore.StoreError("a", "b", "c"))
    yield from (sampling.Gaussian([0, 0], 1.0), sampling.Disk([0, 0], 1.0), sampling.Choice([1.0, 2.0]))


def same(a, b, path, seen):
    """Compare two objects down to their arrays."""
    if id(a) in seen or a is b:
        return
    seen.add(id(a))
    assert type(a) is type(b), path
    if isinstance(a, np.ndarray):
        np.testing.assert_array_equal(a, b, err_msg=path)
        assert a.dtype == b.dtype, path
    elif isinstance(a, pa.Table):
        assert a.equals(b), path
    elif isinstance(a, BaseModel):
        assert a == b, path
    elif isinstance(a, xr.Dataset):
        assert a.identical(b), path
    elif isinstance(a, dict):
        assert list(a) == list(b), path
        for key in a:
            same(a[key], b[key], f"{path}[{key!r}]", seen)
    elif isinstance(a, list | tuple):
        assert len(a) == len(b), path
        for i, (x, y) in enumerate(zip(a, b, strict=True)):
            same(x, y, f"{path}[{i}]", seen)
    elif dataclasses.is_dataclass(a):
        for field in dataclasses.fields(a):
            same(getattr(a, field.name), getattr(b, field.name), f"{path}.{field.name}", seen)
    elif isinstance(a, BaseException):
        assert str(a) == str(b)
    elif isinstance(a, int | float | str | bytes | bool | None.__class__):
        assert a == b or a != a, path
    else:
        for name in [n for n in dir(a) if not n.startswith("_") and not callable(getattr(a, n, None))]:
            if not name.startswith("model_"):
                same(getattr(a, name), getattr(b, name), f"{path}.{name}", seen)


def read_only(thing, path=""):
    """The arrays of an object that must not be written to."""
    for name in ("P", "adjacency", "position", "control", "rows"):
        array = getattr(thing, name, None)
        for key, one in array.items() if isinstance(array, dict) else (("", array),):
            if isinstance(one, np.ndarray) and not one.flags.writeable:
                yield f"{name}{key}"


OBJECTS = list(made())


@pytest.mark.parametrize("thing", OBJECTS, ids=lambda thing: type(thing).__name__)
@pytest.mark.parametrize("way", ["pickle", "copy", "deepcopy"])
def test_a_copy_is_the_same(thing, way):
    again = {
        "pickle": lambda: pickle.loads(pickle.dumps(thing)),
        "copy": lambda: copy.copy(thing),
        "deepcopy": lambda: copy.deepcopy(thing),
    }[way]()
    assert repr(again) == repr(thing)
    same(thing, again, type(thing).__name__, set())
    assert list(read_only(again)) == list(read_only(thing))


def test_an_animation_is_copied():
    animation = tadcore.simulate(SC).animate(seconds=0.2, fps=5)
    again = pickle.loads(pickle.dumps(animation))
    assert isinstance(again, Animation)
    assert again.frames == animation.frames


def test_a_restored_equilibrium_has_every_number(tmp_path):
    """In a process of its own, from a pickle alone."""
    eq = tadcore.solve_equilibrium(SC)
    again = pickle.loads(pickle.dumps(eq))
    assert again.max_residual == eq.max_residual
    np.testing.assert_array_equal(again.full("target", 3), eq.full("target", 3))
    assert pickle.dumps(again) == pickle.dumps(pickle.loads(pickle.dumps(again)))
