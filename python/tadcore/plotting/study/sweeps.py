"""Sweeps: outcome probabilities over what was swept, with the cells that have no equilibrium."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import Floats
from tadcore._shared.calls import public
from tadcore.errors import ScenarioError
from tadcore.plotting.tools.axes import above, colour_bar, new_axes
from tadcore.plotting.tools.ends import label_ends
from tadcore.plotting.tools.ground import paper
from tadcore.plotting.tools.outcomes import boxes, input_label, listed, outcome_look
from tadcore.plotting.tools.style import COLUMN
from tadcore.scenario.paths import short

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

_TICKS = 8  # most labels along an axis of a heat map
_WRITTEN = 7  # most cells along an axis of a heat map that say their share
_LOST = "no_equilibrium"


class Swept(Protocol):
    """Outcomes over a grid: `tadcore.SweepResult`."""

    @property
    def grid(self) -> Mapping[str, Sequence[Any]]:
        """The swept paths and their values."""

    def to_xarray(self) -> xarray.Dataset:
        """``probability``, its interval and band over the grid and ``outcome``, and ``status`` over the grid."""


@public
def sweep(
    found: Swept, ax: Axes | None = None, *, outcomes: Sequence[str] | None = None, outcome: str = "intercepted"
) -> Axes:
    """Draw outcome probabilities over one or two swept quantities.

    Over one, a line for each outcome with its 95 % intervals, each by itself, and a pale band that holds at all values
    at once; values that are no numbers stand side by side. Over two, a heat map of one outcome, with the shares written
    into a small one. Cells without an equilibrium are filled and hatched, and named above; cells of a heat map in which
    some games diverged carry a cross.

    Parameters
    ----------
    found : SweepResult
        What to draw; of one or two swept paths.
    ax : Axes, optional
        Where to draw; new axes of a one-column figure if not given.
    outcomes : sequence of str, optional
        The lines over one path; by default intercepted, captured, timeout and, where some games did, diverged.
    outcome : str
        The outcome of the heat map over two paths.

    Returns
    -------
    Axes
        The axes drawn in.

    Raises
    ------
    ScenarioError
        More than two paths were swept.
    ValueError
        No such outcome.
    """
    made = found.to_xarray()
    names = made["outcome"].values.tolist()
    if len(found.grid) == 1:
        wanted = [name for name in names if name != _LOST] if outcomes is None else list(outcomes)
        for name in wanted:
            listed("outcome", name, names)
        return _lines(found, made, ax, wanted)
    if len(found.grid) == 2:
        listed("outcome", outcome, names)
        return _heat(found, made, ax, outcome)
    paths = ", ".join(map(short, found.grid))
    raise ScenarioError("found", paths, "a sweep of one or two paths; of more, draw parts of to_xarray()")


def _lines(found: Swept, made: xarray.Dataset, ax: Axes | None, outcomes: list[str]) -> Axes:
    """Probabilities over one path."""
    ax = new_axes(ax, COLUMN, 2.4)
    [(path, values)] = found.grid.items()
    numbers = _numbers(values)
    order, ends = _order(values), []
    at = np.arange(float(len(values))) if numbers is None else numbers[order]
    for name in outcomes:
        it = outcome_look(name)
        line, low, high = (made[part].sel(outcome=name).values[order] for part in ("probability", "low", "high"))
        if numbers is not None:
            least, most = (made[part].sel(outcome=name).values[order] for part in ("band_low", "band_high"))
            ax.fill_between(at, least, most, color=it.colour, alpha=0.1, linewidth=0)
            ax.fill_between(at, low, high, color=it.colour, alpha=0.22, linewidth=0)
        ax.vlines(at, low, high, color=it.colour, linewidth=0.7, alpha=0.8)
        ax.plot(
            at, line, color=it.colour, linestyle=it.dashes if numbers is not None else "none", marker=it.marker,
            markersize=3.4, markerfacecolor=paper(), markeredgewidth=0.8,
        )  # fmt: skip
        there = np.flatnonzero(np.isfinite(line))
        if there.size and numbers is not None:
            ends.append((float(line[there[-1]]), it.label, it.colour))
    edges = _edges(at)
    lost = made["status"].values[order] != "done"
    for i in np.flatnonzero(lost):
        it = outcome_look(_LOST)
        ax.axvspan(edges[i], edges[i + 1], facecolor=it.fill, hatch=it.hatch, edgecolor="0.6", linewidth=0, zorder=0.5)
    if numbers is None:
        ax.set_xticks(at, [_word(values[i]) for i in order])
        above(ax, [*_marks(outcomes), *(boxes([_LOST]) if lost.any() else [])])
        ax.set_xlim(edges[0], edges[-1])
    else:
        if lost.any():
            ax.set_xlim(edges[0], edges[-1])
        label_ends(ax, ends)
        if lost.any():
            above(ax, boxes([_LOST]))
    ax.set(xlabel=_axis(path), ylabel="probability")
    ax.set_ylim(0.0, None)
    return ax


def _heat(found: Swept, made: xarray.Dataset, ax: Axes | None, outcome: str) -> Axes:
    """One probability over two paths, the first along x; cells are as wide as one another."""
    (first, columns), (second, rows) = found.grid.items()
    by = [_order(values) for values in (columns, rows)]
    here = np.ix_(by[0], by[1])
    share = made["probability"].sel(outcome=outcome).values[here].T
    lost = (made["status"].values[here] != "done").T
    ratio = len(rows) / len(columns)
    ax = new_axes(ax, COLUMN, float(np.clip((COLUMN - 1.4) * ratio + 0.8, 1.6, 4.5)))
    image = ax.imshow(share, origin="lower", aspect="auto", cmap="cividis", vmin=0.0, vmax=1.0, zorder=1.0)
    if max(share.shape) <= _WRITTEN:
        for (row, column), p in np.ndenumerate(share):
            if np.isfinite(p):
                colour = "white" if p < 0.55 else "black"
                ax.text(column, row, f"{p:.2f}", ha="center", va="center", color=colour, fontsize="small", zorder=3)
    handles: list[Any] = []
    if lost.any():
        it = outcome_look(_LOST)
        for row, column in np.argwhere(lost):
            box = (column - 0.5, column + 0.5)
            ax.fill_between(box, row - 0.5, row + 0.5, facecolor=it.fill, hatch=it.hatch, edgecolor="0.6", linewidth=0)
        handles += boxes([_LOST])
    if "diverged" in made["outcome"].values:
        some = made["count"].sel(outcome="diverged").values[here].T > 0
        row, column = np.nonzero(some)
        for colour, width in (("white", 1.8), ("black", 0.8)):  # a pale casing: it reads on any cell
            [mark] = ax.plot(
                column + 0.36, row + 0.36, "x", markersize=4, color=colour, markeredgewidth=width, zorder=3.0
            )
        mark.set_label("some diverged")
        handles.append(mark)
    if handles:
        above(ax, handles)
    for axis, values, order in ((ax.xaxis, columns, by[0]), (ax.yaxis, rows, by[1])):
        every = range(0, len(values), -(-len(values) // _TICKS))
        axis.set_ticks(list(every), [_word(values[order[i]]) for i in every])
    ax.set(xlabel=_axis(first), ylabel=_axis(second))
    colour_bar(ax, image, f"P({outcome_look(outcome).label})")
    return ax


def _marks(outcomes: Sequence[str]) -> list[Any]:
    """Legend entries of points."""
    from matplotlib.lines import Line2D

    styles = [outcome_look(name) for name in outcomes]
    return [
        Line2D([], [], color=it.colour, linestyle="none", marker=it.marker, markersize=3.4, markerfacecolor=paper(),
               label=it.label)
        for it in styles
    ]  # fmt: skip


def _axis(path: str) -> str:
    label = input_label(path)
    return short(path) if label == path else label


def _word(value: object) -> str:
    """A swept value as a tick says it."""
    if isinstance(value, float):
        return "∞" if np.isposinf(value) else f"{value:g}"
    return str(value)


def _numbers(values: Sequence[Any]) -> Floats | None:
    """The values as a line can stand over them, if they are finite numbers."""
    if any(isinstance(v, bool) or not isinstance(v, int | float) or not np.isfinite(v) for v in values):
        return None
    return np.array(values, dtype=np.float64)


def _order(values: Sequence[Any]) -> NDArray[np.intp]:
    """Along an axis: by size if they are numbers, else as they were given."""
    numbers = _numbers(values)
    return np.arange(len(values)) if numbers is None else np.argsort(numbers, kind="stable")


def _edges(at: Floats) -> NDArray[np.float64]:
    """Where each of the places along an axis begins, and where the last ends: half-way between neighbours."""
    if len(at) == 1:
        return np.array([at[0] - 0.5, at[0] + 0.5])
    middle = (at[1:] + at[:-1]) / 2.0
    return np.array([2.0 * at[0] - middle[0], *middle, 2.0 * at[-1] - middle[-1]])
