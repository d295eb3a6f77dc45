"""Is the record whole: every array there, of its shape and type, every number finite."""

from __future__ import annotations

import numpy as np

from tadcore.game.course import ARRAYS, shapes as course_shapes
from tadcore.simulation.run import Run
from tadcore.verification.report import Check

from .claims import RECORD

_SHOWN = 3


def check_arrays(run: Run) -> Check:
    """How many of the arrays and counts of a record are missing, of another shape or type, or not finite."""
    faults = [*_arrays(run), *_counts(run)]
    shown = "; ".join(faults[:_SHOWN]) + (f"; {len(faults) - _SHOWN} more" if len(faults) > _SHOWN else "")
    return RECORD["record.arrays"].judge(float(len(faults)), shown)


def _arrays(run: Run) -> list[str]:
    sc = run.scenario
    rows, players, m = np.size(run.times), sc.n + 2, len(sc.constrained)
    terms = 4 if sc.interaction == "I1" else 3
    shapes = {
        "times": (rows,),
        "position": (rows, players, sc.dim),
        "control": (rows, players, sc.dim),
        "adjacency": (rows, m, sc.n + 1),
        "gains": (rows, m, sc.n + 1),
        "theta": (rows,),
        "theta_terms": (rows, terms),
    }
    arrays = {name: getattr(run, name) for name in shapes}
    if (run.course is None) != (sc.world is None):
        return ["the course of the scenario's failures, links and disturbances is missing, or there are none"]
    if run.course is not None:
        shapes |= course_shapes(sc, rows)
        arrays |= {name: getattr(run.course, name) for name in ARRAYS}
    faults = []
    if not 1 <= rows <= sc.steps + 1:
        faults.append(f"times has {rows} rows where 1 to {sc.steps + 1} are possible")
    for name, shape in shapes.items():
        array = arrays[name]
        kind = np.bool_ if name in ("adjacency", "seen", "sensor_up", "edge_up", "heard") else np.float64
        if not isinstance(array, np.ndarray) or array.dtype != kind:
            faults.append(f"{name} is no array of {kind.__name__.rstrip('_')}")
        elif array.shape != shape:
            faults.append(f"{name} has shape {array.shape} where {shape} is expected")
        elif not np.isfinite(array).all():
            k = int(np.argwhere(~np.isfinite(array))[0, 0])
            faults.append(f"{name} is not finite in row {k}")
    return faults


def _counts(run: Run) -> list[str]:
    faults = []
    for name, most in (("iterations", None), ("unconverged", np.size(run.times)), ("certified", np.size(run.times))):
        count = getattr(run, name)
        if not isinstance(count, int | np.integer) or isinstance(count, bool) or count < 0:
            faults.append(f"{name} is no count")
        elif most is not None and count > most:
            faults.append(f"{name} is {count} of {most} rows")
    return faults
