"""Outcome maps, with the players who stay where they are."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, TypeAlias

import numpy as np
from matplotlib.patches import Circle

from tadcore._shared.arrays import Floats
from tadcore._shared.calls import public
from tadcore.game.outcome import ending_codes, ending_names
from tadcore.plotting.tools.axes import above, colour_bar, new_axes
from tadcore.plotting.tools.ground import ink
from tadcore.plotting.tools.labels import Labels
from tadcore.plotting.tools.outcomes import boxes, listed, outcome_look
from tadcore.plotting.tools.style import COLUMN, PAGE, look, symbol
from tadcore.scenario.model import Scenario

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.image import AxesImage
    from numpy.typing import NDArray


Extent: TypeAlias = tuple[float, float, float, float]
"""Left, right, bottom and top, as Matplotlib's imshow takes them."""

_HATCHED = 240  # grid points along an axis from which hatches are cut; finer ones would print as noise


class OverStarts(Protocol):
    """Something over a grid of one player's start: `tadcore.OutcomeMap`, `tadcore.analysis.ProbabilityMap`."""

    @property
    def scenario(self) -> Scenario:
        """The game, with everyone else's start."""

    @property
    def player(self) -> str:
        """Whose start varies."""

    @property
    def dataset(self) -> xarray.Dataset:
        """``kind``, ``defender`` and ``time`` over (y, x), or ``estimate`` and its intervals over (outcome, y, x)."""


@public
def outcome_map(
    found: OverStarts, ax: Axes | None = None, *, quantity: str = "outcome", radii: bool = True, legend: bool = True
) -> Axes:
    """Draw how, or when, the game ends by the start of one player.

    Starts whose game diverges are drawn apart, also from the times: how and when such a game ends says nothing.

    The other players stand where they start, with their capture discs (filled) and visibility radii (dashed, those
    that fall inside the picture); a hollow marker shows where the scenario has the player whose start varies. In space
    they are drawn in projection, and radii as great circles.

    Parameters
    ----------
    found : OutcomeMap
        What to draw.
    ax : Axes, optional
        Where to draw; new axes of a one-column figure if not given, of a two-column one for a map wider than three
        times its height.
    quantity : {"outcome", "time"}
        How the game ends, or when.
    radii : bool
        Whether to draw capture discs and visibility radii.
    legend : bool
        Whether to name the outcomes above the axes, or the colours of the time beside them.

    Returns
    -------
    Axes
        The axes drawn in.

    Raises
    ------
    ValueError
        No such quantity.
    """
    listed("quantity", quantity, ("outcome", "time"))
    ax, x, y, extent = frame(found, ax, bar=quantity == "time" and legend)
    if quantity == "outcome":
        names = _areas(ax, found, x, y, extent)
        if legend:
            above(ax, boxes(names), columns=min(len(names), 5), columnspacing=0.7, handlelength=1.4)
    else:
        image = _times(ax, found, x, y, extent, legend=legend)
        if legend:
            colour_bar(ax, image, "termination time")
    draw_players(ax, found, extent, radii=radii, dark=quantity == "time")
    return ax


def frame(
    found: OverStarts, ax: Axes | None, *, bar: bool
) -> tuple[Axes, Floats, Floats, tuple[float, float, float, float]]:
    """The axes of a map, with room beside them where there will be a bar of colours; its places and where it ends."""
    x, y = (np.asarray(found.dataset[axis].values, dtype=float) for axis in "xy")
    extent = (*_edges(x, y), *_edges(y, x))
    return region(found.player, extent, ax, bar=bar), x, y, extent


def region(player: str, extent: Extent, ax: Axes | None, *, bar: bool) -> Axes:
    """Axes over the starts of one player, in proportion."""
    left, right, bottom, top = extent
    ratio = (top - bottom) / (right - left)
    width = PAGE if ratio < 1.0 / 3.0 else COLUMN
    beside = 0.65 if bar else 0.0  # inches
    ax = new_axes(ax, width, float(np.clip((width - 0.6 - beside) * ratio + (0.5 if bar else 0.8), 1.6, 5.5)))
    who = symbol(player)
    ax.set(xlabel=f"$x_{{{who}}}(0)$", ylabel=f"$y_{{{who}}}(0)$", xlim=(left, right), ylim=(bottom, top))
    ax.set_autoscale_on(False)
    ax.set_aspect("equal")
    return ax


