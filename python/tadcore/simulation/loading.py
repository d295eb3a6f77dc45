"""A run read back from the files that `tadcore.Run.save` wrote."""

from __future__ import annotations

import json
import os
from typing import Any

import numpy as np
import xarray as xr
from pydantic import ValidationError

from tadcore._shared.arrays import as_seed, as_trial, complex_of
from tadcore._shared.files import as_path
from tadcore._shared.netcdf import loaded
from tadcore.errors import ScenarioError
from tadcore.game.course import ARRAYS, Course, shapes as course_shapes
from tadcore.scenario.model import Scenario

from .files import COURSE, OF_COURSE, RECORD, SEAL, TURNING, VARIABLES, fields_of, seal
from .run import Run

_RULE = "a run that Run.save wrote: a folder, or a file that ends in .nc"

_BITS = ("adjacency", "seen", "sensor_up", "edge_up", "heard")


def load_run(path: str | os.PathLike[str]) -> Run:
    """Read a run that `Run.save` wrote; every number is bitwise the one that was saved.

    Parameters
    ----------
    path : path
        A file that ends in ``.nc``, or the folder with ``run.nc`` in it.

    Returns
    -------
    Run
        The run, with everything that it can do: figures, dataset, verification.

    Raises
    ------
    ScenarioError
        There is no such file, it is no saved run, or it is damaged.

    Examples
    --------
    >>> import tadcore, tempfile
    >>> run = tadcore.simulate(tadcore.scenarios.load("paper-i1"))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     run.save(f"{folder}/run.nc")
    ...     print(tadcore.load_run(f"{folder}/run.nc").outcome)
    d1 intercepts the attacker at t = 1.395
    """
    place, name = as_path("path", path), os.fspath(path)
    with loaded(place, name, _RULE, in_folder="run.nc") as data:
        return _unpacked(data, name)


def _unpacked(data: xr.Dataset, name: str) -> Run:
    if RECORD not in data.attrs:
        raise ScenarioError(name, f"no attribute {RECORD!r}", f"{_RULE}; earlier versions did not save all of a run")
    sc = Scenario.from_toml_string(str(data.attrs["scenario"]), name=name)
    arrays, others = fields_of(Run)
    record = json.loads(data.attrs[RECORD])
    try:
        rest = {field: adapter.validate_python(record[field]) for field, adapter in others.items() if field in record}
    except ValidationError as error:
        raise ValueError(str(error).replace("\n", " ")) from None
    missing = [field for field in arrays if VARIABLES.get(field, field) not in data]
    if missing:
        raise ValueError(f"it has no variable {missing[0]}")
    values: dict[str, Any] = {field: np.ascontiguousarray(data[VARIABLES.get(field, field)].values) for field in arrays}
    if TURNING in data:
        values["gains"] = complex_of(values["gains"], np.ascontiguousarray(data[TURNING].values))
    course = _course(data, record.get(COURSE))
    run = Run(scenario=sc, **values, **rest, course=course)
    _check(run, name)
    arrays_of_course = [] if course is None else [getattr(course, field) for field in ARRAYS]
    if record.pop(SEAL) != seal(str(data.attrs["scenario"]), record, [*values.values(), *arrays_of_course]):
        raise ValueError("its content is not what was saved")
    return run


def _course(data: xr.Dataset, kept: Any) -> Course | None:
    if kept is None:
        return None
    names = {name: VARIABLES.get(name, name) for name in ARRAYS}
    if not isinstance(kept, dict) or set(kept) != set(OF_COURSE) or not set(names.values()) <= set(data):
        raise ValueError("its course is not whole")
    arrays = {name: np.ascontiguousarray(data[variable].values) for name, variable in names.items()}
    return Course(as_seed(kept["seed"]), as_trial("trial", kept["trial"]), **arrays, from_outside=kept["from_outside"])


def _check(run: Run, name: str) -> None:
    """Refuse a record that is not one of its scenario: shapes, types, finite numbers, instants, the player named."""
    sc, rows = run.scenario, len(run.times)
    if run.course is None and sc.world is not None:
        raise ScenarioError(f"{name}, course", None, "that of the scenario, whose world is not empty")
    team = (rows, len(sc.constrained), sc.n + 1)
    shapes = {
        "times": (rows,),
        "position": (rows, sc.n + 2, sc.dim),
        "control": (rows, sc.n + 2, sc.dim),
        "adjacency": team,
        "gains": team,
        "theta": (rows,),
        "theta_terms": (rows, run.theta_terms.shape[-1]),
    }
    entries = [(field, getattr(run, field), shape) for field, shape in shapes.items()]
    if run.course is not None:
        entries += [(field, getattr(run.course, field), shape) for field, shape in course_shapes(sc, rows).items()]
    for field, array, shape in entries:
        kind = np.dtype(bool if field in _BITS else complex if field == "gains" and run.turning else np.float64)
        if array.shape != shape or array.dtype != kind or not np.isfinite(array).all():
            raise ScenarioError(f"{name}, {field}", f"{array.dtype} {array.shape}", f"finite {kind} of shape {shape}")
    if rows == 0 or run.times[0] != 0.0 or (np.diff(run.times) <= 0.0).any():
        raise ScenarioError(f"{name}, times", run.times, "instants from 0 on, each later than the one before")
    defender = run.outcome.defender
    if (defender is not None) != (run.outcome.kind == "intercepted") or not 0 <= (defender or 0) < sc.n:
        raise ScenarioError(f"{name}, outcome.defender", defender, "the defender that intercepted, None elsewhere")
