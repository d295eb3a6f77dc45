"""The page of one scenario: figures, sliders and buttons, and what happens when one of them is used."""

from __future__ import annotations

import base64
import math
from collections.abc import Callable, Mapping
from html import escape
from typing import TYPE_CHECKING

from bokeh.events import Pan, PanEnd, PanStart, RangesUpdate, Reset, Tap
from bokeh.layouts import column, row
from bokeh.models import (
    Button,
    ColumnDataSource,
    CustomJS,
    Div,
    RadioButtonGroup,
    Select,
    Slider,
    TabPanel,
    Tabs,
)

from tadcore.errors import TadcoreError

from .backdrop import Backdrop
from .feed import Feed
from .figures import HISTORY, PLANE, arena, controls, plain, theta, timeline
from .keys import ARROWS, HELP, STEP, STRIDE, leave
from .model import Explorer
from .playback import Playback
from .pointer import Pointer
from .radii import Radii
from .surroundings import Surroundings, tables_of
from .weights import Weights

if TYPE_CHECKING:
    from bokeh.document import Document
    from bokeh.models import LayoutDOM

_GRAB = 0.05  # of the picture: how near the pointer must be to what it grabs
_SIDE = 270  # pixels: the column of sliders

_DOWNLOAD = """
const link = document.createElement('a');
link.href = source.data.href[0];
link.download = source.data.name[0];
link.click();
"""


