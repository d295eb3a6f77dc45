"""Maps behind the plane: how the game ends by the start of the chosen player, sampled, and proved where it can be."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from html import escape
from typing import TYPE_CHECKING

from bokeh.models import ColumnDataSource, Div, Toggle
from matplotlib.colors import to_hex

from tadcore import _core
from tadcore.errors import TadcoreError
from tadcore.plotting.tools.outcomes import outcome_look
from tadcore.scenario.model import Scenario
from tadcore.statistics.outcomes import is_defender

from .feed import Feed
from .figures import plain
from .painting import Picture, Region, proved, sampled
from .work import Work

if TYPE_CHECKING:
    from bokeh.document import Document

_KINDS = ("sampled", "proved")
_MAKERS: dict[str, Callable[[Scenario, str, Region, _core.Stop], Iterator[Picture]]] = {
    "sampled": sampled,
    "proved": proved,
}
_ALPHA = {"sampled": 0.4, "proved": 0.75}
_UNDECIDED = ("#404040", 0.55)
_EMPTY: dict[str, list[object]] = {"image": [], "x": [], "y": [], "dw": [], "dh": []}


class Backdrop:
    """Two switches, and the pictures behind the plane; `update` after everything that may change them.

    A map depends on everything but where the chosen player starts in the plane: moved over its own map, it stays.
    """

    def __init__(self, feed: Feed) -> None:
        self.feed = feed
        self.sources = {kind: ColumnDataSource(data=dict(_EMPTY)) for kind in _KINDS}
        labels = {"sampled": "outcome map", "proved": "certified map"}
        self.switches = {kind: Toggle(label=labels[kind], width=130, name=kind) for kind in _KINDS}
        for switch in self.switches.values():
            switch.on_change("active", lambda attribute, old, new: self.update())
        self.said = Div(name="map", text="")
        self.document: Document | None = None
        self._of: dict[str, object] = dict.fromkeys(_KINDS)
        self._work: dict[str, Work[Picture]] = {}
        self._notes: dict[str, str] = dict.fromkeys(_KINDS, "")
        self._named: dict[str, list[str]] = {kind: [] for kind in _KINDS}

    def update(self) -> None:
        """Make what is asked for and not there, and drop what is no longer right."""
        for kind in _KINDS:
            wanted = self._key() if self.switches[kind].active else None
            if wanted != self._of[kind]:
                self._drop(kind)
                self._of[kind] = wanted
                if wanted is not None:
                    self._begin(kind)
        self._say()

    def close(self) -> None:
        """Stop whatever is being made."""
        for work in self._work.values():
            work.stop()

    def _key(self) -> object:
        """All that a map depends on."""
        explorer = self.feed.explorer
        sc, who = explorer.scenario, explorer.chosen
        others = sc.positions.copy()
        others[sc.players.index(who), :2] = 0.0
        return (
            who,
            explorer.plane,
            self.feed.region,
            sc.replace({f"{who}.position": tuple(others[sc.players.index(who)])}),
        )

    def _begin(self, kind: str) -> None:
        explorer, region = self.feed.explorer, self.feed.region
        if explorer.plane != (0, 1):
            self._notes[kind] = "a map is over x and y: choose the plane xy"
            return
        if self.document is None:
            return
        sc, who, make = explorer.scenario, explorer.chosen, _MAKERS[kind]
        self._notes[kind] = "…"
        self._work[kind] = Work(
            lambda stop: make(sc, who, region, stop),
            lambda picture: self._show(kind, picture, region),
            lambda error: self._fail(kind, error),
            self.document.add_next_tick_callback,
        )

    def _drop(self, kind: str) -> None:
        if kind in self._work:
            self._work.pop(kind).stop()
        self._notes[kind], self._named[kind] = "", []
        self.sources[kind].data = dict(_EMPTY)

    def _show(self, kind: str, picture: Picture, region: Region) -> None:
        left, right, bottom, top = region
        rgba = picture.rgba(_ALPHA[kind], _UNDECIDED)
        self.sources[kind].data = {
            "image": [rgba], "x": [left], "y": [bottom], "dw": [right - left], "dh": [top - bottom]
        }  # fmt: skip
        self._named[kind] = picture.there
        done = picture.share >= 1.0
        if kind == "proved":
            share = float((picture.codes >= 0).mean())
            self._notes[kind] = f"proved: {100.0 * share:.1f} % of the area{'' if done else ' so far'}"
        else:
            self._notes[kind] = "" if done else f"{100.0 * picture.share:.0f} % …"
        self._say()

    def _fail(self, kind: str, error: TadcoreError) -> None:
        self._notes[kind] = f'<span style="color:#B00020">{escape(str(error), quote=False)}</span>'
        self._say()

    def _say(self) -> None:
        """Whose map it is, what its colours are, and how far it is."""
        if not any(switch.active for switch in self.switches.values()):
            self.said.text = ""
            return
        names = list(dict.fromkeys(name for kind in _KINDS for name in self._named[kind]))
        entries = [_entry(name) for name in names]
        notes = [note for note in self._notes.values() if note]
        who = plain(self.feed.explorer.chosen)
        self.said.text = f"by the start of {who}: {'&ensp;'.join([*entries, *notes])}"


def _entry(name: str) -> str:
    """An outcome with its colour."""
    words = f"by {plain(name)}" if is_defender(name) else name
    return f'<span style="color:{to_hex(outcome_look(name).fill)};-webkit-text-stroke:1px #555">■</span> {words}'
