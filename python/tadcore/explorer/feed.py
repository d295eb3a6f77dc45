"""What the browser is sent: the run as it stands, and the instant that is shown."""

from __future__ import annotations

import math
from html import escape
from typing import Any

import numpy as np
from bokeh.models import ColumnDataSource, Range1d

from tadcore.plotting.run.raster import bars_of

from .figures import edge_name, frame, instant, plain
from .model import Explorer

SOURCES = ("starts", "chosen", "handles", "now", "paths", "discs", "capture", "sight", "bars", "theta", "controls")


class Feed:
    """The data behind the figures of one page.

    Attributes
    ----------
    sources : dict of str to ColumnDataSource
        By what is drawn of them.
    marks : list of Span
        The instant shown, one for each history.
    across, up : Range1d
        What is in view.
    held : (source, player) or None
        What the pointer holds: the browser moves it, so it is not sent.
    component : int
        Which component of the controls is traced; -1 for the speed.
    """

    def __init__(self, explorer: Explorer) -> None:
        self.explorer = explorer
        self.sources = {name: ColumnDataSource() for name in SOURCES}
        self.marks = [instant() for _ in range(3)]
        self.held: tuple[str, str] | None = None
        self.component = -1
        left, right, bottom, top = frame(explorer)
        self.across, self.up = Range1d(left, right), Range1d(bottom, top)

    def fit(self) -> None:
        """Bring the whole game into view."""
        left, right, bottom, top = frame(self.explorer)
        self.across.update(start=left, end=right)
        self.up.update(start=bottom, end=top)

    @property
    def region(self) -> tuple[float, float, float, float]:
        """What is in view: left, right, bottom, top."""
        return float(self.across.start), float(self.across.end), float(self.up.start), float(self.up.end)

    def send_run(self) -> None:
        """Send everything that does not depend on the instant."""
        explorer, run = self.explorer, self.explorer.run
        players, at = explorer.scenario.players, explorer.sampled
        self.sources["paths"].data = {
            "player": list(players),
            "x": [run.position[at, p, explorer.plane[0]].tolist() for p in range(len(players))],
            "y": [run.position[at, p, explorer.plane[1]].tolist() for p in range(len(players))],
        }
        x, y = explorer.flat(explorer.scenario.positions).T.tolist()
        if self.held is None or self.held[0] != "starts":
            self.sources["starts"].data = {
                "player": list(players), "x": x, "y": y, "name": [plain(p) for p in players]
            }  # fmt: skip
        who = players.index(explorer.chosen)
        self.sources["chosen"].data = {"x": [x[who]], "y": [y[who]]}
        bars = [(edge, bar) for edge, there in bars_of(run).items() for bar in there]
        self.sources["bars"].data = {
            "edge": [edge_name(*edge) for edge, _ in bars],
            "observer": [edge[0] for edge, _ in bars],
            "left": [bar[0] for _, bar in bars],
            "right": [bar[1] for _, bar in bars],
        }
        self.sources["theta"].data = {"t": run.times[at].tolist(), "theta": run.theta[at].tolist()}
        self.send_controls()

    def send_controls(self) -> None:
        """Send the speeds, or one component of the controls."""
        explorer, run = self.explorer, self.explorer.run
        control = run.control[explorer.sampled]
        values = np.linalg.norm(control, axis=2) if self.component < 0 else control[..., self.component]
        traces = {p: values[:, i].tolist() for i, p in enumerate(explorer.scenario.players)}
        self.sources["controls"].data = {"t": run.times[explorer.sampled].tolist(), **traces}

    def send_instant(self) -> None:
        """Send what stands at the instant shown: players, discs, handles and edges."""
        explorer, sc = self.explorer, self.explorer.scenario
        where, players = explorer.flat(explorer.positions), sc.players
        self.sources["now"].data = {"player": list(players), "x": where[:, 0].tolist(), "y": where[:, 1].tolist()}
        sight = [(p, float(r)) for p, r in zip(sc.constrained, sc.visibility_radii, strict=True) if math.isfinite(r)]
        centres = [where[players.index(p)].tolist() for p, _ in sight]
        self.sources["discs"].data = _discs([p for p, _ in sight], centres, [r for _, r in sight])
        holders = [*players[: sc.n], "attacker"]
        self.sources["capture"].data = _discs(
            holders, [where[players.index(p)].tolist() for p in holders], sc.capture_radii.tolist()
        )
        if self.held is None or self.held[0] != "handles":
            around = enumerate(zip(sight, centres, strict=True))
            rims = [(p, self._rim(i, (x, y), r)) for i, ((p, r), (x, y)) in around]
            seen = [(p, at) for p, at in rims if at is not None]
            self.sources["handles"].data = {
                "player": [p for p, _ in seen], "x": [at[0] for _, at in seen], "y": [at[1] for _, at in seen]
            }  # fmt: skip
        lines = [(where[players.index(p)], where[players.index(q)], p) for p, q in explorer.edges]
        self.sources["sight"].data = {
            "x0": [float(a[0]) for a, _, _ in lines], "y0": [float(a[1]) for a, _, _ in lines],
            "x1": [float(b[0]) for _, b, _ in lines], "y1": [float(b[1]) for _, b, _ in lines],
            "player": [p for _, _, p in lines],
        }  # fmt: skip
        for mark in self.marks:
            mark.location = float(explorer.run.times[explorer.k])

    def nearest(self, x: float, y: float, reach: float) -> tuple[str, str] | None:
        """The start or handle nearest to a point, within reach."""
        found = None
        for kind in ("starts", "handles"):
            data: Any = self.sources[kind].data
            for player, px, py in zip(data["player"], data["x"], data["y"], strict=True):
                away = math.hypot(px - x, py - y)
                if away < reach:
                    reach, found = away, (kind, player)
        return found

    def said(self) -> str:
        """How the game ends, as HTML."""
        run = self.explorer.run
        coarse = f" (a preview in steps of {run.scenario.step:g})" if self.explorer.preview else ""
        return f"<b>{escape(str(run.diverged or run.outcome))}</b>{coarse}"

    def _rim(self, i: int, centre: tuple[float, float], radius: float) -> tuple[float, float] | None:
        """A point of a disc's rim within the picture, None if there is none; ``i`` turns the direction."""
        left, right, bottom, top = self.region
        for angle in 0.6 + i + np.linspace(0.0, 2.0 * np.pi, 36, endpoint=False):
            at = centre[0] + radius * math.cos(angle), centre[1] + radius * math.sin(angle)
            if left < at[0] < right and bottom < at[1] < top:
                return at
        return None


def _discs(players: list[str], centres: list[list[float]], radii: list[float]) -> dict[str, list[Any]]:
    return {"player": players, "x": [c[0] for c in centres], "y": [c[1] for c in centres], "r": radii}
