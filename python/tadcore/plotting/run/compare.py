"""Two runs in one picture."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from tadcore._shared.calls import public
from tadcore._shared.text import one_of
from tadcore.errors import ScenarioError
from tadcore.game.recorded import Recorded
from tadcore.game.sound import until_divergence
from tadcore.plotting.tools.axes import as_run, new_axes
from tadcore.plotting.tools.ends import label_ends
from tadcore.plotting.tools.ground import paper
from tadcore.plotting.tools.style import COLUMN, look, outcome_text, time_label

from .paths import LAID_UNDER, name_runs
from .series import known_axis, span, to_attacker
from .trajectories import trajectories

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@public
def compare(
    run_a: Recorded,
    run_b: Recorded,
    *,
    what: Literal["trajectories", "controls", "distances"] = "trajectories",
    axis: str = "x",
    names: tuple[str, str] | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Overlay two runs of the same players: ``run_a`` solid, ``run_b`` dashed.

    If one of them is under full observation, no radius being finite, that one is dashed, whichever comes first.

    Parameters
    ----------
    run_a, run_b : Run
        The runs to draw.
    what : {"trajectories", "controls", "distances"}
        Paths; controls along ``axis`` of the players with limited sight; distances to the attacker.
    axis : str
        The component of the controls: "x", "y" or "z".
    names : (str, str), optional
        What the legend calls ``run_a`` and ``run_b``; by default what each sees, or how each ends where both see the
        same.
    ax : Axes, optional
        Where to draw; new axes of a one-column figure if not given.

    Returns
    -------
    Axes
        The axes drawn in.
    """
    as_run(run_a, "run_a")
    as_run(run_b, "run_b")
    if run_a.scenario.players != run_b.scenario.players:
        theirs = f"a run of {', '.join(run_b.scenario.players)}"
        raise ScenarioError("run_b", theirs, f"one of the same players: {', '.join(run_a.scenario.players)}")
    one_of("what", what, ("trajectories", "controls", "distances"))
    run_a, run_b = until_divergence(run_a), until_divergence(run_b)
    names = names or _names(run_a, run_b)
    if _full(run_a) and not _full(run_b):
        run_a, run_b, names = run_b, run_a, names[::-1]
    if what == "trajectories":
        return trajectories(run_a, ax, full=run_b, names=names)
    if what == "controls":
        known_axis(run_a, axis)
    ax = new_axes(ax, COLUMN, 2.5)
    shown = run_a.scenario.constrained if what == "controls" else run_a.scenario.players[:-1]
    last = max(run_a, run_b, key=lambda run: run.times[-1])  # names stand at the frame, where this one's curves end
    ends = []
    for run, dashed in ((run_b, True), (run_a, False)):
        distances = to_attacker(run)
        for i, player in enumerate(shown):
            values = run.control[:, i, "xyz".index(axis)] if what == "controls" else distances[i]
            it = look(player)
            width: dict[str, Any] = {"linestyle": LAID_UNDER, "linewidth": 0.9} if dashed else {}
            common: dict[str, Any] = {"color": it.colour, "zorder": 2.0 if dashed else 2.5}
            (curve,) = ax.plot(run.times, values, **common, **width)
            # dashes say which run it is, so markers along the way say whose curve, in greyscale too
            step = max(len(values) // 5, 1)
            curve.set(marker=it.marker, markersize=3.4, markerfacecolor=paper(), markeredgewidth=0.8)
            curve.set_markevery((min(step // 2 + i * step // len(shown), len(values) - 1), step))
            ax.plot(run.times[-1:], values[-1:], marker=it.marker, markersize=3.4, clip_on=False, **common)
            if run is last:
                ends.append((float(values[-1]), it.symbol, it.colour))
    ax.set(xlabel=time_label(run_a, run_b), xlim=span(last.times))
    ax.set_ylabel(f"control along ${axis}$" if what == "controls" else "distance to $a$")
    if what == "distances":
        ax.set_ylim(bottom=0.0)
    label_ends(ax, ends)
    name_runs(ax, names)
    return ax


def _full(run: Recorded) -> bool:
    return bool(np.isinf(run.scenario.visibility_radii).all())


def _names(run_a: Recorded, run_b: Recorded) -> tuple[str, str]:
    a, b = ("full observation" if _full(run) else "limited observations" for run in (run_a, run_b))
    return (a, b) if a != b else (outcome_text(run_a), outcome_text(run_b))
