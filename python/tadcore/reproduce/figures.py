"""The figures of the paper's section VI, drawn from runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from matplotlib.figure import Figure

from tadcore.plotting.run.network import network
from tadcore.plotting.run.series import controls
from tadcore.plotting.run.trajectories import trajectories
from tadcore.plotting.tools.style import COLUMN, PAGE, edge_text
from tadcore.simulation.run import Run

Runs = Mapping[str, "Run"]


def first_edge(run: Run, observer: str, seen: str | None = None) -> float | None:
    """Return when ``observer`` first sees ``seen``, or anyone if ``seen`` is None; None if it never does."""
    for time, added, _ in run.network_changes:
        if any(str(a) == observer and seen in (None, str(b)) for a, b in added):
            return float(time)
    return None


def _paths(
    name: str, *, full: str | None = None, width: float = COLUMN, height: float = 3.0
) -> Callable[[Runs], Figure]:
    def make(runs: Runs) -> Figure:
        fig = Figure(figsize=(width, height), layout="constrained")
        trajectories(runs[name], fig.add_subplot(), full=None if full is None else runs[full])
        return fig

    return make


def _panels(name: str) -> Callable[[Runs], Figure]:
    def make(runs: Runs) -> Figure:
        rows = -(-len(runs[name].network_changes) // 3)
        fig = Figure(figsize=(COLUMN, 1.4 * rows), layout="constrained")
        network(runs[name], fig.subplots(rows, 3, squeeze=False))
        return fig

    return make


def _i1_controls(runs: Runs) -> Figure:
    fig = Figure(figsize=(COLUMN, 2.4), layout="constrained")
    controls(runs["paper-i1"], "x", ax=fig.add_subplot())
    return fig


def _i2_controls(runs: Runs) -> Figure:
    """Two games that differ in one radius: the same controls until that player first sees someone."""
    fig = Figure(figsize=(PAGE, 2.6), layout="constrained")
    axes = fig.subplots(1, 2, sharey=True)
    pairs = (("paper-i2", "(a) ", 0.3), ("paper-i2-wide", "(b) ", 0.6))
    for ax, (name, panel, radius) in zip(axes, pairs, strict=True):
        controls(runs[name], "y", ax=ax, changes=False)
        ax.set_title(rf"{panel}$\zeta_{{d_3}}={radius}$")
    axes[1].set_ylabel("")
    time = first_edge(runs["paper-i2-wide"], "d3")
    if time is not None:
        axes[0].axvline(time, color="0.6", linewidth=0.7, linestyle=":", zorder=1.2)
        axes[1].axvline(time, color="black", linewidth=1.0, linestyle=(0, (4, 2.5)), zorder=1.2)
        axes[1].annotate(
            f"{edge_text('d3', ['attacker'])} at $t={time:.6g}$",
            (time, 0.94),
            xycoords=("data", "axes fraction"),
            xytext=(5, 0),
            textcoords="offset points",
            va="center",
            fontsize="small",
        )
    return fig


FIGURES: dict[str, Callable[[Runs], Figure]] = {
    "fig-i1-trajectories-full": _paths("paper-i1-full"),
    "fig-i1-trajectories-limited": _paths("paper-i1"),
    "fig-i1-network": _panels("paper-i1"),
    "fig-i1-controls": _i1_controls,
    "fig-i1-suicidal": _paths("paper-i1-suicidal", full="paper-i1-suicidal-full"),
    "fig-i2-trajectories-full": _paths("paper-i2-full", height=2.7),
    "fig-i2-trajectories-far": _paths("paper-i2-far", height=2.7),
    "fig-i2-trajectories-limited": _paths("paper-i2", height=2.7),
    "fig-i2-trajectories-wide": _paths("paper-i2-wide", width=PAGE, height=4.2),
    "fig-i2-network": _panels("paper-i2"),
    "fig-i2-controls": _i2_controls,
}
"""How to make each figure, by file name, from runs by scenario; to be drawn and saved in `tadcore.plotting.style`."""