class Page:
    """The page of one scenario; `Desk` puts it into a Bokeh document."""

    def __init__(self, explorer: Explorer) -> None:
        self.explorer = explorer
        sc = explorer.scenario
        self.feed = Feed(explorer)
        self.sources = self.feed.sources
        self.download = ColumnDataSource(data={"name": [], "href": []})
        self.download.js_on_change("data", CustomJS(args={"source": self.download}, code=_DOWNLOAD))
        self.status = Div(name="status", styles={"font-size": "1.2em"}, min_height=28)
        self.time = Slider(
            start=0.0, end=1.0, value=0.0, step=sc.step, title="time t", format="0.000",
            sizing_mode="stretch_width", max_width=PLANE - 110,
        )  # fmt: skip
        self.planes = RadioButtonGroup(labels=list(explorer.planes), active=0, visible=len(explorer.planes) > 1)
        self.traces = RadioButtonGroup(labels=["speed", *"xyz"[: sc.dim]], active=0)
        names = [(player, plain(player)) for player in sc.players]
        self.chosen = Select(title="chosen player", options=names, value=explorer.chosen, width=110, name="chosen")
        self.pointer = Pointer(self.drag, self.pause)
        self.playback = Playback(self._forward, lambda: self._go_to(0.0))
        self.backdrop = Backdrop(self.feed)
        self._quiet = False
        self.play()
        maps = self.backdrop.sources.values()
        self.arena = arena(self.sources, self.feed.across, self.feed.up, maps)
        first, second, third = self.feed.marks
        self.plots = [
            timeline(self.sources, sc, first), theta(self.sources, second), controls(self.sources, sc, third)
        ]  # fmt: skip
        self.radii = Radii(
            sc,
            lambda player, radius: self._slid(lambda: explorer.see(player, radius)),
            lambda player, radius: self._slid(lambda: explorer.capture(player, radius)),
        )
        self.weights = Weights(sc, explorer.chosen, lambda path, value: self._slid(lambda: explorer.put(path, value)))
        self.around = Surroundings(sc, self._surround)
        self.trial = Slider(start=0, end=99, step=1, value=0, title="trial", width=230, visible=sc.is_random)
        self._listen()
        self.feed.send_instant()

    def attach(self, document: Document) -> None:
        """Become the page of a document, which has clocks."""
        for part in (self.pointer, self.playback, self.backdrop):
            part.document = document

    def close(self) -> None:
        """Leave the document: nothing is played or made any more."""
        self.playback.stop()
        self.backdrop.close()
        for part in (self.pointer, self.playback, self.backdrop):
            part.document = None

    def layout(self) -> LayoutDOM:
        """Everything in its place; columns go below one another where the window is narrow."""
        maps = self.backdrop.switches.values()
        save = row(self._button("Scenario as TOML", self.save_toml), self._button("Figure as PNG", self.save_png))
        wrapped = {"flex-wrap": "wrap"}
        left = column(
            self.status,
            self.planes,
            self.arena,
            row(self.playback.button, self.time, sizing_mode="stretch_width"),
            row(self.chosen, *(column(Div(text="", height=12), switch) for switch in maps), styles=wrapped),
            self.backdrop.said,
            Div(text=HELP, sizing_mode="stretch_width", max_width=PLANE),
            save,
            **_share(PLANE),
        )
        *upper, effort = self.plots
        sliders = Tabs(
            tabs=[
                TabPanel(child=column(*self.radii.rows), title="radii"),
                TabPanel(child=column(*self.weights.rows), title="weights"),
                TabPanel(child=column(self.trial, *self.around.rows), title="links, failures"),
            ],
            width=_SIDE,
        )
        middle = column(*upper, self.traces, effort, **_share(HISTORY))
        return row(left, middle, sliders, sizing_mode="stretch_width", styles=wrapped, name="page")

    def change(self, action: Callable[[], None]) -> bool:
        """Do something that plays the game again; show the new game, or why there is none."""
        try:
            action()
        except TadcoreError as error:
            self.complain(str(error))
            return False
        self.play()
        self.feed.send_instant()
        self.backdrop.update()
        return True

    def complain(self, words: str) -> None:
        """Say what is wrong, above the picture."""
        lines = escape(words, quote=False).replace("\n", "<br>")
        self.status.text = f'<span style="color:#B00020">{lines}</span>'

    def play(self) -> None:
        """Send the run to the browser, and how it ends."""
        self.feed.send_run()
        self.status.text = self.feed.said()
        self._quiet = True
        self.time.end = self.explorer.run.outcome.time or self.explorer.scenario.step
        self.time.value = self.explorer.time
        self._quiet = False

    def grab(self, x: float, y: float) -> None:
        """A drag begins: remember what lies under the pointer."""
        left, right, bottom, top = self.feed.region
        self.feed.held = self.feed.nearest(x, y, _GRAB * max(right - left, top - bottom))
        if self.feed.held is not None and self.feed.held[0] == "starts":
            self.chosen.value = self.feed.held[1]

    def drag(self, x: float, y: float) -> None:
        """The pointer moves with something held: play the game as it would be."""
        if self.feed.held is not None:
            kind, player = self.feed.held
            act = self.explorer.move if kind == "starts" else self.explorer.stretch
            self.change(lambda: act(player, round(x, 4), round(y, 4), preview=True))

    def pause(self) -> None:
        """The pointer pauses: play the game itself, of which only a preview is seen."""
        if self.explorer.preview:
            self.change(self.explorer.settle)

    def drop(self) -> None:
        """A drag ends: put everything where it belongs."""
        self.pointer.follow()
        self.feed.held = None
        self.explorer.settle()
        self.play()
        self.feed.send_instant()
        self.radii.show(self.explorer.scenario)
        self.backdrop.update()

    def press(self, key: str, shift: bool) -> None:
        """A key: move the chosen player, choose the next, play or pause."""
        if key in ARROWS:
            across, up = ((STRIDE if shift else STEP) * part for part in ARROWS[key])
            self.change(lambda: self.explorer.nudge(across, up, preview=True))
            self.pointer.rest()
        elif key == "n":
            players = self.explorer.scenario.players
            self.chosen.value = players[(players.index(self.explorer.chosen) + 1) % len(players)]
        else:
            self.playback.toggle()

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
        self.arena.on_event(Tap, lambda event: self._tap(event.x, event.y))
        for zoomed in (RangesUpdate, Reset):
            self.arena.on_event(zoomed, lambda event: self.backdrop.update())
        self.time.on_change("value", lambda attribute, old, new: self._scrub(new))
        self.planes.on_change("active", lambda attribute, old, new: self._project(self.planes.labels[new]))
        self.traces.on_change("active", lambda attribute, old, new: self._trace(new - 1))
        self.chosen.js_on_change("value", leave())
        self.chosen.on_change("value", lambda attribute, old, new: self._choose(new))
        self.trial.on_change("value", lambda attribute, old, new: self._draw(int(new)))

    def _tap(self, x: float, y: float) -> None:
        self.grab(x, y)
        self.feed.held = None

    def _choose(self, player: str) -> None:
        self.explorer.choose(player)
        self.weights.choose(self.explorer.scenario, player)
        self.feed.send_run()
        self.backdrop.update()

    def _project(self, plane: str) -> None:
        self.explorer.project(plane)
        self.arena.xaxis.axis_label, self.arena.yaxis.axis_label = plane[0], plane[1]
        self.play()
        self.feed.fit()
        self.feed.send_instant()
        self.backdrop.update()

    def _trace(self, component: int) -> None:
        self.feed.component = component
        self.feed.send_controls()

    def _scrub(self, time: float) -> None:
        if not self._quiet:
            self.explorer.look_at(time)
            self.feed.send_instant()

    def _go_to(self, time: float) -> None:
        self.explorer.look_at(time)
        self._quiet = True
        self.time.value = self.explorer.time
        self._quiet = False
        self.feed.send_instant()

    def _forward(self, share: float) -> bool:
        """Show a later instant, by a share of the run; whether there is more."""
        end = self.explorer.run.outcome.time
        self._go_to(min(self.explorer.time + share * end, end))
        return self.explorer.time < end and not math.isclose(self.explorer.time, end)

    def _surround(self, values: Mapping[str, float]) -> None:
        sc = self.explorer.scenario
        if not self.change(lambda: self.explorer.surround(tables_of(sc, values))):
            self.around.show(sc)
        self.trial.visible = self.explorer.scenario.is_random

    def _draw(self, trial: int) -> None:
        if not self.change(lambda: self.explorer.draw(trial)):
            self.trial.value = self.explorer.trial

    def _slid(self, action: Callable[[], None]) -> None:
        """Do what a slider says; one whose value is refused goes back to what is played."""
        if not self.change(action):
            self.radii.show(self.explorer.scenario)
            self.weights.show(self.explorer.scenario)

    def _button(self, label: str, action: Callable[[], None]) -> Button:
        button = Button(label=label, width=160, tags=[self.download])  # so that the source is part of the document
        button.on_click(lambda event: action())
        return button


def _share(width: int) -> dict[str, object]:
    """Of a column: as wide as the window lets it be, up to a width, below which the next goes underneath."""
    return {"sizing_mode": "stretch_width", "max_width": width, "min_width": min(width, 300),
            "styles": {"flex": f"1 1 {width}px"}}  # fmt: skip
