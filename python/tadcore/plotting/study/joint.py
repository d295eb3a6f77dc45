"""The share of an outcome over two inputs of a study at once."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import Floats
from tadcore._shared.calls import public
from tadcore.plotting.tools.axes import colour_bar, new_axes
from tadcore.plotting.tools.ground import ink
from tadcore.plotting.tools.outcomes import input_label, listed, outcome_look
from tadcore.plotting.tools.style import COLUMN
from tadcore.statistics import TrialOutcomes, outcome_names
from tadcore.statistics.outcomes import diverged_of, indicators

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_FILLED = 25.0  # trials that a cell has on average, where the number of cells is left open
_MOST_CELLS = 60  # along an axis


@public
def outcomes_over(
    result: TrialOutcomes,
    x: str,
    y: str,
    ax: Axes | None = None,
    *,
    outcome: str = "intercepted",
    cells: int | None = None,
    least: int = 5,
    legend: bool = True,
) -> Axes:
    """Draw the share of an outcome among the trials of each cell of two inputs.

    Parameters
    ----------
    result : StudyResult
        What to draw.
    x, y : str
        The inputs, such as ``"attacker.position.x"`` and ``"attacker.position.y"``. Trials in which one of them is
        infinite are left out.
    ax : Axes, optional
        Where to draw; new axes of a one-column figure if not given.
    outcome : str
        ``"timeout"``, ``"captured"``, ``"intercepted"``, or ``"d1"`` … ``"dn"``.
    cells : int, optional
        Cells along each axis; by default so many that a cell has some 25 trials on average, at most 60.
    least : int
        A cell with fewer trials stays empty: its share says little.
    legend : bool
        Whether to name the colours beside the axes.

    Returns
    -------
    Axes
        The axes drawn in.

    Raises
    ------
    ValueError
        The study does not vary such an input, it has no two finite values, or there is no such outcome.
    """
    lost = diverged_of(result)
    names = outcome_names(result.scenario.n, diverged=lost is not None)
    listed("outcome", outcome, names)
    for name in (x, y):
        if name not in result.inputs:
            raise ValueError(f"no input {name!r}; the study varies {', '.join(result.inputs)}")
    points = np.array([result.inputs[x], result.inputs[y]], dtype=np.float64)
    finite = np.isfinite(points).all(axis=0)
    points = points[:, finite]
    for name, values in zip((x, y), points, strict=True):
        if not values.size or values.min() == values.max():
            raise ValueError(f"input {name!r} has no two finite values to compare")
    many = cells or int(np.clip(np.sqrt(points.shape[1] / _FILLED), 2, _MOST_CELLS))
    ended = indicators(result.kind, result.defender, result.scenario.n, lost)[names.index(outcome), finite]
    share, edges_x, edges_y = _shares(points, ended, many, max(least, 1))
    ax = new_axes(ax, COLUMN, 2.6)
    ax.set_facecolor(ink(0.93))
    image = ax.pcolormesh(edges_x, edges_y, share.T, cmap="cividis", vmin=0.0, vmax=1.0, rasterized=True)
    if legend:
        colour_bar(ax, image, f"share of trials: {outcome_look(outcome).label}")
    ax.set(xlabel=input_label(x), ylabel=input_label(y))
    if x.endswith(".x") and y == f"{x[:-1]}y":  # one player's plane
        ax.set_aspect("equal")
    return ax


def _shares(points: Floats, ended: NDArray[np.bool_], cells: int, least: int) -> tuple[Floats, Floats, Floats]:
    """The share in each cell, NaN where it has too few trials, and the edges of the cells."""
    x, y = points
    count, edges_x, edges_y = np.histogram2d(x, y, bins=cells)
    hits, _, _ = np.histogram2d(x[ended], y[ended], bins=[edges_x, edges_y])
    share = np.full(count.shape, np.nan)
    np.divide(hits, count, out=share, where=count >= least)
    return share, edges_x, edges_y
