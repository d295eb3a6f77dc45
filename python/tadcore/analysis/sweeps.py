"""A study repeated over a grid of anything in the scenario: weights, horizon, step, fixed radii and positions.

Every cell of the grid is another scenario, and, where it differs in weights or horizon, another game with its own
Riccati solution and table. All cells draw with the same seed, so a difference between two cells is not blurred by
different draws. A cell without an equilibrium is a result like any other: it says when the solution escapes.
"""

from __future__ import annotations

import hashlib
import itertools
import os
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

import numpy as np

from tadcore._shared.calls import public
from tadcore.errors import NoEquilibriumError, ScenarioError
from tadcore.scenario.paths import expand, normal
from tadcore.study.collect import StoppingRule
from tadcore.study.study import Study

from .swept import Cell, SweepResult


@public
def sweep(
    study: Study,
    grid: Mapping[str, Sequence[Any]],
    *,
    progress: bool = False,
    store: str | os.PathLike[str] | None = None,
    threads: int | None = None,
    executor: Executor | None = None,
    until: StoppingRule | None = None,
) -> SweepResult:
    """Run a study at every point of a grid.

    Parameters
    ----------
    study : Study
        What is repeated, with its own trials and seed: the draws are the same in every cell.
    grid : mapping of str to sequence
        Paths of scenario fields and the values they take, such as ``"attacker.control_weight"``, ``"horizon"`` or
        ``"d*.control_weight"`` (the same for all); what the study varies cannot be swept.
    progress : bool
        Show a bar for each cell, in a terminal or a notebook.
    store : path, optional
        A folder with a store for each cell; run again, the sweep resumes, and a larger grid adds to it.
    threads : int, optional
        As in `Study.run`.
    executor : concurrent.futures.Executor, optional
        As in `Study.run`.
    until : StoppingRule, optional
        As in `Study.run`, for each cell.

    Returns
    -------
    SweepResult
        The cells; ``.to_xarray()`` has their outcomes over the grid.

    Raises
    ------
    ScenarioError
        A path leads nowhere, or a value breaks a rule of scenarios; every cell and all its draws are checked before any
        runs.

    Examples
    --------
    >>> import tadcore
    >>> from tadcore.sampling import Disk
    >>> sc = tadcore.scenarios.load("paper-i1")
    >>> study = tadcore.Study(sc, {"attacker.position": Disk([-2, 2], 0.5)}, trials=20, seed=7)
    >>> swept = tadcore.sweep(study, {"attacker.evasion": [0.0, 1.0]})
    >>> swept.to_xarray().sizes["attacker.evasion"]
    2
    """
    if not isinstance(study, Study):
        raise ScenarioError("study", study, "a tadcore.Study")
    axes = _axes(study, grid)
    points = [dict(zip(axes, values, strict=True)) for values in itertools.product(*axes.values())]
    studies = [_cell_study(study, point) for point in points]
    for point, one in zip(points, studies, strict=True):
        try:
            one.check(progress=progress)
        except ScenarioError as error:
            error.add_note(f"(in the cell {', '.join(f'{path} = {value!r}' for path, value in point.items())})")
            raise
    cells = []
    for number, (point, one) in enumerate(zip(points, studies, strict=True), start=1):
        folder = None if store is None else Path(store) / _folder(point)
        label = f"cell {number}/{len(points)}"
        result, escape = None, float("nan")
        try:
            result = one.run(
                progress=label if progress else False, store=folder, threads=threads, executor=executor, until=until
            )
        except NoEquilibriumError as error:
            escape = error.escape_time
        cells.append(Cell(point, one, result, escape))
    return SweepResult(study, axes, tuple(cells))


def _axes(study: Study, grid: Mapping[str, Sequence[Any]]) -> dict[str, tuple[Any, ...]]:
    """The grid with its paths in one form and its values as tuples."""
    if not isinstance(grid, Mapping) or not grid:
        raise ScenarioError("grid", grid, 'a mapping such as {"horizon": [4.0, 6.0]}')
    axes: dict[str, tuple[Any, ...]] = {}
    taken: dict[str, str] = {}
    varied = {quantity.owner for quantity in study.quantities}
    for path, values in grid.items():
        name = normal(path, "grid")
        if isinstance(values, str | bytes) or not np.ndim(values) or not len(values):
            raise ScenarioError(f'grid["{path}"]', values, "a sequence of at least one value")
        for one in expand(name, study.scenario.paths) or [name]:
            if one in varied:
                raise ScenarioError(f'grid["{path}"]', one, "a field that the study does not vary")
            if one in taken:
                raise ScenarioError(f'grid["{path}"]', one, f'swept once only: "{taken[one]}" sweeps it too')
            taken[one] = path
        axes[name] = tuple(v.tolist() if isinstance(v, np.ndarray | np.generic) else v for v in values)
    return axes


def _cell_study(study: Study, point: Mapping[str, Any]) -> Study:
    """The study of one point; an error says at which."""
    changes = {
        field: value
        for path, value in point.items()
        for field in expand(path, study.scenario.paths) or [path]  # a path that leads nowhere is refused by replace
    }
    return study.replace(sc=study.scenario.replace(changes))


def _folder(point: Mapping[str, Any]) -> str:
    """A name for the store of a cell that does not change when the grid grows."""
    exact = ",".join(f"{path}={value!r}" for path, value in sorted(point.items()))
    readable = "".join(c if c.isalnum() or c in "=,.-" else "_" for c in exact)[:80]
    return f"{readable}-{hashlib.sha256(exact.encode()).hexdigest()[:8]}"
