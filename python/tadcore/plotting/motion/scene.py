"""What moves in an animation: an arena, and beside it the visibility network."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from matplotlib.patheffects import withStroke

from tadcore._shared.arrays import Floats
from tadcore.game.recorded import Recorded
from tadcore.plotting.run.network import aside, draw_graph
from tadcore.plotting.run.paths import disc
from tadcore.plotting.tools.ground import ink, paper
from tadcore.plotting.tools.inset import filled
from tadcore.plotting.tools.style import edge_text, look, outcome_text, world_text

from .frames import Frame

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D


_RECENT = 0.15  # of the game: how long a trail stays strong
_HEIGHT = 0.58  # of the width
_ARENA = (0.07, 0.12, 0.58, 0.79)
_CIRCLE = np.linspace(0.0, 2.0 * np.pi, 73)


class Scene:
    """The figure of an animation, and how to set it to a frame."""

    def __init__(self, run: Recorded, width: float) -> None:
        self.figure = Figure(figsize=(width, _HEIGHT * width))
        FigureCanvasAgg(self.figure)
        self._run = run
        self._where = run.position
        self._radii = dict(zip(run.scenario.constrained, run.scenario.visibility_radii, strict=True))
        self._arena = self._make_arena()
        self._graph = self.figure.add_axes((0.69, 0.14, 0.3, 0.3 / _HEIGHT))
        self._clock = self.figure.text(0.07, 0.955, "", ha="left", va="center", family="monospace")
        self._event = self.figure.text(0.65, 0.955, "", ha="right", va="center")
        self.figure.text(0.985, 0.03, world_text(run), ha="right", va="center", fontsize="x-small", color=ink(0.3))
        self._seen: list[Line2D] = []
        self._network: object = None
        self._over = False
        self._movers = [self._mover(player) for player in run.scenario.players]
        changes = run.network_changes
        self._starts = [int(np.argmin(np.abs(run.times - change.time))) for change in changes]
        self._edges = [set(interval.edges) for interval in run.intervals()]

    def show(self, frame: Frame) -> None:
        """Set everything to one frame."""
        k = frame.k
        since = max(k - int(_RECENT * len(self._where)), 0)
        for p, (player, mover) in enumerate(zip(self._run.scenario.players, self._movers, strict=True)):
            path = self._where[: k + 1, p]
            _set(mover["trail"], path)
            _set(mover["recent"], path[since:])
            _set(mover["marker"], path[-1:])
            blind = self._is_blind(p, k)
            if "failure" in mover:
                _set(mover["failure"], path[-1:] if blind else path[:0])
            if "sight" in mover:
                self._look_around(mover, path[-1], 0.0 if blind else float(self._radii[player]))
            name = mover["name"]
            if len(path[-1]) == 3:
                name.set_position_3d(tuple(path[-1]))
            else:
                name.xy = tuple(path[-1])
        self._clock.set_text(f"t = {self._run.times[k]:.3f}")
        self._show_network(k, pause=frame.pause)
        if frame.over:
            self._event.set_text(outcome_text(self._run))
            if not self._over:
                disc(self._arena, self._run, dashed=False)
            self._over = True

    @property
    def space(self) -> bool:
        """Whether the arena is a box, and not a plane."""
        return int(self._where.shape[-1]) == 3

    @property
    def still(self) -> object:
        """What decides how everything looks that is not in `front`."""
        return self._network, self._over, self._graph.axison

    def front(self) -> list[Artist]:
        """Artists from the lowest that moves on upwards, in the order in which they are drawn."""
        lowest = min(artist.get_zorder() for mover in self._movers for artist in mover.values())
        arena = [a for a in self._arena.get_children() if a is not self._arena.patch and a.get_zorder() >= lowest]
        return [*sorted(arena, key=lambda artist: artist.get_zorder()), self._clock, self._event]

    def _is_blind(self, p: int, k: int) -> bool:
        """Whether a player's sensor does not work at t_k."""
        course = self._run.course
        return course is not None and p < course.sensor_up.shape[1] and not bool(course.sensor_up[k, p])

    def _look_around(self, mover: dict[str, Any], centre: Floats, radius: float) -> None:
        """Put the disc of what a player sees around it; in space the level circle, where it is inside the box."""
        ring = np.zeros((len(_CIRCLE), len(centre)))
        ring[:, 0], ring[:, 1] = np.cos(_CIRCLE), np.sin(_CIRCLE)
        ring = centre + radius * ring
        if "field" in mover:
            mover["field"].set_xy(ring)
        else:
            low, high = np.array([self._arena.get_xlim(), self._arena.get_ylim()]).T
            ring[((ring[:, :2] < low) | (ring[:, :2] > high)).any(axis=1)] = np.nan
        _set(mover["sight"], ring)

    def _show_network(self, k: int, *, pause: bool) -> None:
        """Draw the graph in force at t_k; during a pause also what is new, in the arena and above it."""
        if not self._starts:
            self._graph.set_axis_off()
            return
        now = min(int(np.searchsorted(self._starts, k, side="right")) - 1, len(self._edges) - 1)
        change = self._run.network_changes[now]
        new, lost = (set(change.added), set(change.removed)) if pause and now else (set(), set())
        for line in self._seen:
            line.remove()
        told, failed = aside(self._run, float(self._run.times[k]))
        self._seen = [self._sight_line(k, *edge, dashed=edge in told) for edge in sorted(new)]
        texts = [edge_text(p, [q]) for p, q in sorted(new)] + [edge_text(p, [q], lost=True) for p, q in sorted(lost)]
        self._event.set_text(",  ".join(texts[:4]) + (" …" if len(texts) > 4 else ""))
        state = (now, pause, frozenset(told), frozenset(failed))
        if state != self._network:
            self._network = state
            self._graph.clear()
            draw_graph(self._graph, self._run.scenario.players, self._edges[now], new, lost, told=told, failed=failed)
            reports = self._run.scenario.world is not None and self._run.scenario.world.talks
            self._graph.set_title("who sees, or is told of, whom" if reports else "who sees whom")

    def _sight_line(self, k: int, observer: str, seen: str, *, dashed: bool) -> Line2D:
        names = self._run.scenario.players
        ends = self._where[k, [names.index(observer), names.index(seen)]]
        style = "--" if dashed else "-"
        (line,) = self._arena.plot(*ends.T, color=ink(), linestyle=style, linewidth=1.4, zorder=2.8)
        return line

    def _make_arena(self) -> Axes:
        every = self._where.reshape(-1, self._where.shape[-1])
        low, high = every.min(axis=0), every.max(axis=0)
        pad = 0.12 * max(float((high - low).max()), 1e-9)
        low, high = low - pad, high + pad
        if len(low) == 3:
            ax = self.figure.add_axes((0.02, 0.06, 0.62, 0.86), projection="3d")
            ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]), zlabel="$z$")
            ax.set_box_aspect(tuple(high - low))  # type: ignore[arg-type]
        else:
            ax = self.figure.add_axes(_ARENA)
            low, high = filled(low, high, _ARENA[2] / (_ARENA[3] * _HEIGHT))
            ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
            ax.set_autoscale_on(False)
        ax.set(xlabel="$x$", ylabel="$y$")
        return ax

    def _mover(self, player: str) -> dict[str, Any]:
        it = look(player)
        nothing = np.empty((0, self._where.shape[-1]))
        size = {"*": 11.0, "X": 8.5}.get(it.marker, 7.5)
        halo = [withStroke(linewidth=2.0, foreground=paper())]
        (trail,) = self._arena.plot(*nothing.T, color=it.colour, linewidth=0.9, alpha=0.5, zorder=2.0)
        (recent,) = self._arena.plot(*nothing.T, color=it.colour, linewidth=2.0, zorder=2.5)
        (marker,) = self._arena.plot(
            *nothing.T, linestyle="none", color=it.colour, marker=it.marker, markersize=size,
            markeredgecolor=paper(), markeredgewidth=0.7, zorder=3.2,
        )  # fmt: skip
        mover: dict[str, Any] = {"trail": trail, "recent": recent, "marker": marker}
        if self._run.course is not None and not self._run.course.sensor_up.all():
            (mover["failure"],) = self._arena.plot(
                *nothing.T, linestyle="none", color=ink(), marker="x", markersize=1.6 * size, markeredgewidth=1.4,
                zorder=3.3,
            )  # fmt: skip
        if np.isfinite(self._radii.get(player, np.inf)):
            (mover["sight"],) = self._arena.plot(
                *nothing.T, color=it.colour, linestyle=it.dashes, linewidth=0.8, alpha=0.7, zorder=1.5, scalex=False,
                scaley=False,
            )  # fmt: skip
            if nothing.shape[1] == 2:
                mover["field"] = self._arena.add_patch(
                    Polygon(np.zeros((1, 2)), facecolor=it.colour, alpha=0.06, linewidth=0.0, zorder=1.0)
                )
        if nothing.shape[1] == 3:
            mover["name"] = self._arena.text(
                0.0, 0.0, 0.0, f"  {it.symbol}", color=it.colour, path_effects=halo, zorder=4.0  # type: ignore[arg-type]
            )  # fmt: skip
        else:
            mover["name"] = self._arena.annotate(
                it.symbol, (0.0, 0.0), xytext=(5.0, 5.0), textcoords="offset points", color=it.colour,
                path_effects=halo, zorder=4.0,
            )  # fmt: skip
        return mover


def _set(line: Any, path: Floats) -> None:
    if path.shape[1] == 3:
        line.set_data_3d(*path.T)
    else:
        line.set_data(*path.T)
