"""Histories over time: controls, distances to the attacker, and the synthesis objective."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.ticker import MaxNLocator

from tadcore._shared.arrays import Floats
from tadcore._shared.calls import public
from tadcore._shared.text import one_of
from tadcore.errors import ScenarioError
from tadcore.game.recorded import Recorded
from tadcore.game.sound import until_divergence
from tadcore.plotting.tools.axes import above, as_run, new_axes
from tadcore.plotting.tools.ends import label_ends
from tadcore.plotting.tools.ground import ink, paper
from tadcore.plotting.tools.style import COLUMN, look, note, time_label

from .paths import PASSED, colour_of, count_passes

if TYPE_CHECKING:
    from matplotlib.axes import Axes


MAX_VERTICALS = 40
"""A run whose network changes more often than this gets thin curves, and ticks instead of full-height verticals."""

_TERMS = {
    4: (r"$\|\Delta Q_d\|^2$", r"$\|\Delta Q_\tau\|^2$", r"$\|\Delta Q_a\|^2$", r"$\|S_1\|^2$"),
    3: (r"$\|\Delta Q\|^2$", r"$\|S_2\|^2$", r"$\|S_3\|^2$"),
}


@public
def controls(
    run: Recorded,
    axis: str = "x",
    *,
    players: Sequence[str] | None = None,
    ax: Axes | None = None,
    changes: bool = True,
) -> Axes:
    """Draw one component of the players' controls over time, with a dashed vertical at each network change.

    Parameters
    ----------
    run : Run
        The run to draw.
    axis : str
        The component: "x", "y" or "z".
    players : sequence of str, optional
        Whose controls, one player or several; by default those of the players whose sight is limited: the defenders,
        in I2 the target too.
    ax : Axes, optional
        Where to draw; new axes of a one-column figure if not given.
    changes : bool
        Whether to mark the network changes.

    Returns
    -------
    Axes
        The axes drawn in.

    Raises
    ------
    ScenarioError
        The game has no such player or no such axis.
    """
    as_run(run)
    run = until_divergence(run)
    given = [players] if isinstance(players, str) else run.scenario.constrained if players is None else players
    shown = _known(run, given)
    known_axis(run, axis)
    ax = new_axes(ax, COLUMN, 2.3)
    control = run.control[..., "xyz".index(axis)]
    _curves(ax, run, {p: control[:, run.scenario.players.index(p)] for p in shown})
    if changes:
        mark_changes(ax, run)
    who = ", ".join(look(p).symbol for p in shown) if len(shown) < 3 else "players"
    ax.set_ylabel(f"control along ${axis}$" if who == "players" else f"control of {who} along ${axis}$")
    return ax


@public
def distances(run: Recorded, *, ax: Axes | None = None, changes: bool = True) -> Axes:
    r"""Draw each player's distance to the attacker, with its capture radius σ and visibility radius ζ.

    Capture radii are dotted, a single line where all are equal; visibility radii that fall inside the picture are thin
    lines in the player's colour and dashes. A crossed circle is the closest approach of a pass within a capture radius
    between two instants, which ends nothing.

    Parameters
    ----------
    run : Run
        The run to draw.
    ax : Axes, optional
        Where to draw; new axes of a one-column figure if not given.
    changes : bool
        Whether to mark the network changes.

    Returns
    -------
    Axes
        The axes drawn in.
    """
    as_run(run)
    run = until_divergence(run)
    ax = new_axes(ax, COLUMN, 2.5)
    names = run.scenario.players[:-1]
    curves = dict(zip(names, to_attacker(run), strict=True))
    top = 1.06 * max(float(c.max()) for c in curves.values())
    rims: list[tuple[float, str, str]] = []
    sigma = run.scenario.capture_radii
    if np.ptp(sigma) == 0:
        rims.append((float(sigma[0]), r"$\sigma$", ink(0.25)))
    else:
        symbols = [rf"$\sigma_{{{look(p).symbol.strip('$')}}}$" for p in [*names[:-1], "attacker"]]
        colours = [look(p).colour for p in [*names[:-1], "attacker"]]
        rims += list(zip(sigma.tolist(), symbols, colours, strict=True))
    for radius, _, colour in rims:
        ax.axhline(radius, color=colour, linewidth=0.8, linestyle=(0, (1, 1.5)), zorder=1.5)
    for p, radius in zip(names, run.scenario.visibility_radii, strict=False):
        if np.isfinite(radius) and radius < top:
            it = look(p)
            ax.axhline(radius, color=it.colour, linewidth=0.6, linestyle=it.dashes, alpha=0.8, zorder=1.4)
            rims.append((float(radius), rf"$\zeta_{{{it.symbol.strip('$')}}}$", it.colour))
    ax.set_ylim(0, top)
    _curves(ax, run, curves, rims)
    for each in run.passes:
        ax.plot([each.closest_time], [each.distance], color=colour_of(run, each), clip_on=False, **PASSED)
    if run.passes:
        note(ax, count_passes(run))
    if changes:
        mark_changes(ax, run)
    ax.set_ylabel("distance to $a$")
    return ax


@public
def theta(run: Recorded, *, ax: Axes | None = None, changes: bool = True) -> Axes:
    r"""Draw the synthesis objective :math:`\Theta` and the squared norms that make it up, on a logarithmic scale.

    Where everyone sees everyone :math:`\Theta = 0` and the curves leave the picture.

    Parameters
    ----------
    run : Run
        The run to draw.
    ax : Axes, optional
        Where to draw; new axes of a one-column figure if not given.
    changes : bool
        Whether to mark the network changes.

    Returns
    -------
    Axes
        The axes drawn in.
    """
    as_run(run)
    run = until_divergence(run)
    ax = new_axes(ax, COLUMN, 2.3)
    times = run.times
    # exactly zero where everyone sees everyone, whatever rounding leaves there
    everyone = np.asarray(run.adjacency.all(axis=(1, 2)))
    total, terms = np.where(everyone, 0.0, run.theta), np.where(everyone[:, None], 0.0, run.theta_terms)
    scale = float(max(total.max(), terms.max()))
    ax.set(xlabel=time_label(run), ylabel=r"$\Theta$ and its terms", xlim=span(times))
    if scale <= 0:
        ax.plot(times, total, color=ink())
        ax.set_ylim(-1, 1)
        ax.text(0.5, 0.56, r"$\Theta=0$: everyone sees everyone", transform=ax.transAxes, ha="center", va="bottom")
        return ax
    ax.set_yscale("log")
    names = [r"$\Theta$", *_TERMS[terms.shape[1]]]
    lines = []
    for i, (name, values) in enumerate(zip(names, [total, *terms.T], strict=True)):
        it = look(f"d{i}") if i else None
        positive = np.where(values > 1e-12 * scale, values, np.nan)
        (line,) = ax.plot(
            times,
            positive,
            color=it.colour if it else ink(),
            linestyle=it.dashes if it else "-",
            linewidth=1.0 if it else 1.6,
            zorder=2.5 if it else 2.8,
            label=name,
        )
        lines.append(line)
    above(ax, lines)
    quiet = times[np.flatnonzero(total > 1e-12 * scale)[-1]]
    if times[-1] - quiet > 0.15 * times[-1]:
        middle = 0.5 * (quiet + times[-1])
        where = ax.get_xaxis_transform()
        ax.text(middle, 0.5, r"$\Theta=0$", transform=where, ha="center", va="center", color=ink(0.3))
    if changes:
        mark_changes(ax, run)
    return ax


def to_attacker(run: Recorded) -> list[Floats]:
    """Return the distances to the attacker over time, one array for each other player."""
    return list(np.linalg.norm(run.position[:, :-1] - run.position[:, -1:], axis=-1).T)


def _known(run: Recorded, shown: object) -> list[str]:
    names = run.scenario.players
    if not isinstance(shown, Iterable):
        raise ScenarioError("players", shown, f"a list of some of {', '.join(names)}")
    return [one_of("players", player, names) for player in shown]


def known_axis(run: Recorded, axis: str) -> None:
    """Refuse a component that the game does not have."""
    axes = "xyz"[: run.scenario.dim]
    one_of("axis", axis, axes)


def span(times: Floats) -> tuple[float, float]:
    """Return the limits of the axis of time."""
    return float(times[0]), float(times[-1]) if times[-1] > times[0] else float(times[0]) + 1.0


def _curves(ax: Axes, run: Recorded, curves: dict[str, Floats], rims: Sequence[tuple[float, str, str]] = ()) -> None:
    """Draw one curve per player, named at its right end; ``rims`` are named there too."""
    times = run.times
    ends: list[tuple[float, str, str]] = []
    restless = len(run.network_changes) > MAX_VERTICALS
    for i, (player, values) in enumerate(curves.items()):
        it = look(player)
        step = max(len(times) // 6, 1)
        ax.plot(
            times,
            values,
            color=it.colour,
            linestyle=it.dashes,
            linewidth=0.5 if restless else None,
            marker=it.marker,
            markersize=6.0 if it.marker == "*" else 3.8,
            markerfacecolor=paper(),
            markeredgewidth=0.9,
            markevery=(min(step // 2 + i * step // max(len(curves), 1), len(times) - 1), step),
            zorder=2.5,
        )
        ends.append((float(values[-1]), it.symbol, it.colour))
    ax.set(xlabel=time_label(run), xlim=span(times))
    ax.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 2.5, 5, 10]))
    label_ends(ax, [*ends, *rims])


def mark_changes(ax: Axes, run: Recorded, *, say: bool = True) -> None:
    """Mark each network change: a dashed vertical, or a tick at the foot and a remark where they are many."""
    times = [change.time for change in run.network_changes[1:]]
    kind: dict[str, Any] = {"color": ink(0.45), "zorder": 1.2}
    if len(times) <= MAX_VERTICALS:
        for t in times:
            ax.axvline(t, linewidth=0.7, linestyle=(0, (4, 2.5)), **kind)
        return
    ax.vlines(times, 0.0, 0.04, transform=ax.get_xaxis_transform(), linewidth=0.4, **kind)
    if say:
        note(ax, f"{len(times)} network changes, ticks at the foot")
