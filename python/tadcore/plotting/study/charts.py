"""Figures of what a study says: probabilities, incidence, comparisons, the value of a radius, sensitivity."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from tadcore._shared.calls import public
from tadcore._shared.shares import estimate, percent
from tadcore.plotting.tools.axes import above, new_axes
from tadcore.plotting.tools.ends import label_ends
from tadcore.plotting.tools.ground import ink, paper
from tadcore.plotting.tools.outcomes import boxes, input_label, listed, outcome_look, parts_of, quantity_label, stack
from tadcore.plotting.tools.style import COLUMN, symbol
from tadcore.statistics import Comparison, Incidence, OutcomeProbabilities, RadiusCurve
from tadcore.statistics.sobol import Sensitivity

if TYPE_CHECKING:
    from matplotlib.axes import Axes


_ROW = 0.27  # inches for each row of a chart of rows


@public
def outcome_probabilities(found: OutcomeProbabilities, ax: Axes | None = None) -> Axes:
    """Draw each outcome's probability with its interval, one row each, defenders under interceptions.

    Parameters
    ----------
    found : OutcomeProbabilities
        What to draw.
    ax : Axes, optional
        Where to draw; new axes of a one-column figure if not given.

    Returns
    -------
    Axes
        The axes drawn in.
    """
    ax = new_axes(ax, COLUMN, 0.65 + _ROW * len(found.names))
    for row, (name, p, low, high) in enumerate(zip(found.names, found.estimate, found.low, found.high, strict=True)):
        it = outcome_look(name)
        ax.barh(row, p, 0.62, facecolor=it.fill, edgecolor="0.35", hatch=it.hatch, linewidth=0.5, zorder=2.0)
        _interval(ax, row, low, high)
        text, _ = estimate(p, low, high, least=3)
        ax.annotate(
            text, (high, row), xytext=(4, 0), textcoords="offset points", va="center", fontsize="small", zorder=3
        )
    _rows(ax, [outcome_look(name).label for name in found.names])
    ax.set(xlabel="probability", xlim=(0.0, min(1.0, float(found.high.max())) * 1.2))
    ax.axvline(0.0, color=ink(0.25), linewidth=0.6, zorder=2.2)
    return ax


@public
def incidence(found: Incidence, ax: Axes | None = None, *, stacked: bool = True, bands: bool = True) -> Axes:
    """Draw the cumulative incidence of the outcomes over time.

    Parameters
    ----------
    found : Incidence
        What to draw.
    ax : Axes, optional
        Where to draw; new axes of a one-column figure if not given.
    stacked : bool
        Whether to stack the curves, interception by each defender first, then capture, so that what is left above them
        is still running; or to draw each from zero.
    bands : bool
        Whether to draw the simultaneous bands; in a stack only that of interception as a whole, which is the one curve
        in it that starts from zero.

    Returns
    -------
    Axes
        The axes drawn in.
    """
    ax = new_axes(ax, COLUMN, 2.5)
    names = [name for name in parts_of(found.names) if name != "timeout"]
    if stacked:
        base = np.zeros_like(found.times)
        for name in names:
            top = base + found[name]
            stack(ax, found.times, base, top, name)
            base = top
        handles: list[Any] = list(boxes(names))
        if bands:
            i = found.names.index("intercepted")
            for edge in (found.low[i], found.high[i]):
                ax.step(found.times, edge, where="post", color=ink(), linewidth=0.8, linestyle=(0, (1, 1.2)))
            label = f"{percent(found.level)} band of interception"
            line = Line2D([], [], color=ink(), linewidth=0.8, linestyle=(0, (1, 1.2)), label=label)
            handles.append(line)
        above(ax, handles)
        ax.set_ylim(0.0, 1.0)
    else:
        ends = []
        for name in names:
            it, i = outcome_look(name), found.names.index(name)
            if bands:
                ax.fill_between(
                    found.times, found.low[i], found.high[i], color=it.colour, alpha=0.16, step="post", linewidth=0.0
                )
            ax.step(found.times, found[name], where="post", color=it.colour, linestyle=it.dashes)
            ends.append((float(found[name][-1]), it.label, it.colour))
        label_ends(ax, ends)
        ax.set_ylim(0.0, None)
    ax.set(xlabel="time $t$", ylabel="ended by $t$", xlim=(0.0, float(found.times[-1])))
    return ax


@public
def comparison(found: Comparison, ax: Axes | None = None, *, names: tuple[str, str] = ("A", "B")) -> Axes:
    """Draw the paired difference of each outcome's probability with its interval.

    Parameters
    ----------
    found : Comparison
        What to draw.
    ax : Axes, optional
        Where to draw; new axes of a one-column figure if not given.
    names : (str, str)
        What to call the two studies.

    Returns
    -------
    Axes
        The axes drawn in.
    """
    ax = new_axes(ax, COLUMN, 0.65 + _ROW * len(found.names))
    ax.axvline(0.0, color=ink(0.5), linewidth=0.8, linestyle=(0, (4, 2.5)), zorder=1.5)
    rows = zip(found.names, found.difference, found.low, found.high, strict=True)
    for row, (name, d, low, high) in enumerate(rows):
        it = outcome_look(name)
        _interval(ax, row, low, high)
        sure = low > 0.0 or high < 0.0
        ax.plot(
            [d], [row], marker=it.marker, markersize=5.5, markeredgecolor=it.colour, zorder=3.5,
            markerfacecolor=it.colour if sure else paper(), linestyle="none",
        )  # fmt: skip
    _rows(ax, [outcome_look(name).label for name in found.names])
    reach = 1.12 * float(max(np.abs(found.low).max(), np.abs(found.high).max())) or 1.0  # nothing differs: any range
    ax.set(xlabel=f"$P$({names[0]}) − $P$({names[1]})", xlim=(-reach, reach))
    return ax


@public
def radius_curve(
    curve: RadiusCurve,
    ax: Axes | None = None,
    *,
    outcomes: Sequence[str] | None = None,
    quantity: str = "probability",
) -> Axes:
    """Draw outcome probabilities, differences or slopes against a radius.

    Dark bands are pointwise intervals, light ones hold at all radii at once. A vertical line marks the reference.

    Parameters
    ----------
    curve : RadiusCurve
        What to draw.
    ax : Axes, optional
        Where to draw; new axes of a one-column figure if not given.
    outcomes : sequence of str, optional
        Which outcomes; by default intercepted, captured, timeout and, where some games did, diverged.
    quantity : {"probability", "difference", "slope"}
        What to draw of them.

    Returns
    -------
    Axes
        The axes drawn in.

    Raises
    ------
    ValueError
        No such quantity or outcome, or no finite radius to draw it at.
    """
    kinds = {"probability": "estimate", "difference": "difference", "slope": "slope"}
    if outcomes is None:
        outcomes = ["intercepted", "captured", "timeout", *(name for name in curve.names if name == "diverged")]
    listed("quantity", quantity, tuple(kinds))
    finite = np.isfinite(curve.radii)
    if finite.sum() < (2 if quantity == "slope" else 1):
        raise ValueError("no finite radius to draw" if quantity != "slope" else "a slope needs two finite radii")
    ax = new_axes(ax, COLUMN, 2.4)
    whose = rf"\{'zeta' if curve.radius == 'visibility' else 'sigma'}_{{{symbol(curve.player)}}}"
    values, part = curve.radii[finite], kinds[quantity]
    at = (values[1:] + values[:-1]) / 2.0 if quantity == "slope" else values
    low_name, high_name = ("low", "high") if part == "estimate" else (f"{part}_low", f"{part}_high")
    ends = []
    for name in outcomes:
        listed("outcome", name, curve.names)
        it, i = outcome_look(name), curve.names.index(name)
        line, low, high = (getattr(curve, key)[i][: len(at)] for key in (part, low_name, high_name))
        if quantity == "probability":
            band = curve.band_low[i][: len(at)], curve.band_high[i][: len(at)]
            ax.fill_between(at, *band, color=it.colour, alpha=0.13, linewidth=0)
        ax.fill_between(at, low, high, color=it.colour, alpha=0.25, linewidth=0)
        ax.plot(
            at, line, color=it.colour, linestyle=it.dashes, marker=it.marker, markersize=3.2,
            markerfacecolor=paper(), markeredgewidth=0.8, markevery=max(len(at) // 12, 1),
        )  # fmt: skip
        ends.append((float(line[-1]), it.label, it.colour))
    if values[0] <= curve.reference <= values[-1]:
        ax.axvline(curve.reference, color=ink(0.45), linewidth=0.7, linestyle=(0, (4, 2.5)), zorder=1.2)
    if quantity != "probability":
        ax.axhline(0.0, color=ink(0.45), linewidth=0.6, zorder=1.2)
    ylabel = {
        "probability": "probability",
        "difference": r"$P - P(\mathrm{reference})$",
        "slope": rf"$\mathrm{{d}}P/\mathrm{{d}}{whose}$",
    }
    ax.set(xlabel=f"${whose}$", ylabel=ylabel[quantity])
    if values[0] < values[-1]:
        ax.set_xlim(float(values[0]), float(values[-1]))
    ax.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 2.5, 5, 10]))
    label_ends(ax, ends)
    return ax


@public
def sensitivity(found: Sensitivity, output: str | None = None, ax: Axes | None = None) -> Axes:
    """Draw first-order and total indices of one quantity, the inputs with the largest total at the top.

    Parameters
    ----------
    found : Sensitivity
        What to draw.
    output : str, optional
        Which quantity; the first by default.
    ax : Axes, optional
        Where to draw; new axes of a one-column figure if not given.

    Returns
    -------
    Axes
        The axes drawn in.

    Raises
    ------
    ValueError
        No such quantity, or one that never varied.
    """
    name = found.outputs[0] if output is None else output
    listed("output", name, found.outputs)
    o = found.outputs.index(name)
    if np.isnan(found.total[o]).any():
        raise ValueError(f"{name!r} never varied, so no input explains it")
    ax = new_axes(ax, COLUMN, 0.8 + 1.35 * _ROW * len(found.inputs))
    order = np.argsort(-found.total[o], kind="stable")
    kinds = (("first", "first order", "white", "", -0.19), ("total", "total", "0.72", "////", 0.19))
    handles = []
    for kind, label, fill, hatch, offset in kinds:
        low, high, value = (getattr(found, f"{kind}{end}")[o] for end in ("_low", "_high", ""))
        box: dict[str, Any] = {"facecolor": fill, "edgecolor": "0.3", "hatch": hatch, "linewidth": 0.6}
        for row, i in enumerate(order):
            ax.barh(row + offset, max(value[i], 0.0), 0.36, **box)
            _interval(ax, row + offset, low[i], high[i])
        handles.append(Patch(label=label, **box))
    _rows(ax, [input_label(found.inputs[i]) for i in order])
    ax.axvline(0.0, color=ink(0.25), linewidth=0.6)
    what = quantity_label(name)
    ax.set_xlabel(f"share of the variance{' ' if len(what) < 20 else chr(10)}of {what}")  # a narrow figure has no more
    above(ax, handles)
    return ax


def _interval(ax: Axes, row: float, low: float, high: float) -> None:
    """A thin line from low to high with ends."""
    ax.plot((low, high), (row, row), color=ink(), linewidth=1.0, marker="|", markersize=5, zorder=3.0)


def _rows(ax: Axes, labels: Sequence[str]) -> None:
    """Name the rows of a chart, the first at the top."""
    ax.set_yticks(range(len(labels)), labels)
    ax.tick_params(axis="y", length=0)
    ax.set_ylim(len(labels) - 0.5, -0.5)
