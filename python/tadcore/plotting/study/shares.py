"""How the outcomes of a study depend on one of its inputs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import Floats
from tadcore._shared.calls import public
from tadcore.plotting.tools.axes import above, as_panels, new_axes, new_panels, root_figure
from tadcore.plotting.tools.outcomes import boxes, input_label, parts_of, stack
from tadcore.plotting.tools.style import COLUMN
from tadcore.statistics import TrialOutcomes, outcome_names
from tadcore.statistics.outcomes import diverged_of, indicators

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@public
def outcomes_by_input(
    result: TrialOutcomes, name: str, ax: Axes | None = None, *, ranges: int = 10, legend: bool = True
) -> Axes:
    """Draw the shares of the outcomes, stacked, against one input in equally filled ranges of it.

    Parameters
    ----------
    result : StudyResult
        What to draw.
    name : str
        The input, such as ``"attacker.position.x"``. Trials in which it is infinite are left out.
    ax : Axes, optional
        Where to draw; new axes of a one-column figure if not given.
    ranges : int
        How many ranges; an input of no more distinct values than that gets one for each of them.
    legend : bool
        Whether to name the outcomes above the axes.

    Returns
    -------
    Axes
        The axes drawn in.

    Raises
    ------
    ValueError
        The study does not vary this input, or it has no two finite values.
    """
    if name not in result.inputs:
        raise ValueError(f"no input {name!r}; the study varies {', '.join(result.inputs)}")
    finite = np.isfinite(result.inputs[name])
    values = np.asarray(result.inputs[name], dtype=np.float64)[finite]
    edges = range_edges(values, ranges)
    if len(edges) < 2:
        raise ValueError(f"input {name!r} has no two finite values to compare")
    where = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    filled = np.bincount(where, minlength=len(edges) - 1)
    lost = diverged_of(result)
    ended = dict(
        zip(
            outcome_names(result.scenario.n, diverged=lost is not None),
            indicators(result.kind, result.defender, result.scenario.n, lost)[:, finite],
            strict=True,
        )
    )
    ax = new_axes(ax, COLUMN, 2.2)
    names, base = parts_of(list(ended)), np.zeros(len(edges))
    for outcome in names:
        share = np.bincount(where[ended[outcome]], minlength=len(filled)) / filled
        top = base + np.append(share, share[-1])
        stack(ax, edges, base, top, outcome)
        base = top
    ax.set(xlabel=input_label(name), ylabel="share of trials", xlim=(edges[0], edges[-1]), ylim=(0.0, 1.0))
    if legend:
        above(ax, boxes(names))
    return ax


@public
def outcomes_by_inputs(
    result: TrialOutcomes, names: Sequence[str], axes: NDArray[Any] | None = None, *, ranges: int = 10
) -> NDArray[Any]:
    """Draw `outcomes_by_input` for several inputs, one panel each, under one legend.

    Parameters
    ----------
    result : StudyResult
        What to draw.
    names : sequence of str
        The inputs.
    axes : ndarray of Axes, optional
        Where to draw; those beyond the last input are switched off. A new figure two columns wide if not given.
    ranges : int
        As in `outcomes_by_input`.

    Returns
    -------
    ndarray of Axes
        The axes drawn in.

    Raises
    ------
    ValueError
        There are fewer axes than inputs, or an input cannot be drawn.
    """
    if axes is None:
        axes = new_panels(len(names), 3, page_from=1, row=1.6, rest=0.4, sharey=True)
    panels = as_panels(axes)
    if len(panels) < len(names):
        raise ValueError(f"{len(names)} inputs need as many axes, got {len(panels)}")
    for i, ax in enumerate(panels):
        if i < len(names):
            outcomes_by_input(result, names[i], ax, ranges=ranges, legend=False)
            place = ax.get_subplotspec()
            ax.set_ylabel("share of trials" if place is None or place.is_first_col() else "")
        else:
            ax.set_axis_off()
    lost = diverged_of(result) is not None
    shown = boxes(parts_of(outcome_names(result.scenario.n, diverged=lost)))
    root_figure(panels[0]).legend(handles=shown, loc="outside upper center", ncols=min(len(shown), 8), frameon=False)
    return axes


def range_edges(values: Floats, ranges: int) -> Floats:
    """Edges of ranges that hold about as many values each, none of them empty."""
    distinct = np.unique(values)
    if len(distinct) < 2:
        return distinct
    if len(distinct) <= ranges:
        between = (distinct[1:] + distinct[:-1]) / 2.0
        return np.array([2.0 * distinct[0] - between[0], *between, 2.0 * distinct[-1] - between[-1]])
    # every edge is one of the values, so every range holds at least its own lower edge
    return np.unique(np.quantile(values, np.linspace(0.0, 1.0, ranges + 1), method="lower"))
