"""The page: figures, sliders and buttons around an `Explorer`, and what happens when one of them is used."""

from __future__ import annotations

import base64
import math
from collections.abc import Callable, Mapping
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from bokeh.events import Pan, PanEnd, PanStart
from bokeh.layouts import column, row
from bokeh.models import Button, ColumnDataSource, CustomJS, Div, RadioButtonGroup, Slider, Toggle

from tadcore.errors import TadcoreError
from tadcore.plotting.run.raster import bars_of

from .figures import arena, controls, edge_name, frame, instant, plain, theta, timeline
from .model import Explorer
from .pointer import Pointer
from .surroundings import Surroundings, tables_of

if TYPE_CHECKING:
    from bokeh.document import Document
    from bokeh.models import LayoutDOM


_LEAST = 0.05
_UNLIMITED = 10.0  # the right end of a visibility slider
_GRAB = 0.05  # of the picture: how near the pointer must be to what it grabs

_DOWNLOAD = """
const link = document.createElement('a');
link.href = source.data.href[0];
link.download = source.data.name[0];
link.click();
"""


class Page:
    """The explorer's page; `add_to` puts it into a Bokeh document."""

    def __init__(self, explorer: Explorer) -> None:
        self.explorer = explorer
        names = ("starts", "handles", "now", "paths", "discs", "capture", "sight", "bars", "theta", "controls")
        self.sources = {name: ColumnDataSource() for name in names}
        self.download = ColumnDataSource(data={"name": [], "href": []})
        self.download.js_on_change("data", CustomJS(args={"source": self.download}, code=_DOWNLOAD))
        self.status = Div(name="status", styles={"font-size": "1.2em"}, min_height=28)
        step = explorer.scenario.step
        self.time = Slider(start=0.0, end=1.0, value=0.0, step=step, title="time t", format="0.000", width=560)
        self.planes = RadioButtonGroup(labels=list(explorer.planes), active=0, visible=len(explorer.planes) > 1)
        self.traces = RadioButtonGroup(labels=["speed", *"xyz"[: explorer.scenario.dim]], active=0)
        self._grabbed: tuple[str, str] | None = None
        self.pointer = Pointer(self.drag, self.pause)
        self._quiet = False
        self.play()
        self.arena = arena(self.sources)
        self.marks = [instant() for _ in range(3)]
        self.plots = [
            timeline(self.sources, explorer.scenario, self.marks[0]),
            theta(self.sources, self.marks[1]),
            controls(self.sources, explorer.scenario, self.marks[2]),
        ]
        self._sliders = self._make_sliders()
        self._around = Surroundings(explorer.scenario, self._surround)
        self.trial = Slider(
            start=0, end=99, step=1, value=0, title="trial", width=230, visible=explorer.scenario.is_random
        )
        self.trial.on_change("value", lambda attribute, old, new: self._draw(int(new)))
        self._listen()
        self.show_instant()

    def add_to(self, document: Document) -> None:
        """Put the page into a document."""
        document.title = "tadcore explorer"
        self.pointer.document = document
        document.add_root(self.layout())

    def layout(self) -> LayoutDOM:
        """Everything in its place."""
        save = row(self._button("Scenario as TOML", self.save_toml), self._button("Figure as PNG", self.save_png))
        hint = Div(text="Drag a player's start, or the rim of its visibility disc (the small diamond).")
        left = column(self.status, self.planes, self.arena, self.time, hint, save)
        *upper, effort = self.plots
        return row(left, column(*upper, self.traces, effort), column(*self._sliders, self.trial, *self._around.rows))

    def change(self, action: Callable[[], None]) -> bool:
        """Do something that plays the game again; show the new game, or why there is none."""
        try:
            action()
        except TadcoreError as error:
            lines = escape(str(error), quote=False).replace("\n", "<br>")
            self.status.text = f'<span style="color:#B00020">{lines}</span>'
            return False
        self.play()
        self.show_instant()
        return True

    def play(self) -> None:
        """Send the run to the browser: everything that does not depend on the instant."""
        explorer, run = self.explorer, self.explorer.run
        players, at = explorer.scenario.players, explorer.sampled
        times = run.times[at].tolist()
        self.sources["paths"].data = {
            "player": list(players),
            "x": [run.position[at, p, explorer.plane[0]].tolist() for p in range(len(players))],
            "y": [run.position[at, p, explorer.plane[1]].tolist() for p in range(len(players))],
        }
        if self._grabbed is None or self._grabbed[0] != "starts":  # the browser moves what it drags
            x, y = explorer.flat(explorer.scenario.positions).T.tolist()
            self.sources["starts"].data = {
                "player": list(players), "x": x, "y": y, "name": [plain(p) for p in players]
            }  # fmt: skip
        bars = [(edge, bar) for edge, there in bars_of(run).items() for bar in there]
        self.sources["bars"].data = {
            "edge": [edge_name(*edge) for edge, _ in bars],
            "observer": [edge[0] for edge, _ in bars],
            "left": [bar[0] for _, bar in bars],
            "right": [bar[1] for _, bar in bars],
        }
        self.sources["theta"].data = {"t": times, "theta": run.theta[at].tolist()}
        self._trace()
        said = f" (a preview in steps of {run.scenario.step:g})" if explorer.preview else ""
        self.status.text = f"<b>{escape(str(run.diverged or run.outcome))}</b>{said}"
        self._quiet = True
        self.time.end = run.outcome.time or explorer.scenario.step
        self.time.value = explorer.time
        self._quiet = False

    def show_instant(self) -> None:
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
        if self._grabbed is None or self._grabbed[0] != "handles":
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

    def grab(self, x: float, y: float) -> None:
        """A drag begins: remember what lies under the pointer."""
        self._grabbed = None
        reach = _GRAB * max(self._span())
        for kind in ("starts", "handles"):
            data: Any = self.sources[kind].data
            for player, px, py in zip(data["player"], data["x"], data["y"], strict=True):
                away = math.hypot(px - x, py - y)
                if away < reach:
                    reach, self._grabbed = away, (kind, player)

    def drag(self, x: float, y: float) -> None:
        """The pointer moves with something held: play the game as it would be."""
        if self._grabbed is not None:
            kind, player = self._grabbed
            act = self.explorer.move if kind == "starts" else self.explorer.stretch
            self.change(lambda: act(player, round(x, 4), round(y, 4), preview=True))

    def pause(self) -> None:
        """The pointer pauses: play the game itself, of which only a preview is seen."""
        if self.explorer.preview:
            self.change(self.explorer.settle)

    def drop(self) -> None:
        """A drag ends: put everything where it belongs."""
        self.pointer.follow()
        self._grabbed = None
        self.explorer.settle()
        self.play()
        self.show_instant()
        self._set_sliders()

    def save_toml(self) -> None:
        """Send the scenario to the browser as a file."""
        self._send("scenario.toml", "application/toml", self.explorer.toml().encode())

    def save_png(self) -> None:
        """Send the figure to the browser as a file."""
        self._send("trajectories.png", "image/png", self.explorer.png())

    def _send(self, name: str, kind: str, data: bytes) -> None:
        href = f"data:{kind};base64,{base64.b64encode(data).decode()}"
        self.download.data = {"name": [name], "href": [href]}

    def _listen(self) -> None:
        self.arena.on_event(PanStart, lambda event: self.grab(event.x, event.y))
        self.arena.on_event(Pan, lambda event: self.pointer.moved(event.x, event.y))
        self.arena.on_event(PanEnd, lambda event: self.drop())
        self.time.on_change("value", lambda attribute, old, new: self._scrub(new))
        self.planes.on_change("active", lambda attribute, old, new: self._project(self.planes.labels[new]))
        self.traces.on_change("active", lambda attribute, old, new: self._trace())

    def _project(self, plane: str) -> None:
        self.explorer.project(plane)
        self.arena.xaxis.axis_label, self.arena.yaxis.axis_label = plane[0], plane[1]
        self.play()
        left, right, bottom, top = frame(self.sources)
        self.arena.x_range.update(start=left, end=right)
        self.arena.y_range.update(start=bottom, end=top)
        self.show_instant()

    def _trace(self) -> None:
        """Send the speeds, or one component of the controls."""
        explorer, run, which = self.explorer, self.explorer.run, self.traces.active - 1
        control = run.control[explorer.sampled]
        values = np.linalg.norm(control, axis=2) if which < 0 else control[..., which]
        traces = {p: values[:, i].tolist() for i, p in enumerate(explorer.scenario.players)}
        self.sources["controls"].data = {"t": run.times[explorer.sampled].tolist(), **traces}

    def _scrub(self, time: float) -> None:
        if not self._quiet:
            self.explorer.look_at(time)
            self.show_instant()

    def _make_sliders(self) -> list[LayoutDOM]:
        """Radii by number: ζ with a switch for unlimited sight, σ."""
        sc = self.explorer.scenario
        self._zeta: dict[str, tuple[Slider, Toggle]] = {}
        rows: list[LayoutDOM] = []
        for player in sc.constrained:
            slider = Slider(start=_LEAST, end=_UNLIMITED, step=0.05, value=1.0, title=f"ζ of {player}", width=190)
            switch = Toggle(label="∞", width=40, align="end")
            slider.on_change("value", lambda a, old, new, p=player: self._slide_sight(p))
            switch.on_change("active", lambda a, old, new, p=player: self._slide_sight(p))
            self._zeta[player] = (slider, switch)
            rows.append(row(slider, switch))
        self._sigma: dict[str, Slider] = {}
        for player in (*sc.players[: sc.n], "attacker"):
            slider = Slider(start=0.01, end=0.6, step=0.01, value=0.1, title=f"σ of {player}", width=230)
            slider.on_change("value", lambda a, old, new, p=player: self._slide_capture(p, new))
            self._sigma[player] = slider
            rows.append(slider)
        self._set_sliders()
        return rows

    def _set_sliders(self) -> None:
        """Bring the sliders to what the scenario says."""
        sc = self.explorer.scenario
        self._quiet = True
        for player, radius in zip(sc.constrained, sc.visibility_radii, strict=True):
            slider, switch = self._zeta[player]
            switch.active = math.isinf(radius)
            slider.disabled = switch.active
            if not switch.active:
                reach = {"start": min(_LEAST, float(radius)), "end": max(_UNLIMITED, float(radius))}
                slider.update(**reach, value=float(radius))
        for player, radius in zip((*sc.players[: sc.n], "attacker"), sc.capture_radii, strict=True):
            self._sigma[player].update(start=min(0.01, float(radius)), end=max(0.6, float(radius)), value=float(radius))
        self._quiet = False

    def _slide_sight(self, player: str) -> None:
        if not self._quiet:
            slider, switch = self._zeta[player]
            slider.disabled = bool(switch.active)
            self._slid(lambda: self.explorer.see(player, math.inf if switch.active else float(slider.value)))

    def _slide_capture(self, player: str, radius: float) -> None:
        if not self._quiet:
            self._slid(lambda: self.explorer.capture(player, radius))

    def _surround(self, values: Mapping[str, float]) -> None:
        sc = self.explorer.scenario
        if not self.change(lambda: self.explorer.surround(tables_of(sc, values))):
            self._around.show(sc)
        self.trial.visible = self.explorer.scenario.is_random

    def _draw(self, trial: int) -> None:
        if not self.change(lambda: self.explorer.draw(trial)):
            self.trial.value = self.explorer.trial

    def _slid(self, action: Callable[[], None]) -> None:
        """Do what a slider says; one whose value is refused goes back to what is played."""
        if not self.change(action):
            self._set_sliders()

    def _button(self, label: str, action: Callable[[], None]) -> Button:
        button = Button(label=label, width=160, tags=[self.download])  # so that the source is part of the document
        button.on_click(lambda event: action())
        return button

    def _rim(self, i: int, centre: tuple[float, float], radius: float) -> tuple[float, float] | None:
        """Return a point of a disc's rim within the picture, None if there is none; ``i`` turns the direction."""
        across, up = self.arena.x_range, self.arena.y_range
        for angle in 0.6 + i + np.linspace(0.0, 2.0 * np.pi, 36, endpoint=False):
            at = centre[0] + radius * math.cos(angle), centre[1] + radius * math.sin(angle)
            if across.start < at[0] < across.end and up.start < at[1] < up.end:
                return at
        return None

    def _span(self) -> tuple[float, float]:
        x, y = self.arena.x_range, self.arena.y_range
        return float(x.end - x.start), float(y.end - y.start)


def _discs(players: list[str], centres: list[list[float]], radii: list[float]) -> dict[str, list[Any]]:
    return {"player": players, "x": [c[0] for c in centres], "y": [c[1] for c in centres], "r": radii}