def _edges(points: Floats, others: Floats) -> tuple[float, float]:
    """Where the first and the last cell of an axis end; a single place is as wide as the other axis's cells."""
    spread = points if len(points) > 1 else others
    half = float(spread[1] - spread[0]) / 2.0 if len(spread) > 1 else 0.5
    return float(points[0]) - half, float(points[-1]) + half


def _areas(ax: Axes, found: OverStarts, x: Floats, y: Floats, extent: Extent) -> list[str]:
    """Fill and hatch the areas; returns the outcomes that occur, in the order of their codes."""
    kind, defender = found.dataset["kind"].values, found.dataset["defender"].values
    diverged = found.dataset["diverged"].values if "diverged" in found.dataset else np.zeros(kind.shape, dtype=bool)
    names = ending_names(found.scenario.n)
    code = ending_codes(kind, defender, diverged, found.scenario.n)
    styles = [outcome_look(name) for name in names]
    colours = np.array([style.fill for style in styles])
    ax.imshow(colours[code], origin="lower", extent=extent, interpolation="nearest", zorder=1.0)
    there = [i for i in range(len(names)) if np.any(code == i)]
    for i in there:
        _hatch(ax, x, y, code == i, styles[i].hatch)
    return [names[i] for i in there]


def _times(ax: Axes, found: OverStarts, x: Floats, y: Floats, extent: Extent, *, legend: bool) -> AxesImage:
    """Colour by the time of the end, and draw what diverges as in a map of outcomes."""
    lost = np.asarray(found.dataset["diverged"].values)
    time = np.where(lost, np.nan, found.dataset["time"].values)
    if lost.any():
        it = outcome_look("diverged")
        ax.imshow(np.where(lost[..., None], it.fill, 1.0), origin="lower", extent=extent, zorder=0.9)
        _hatch(ax, x, y, lost, it.hatch)
        if legend:
            above(ax, boxes(["diverged"]))
    return ax.imshow(time, origin="lower", extent=extent, cmap="cividis", zorder=1.0)


def _hatch(ax: Axes, x: Floats, y: Floats, where: NDArray[np.bool_], hatch: str) -> None:
    """Hatch the places that are marked; of a fine grid, so many as a print can show."""
    rows, columns = (slice(None, None, -(-len(points) // _HATCHED)) for points in (y, x))
    coarse = where[rows, columns]
    if hatch and min(coarse.shape) > 1 and coarse.any():
        inside = np.where(coarse, 1.0, 0.0)
        area = ax.contourf(
            x[columns], y[rows], inside, levels=[0.5, 1.5], colors="none", hatches=[hatch], zorder=1.1
        )  # fmt: skip
        area.set_edgecolor((0.0, 0.0, 0.0, 0.45))
        area.set_linewidth(0.0)


def draw_players(ax: Axes, found: OverStarts, extent: Extent, *, radii: bool, dark: bool) -> None:
    """The players where they start, with their radii; a hollow marker for the one whose start varies."""
    sc, left, right, bottom, top = found.scenario, *extent
    labels = Labels(ax)
    sight = dict(zip(sc.constrained, sc.visibility_radii, strict=True))
    reach = dict(zip((*sc.players[: sc.n], "attacker"), sc.capture_radii, strict=True))
    far = float(np.hypot(right - left, top - bottom))
    for player, position in zip(sc.players, sc.positions, strict=True):
        at, it, varies = (float(position[0]), float(position[1])), look(player), player == found.player
        if not (left <= at[0] <= right and bottom <= at[1] <= top):
            continue
        size = {"*": 7.5, "X": 5.5}.get(it.marker, 4.0)
        edge = "white" if dark else "black"
        ax.plot(
            *at, linestyle="none", marker=it.marker, markersize=size, zorder=3.2, markeredgewidth=0.8,
            markerfacecolor="white" if varies else it.colour, markeredgecolor=it.colour if varies else edge,
        )  # fmt: skip
        labels.avoid_spot(at, 5.0)
        labels.add(at, it.symbol, color=ink(), leader_from=14.0)
        if not radii or varies:
            continue
        if player in reach:
            disc = Circle(
                at, reach[player], facecolor="white", edgecolor=it.colour, linewidth=0.8, alpha=0.75, zorder=2.4
            )
            ax.add_patch(disc)
        if sight.get(player, np.inf) < far:
            for colour, weight in (("white", 2.2), (it.colour, 1.1)):  # a pale casing: it reads on any area
                ring = Circle(at, sight[player], fill=False, edgecolor=colour, linewidth=weight, zorder=2.3)
                ring.set_linestyle("-" if colour == "white" else (0, (4, 2)))
                ax.add_patch(ring)
