"""The whole of what a visitor sees: the choice of a scenario, and the page of the one that is chosen."""

from __future__ import annotations

import base64
import binascii
from typing import TYPE_CHECKING

from bokeh.layouts import column, row
from bokeh.models import FileInput, Select

from tadcore import scenarios
from tadcore.errors import ScenarioError, TadcoreError
from tadcore.scenario.model import Scenario

from .keys import ARROWS, Keys, leave
from .model import Explorer
from .page import Page

if TYPE_CHECKING:
    from bokeh.document import Document

_LARGEST = 1_000_000  # bytes of a scenario's file
_GIVEN = "(as given)"


class Desk:
    """The explorer; `add_to` puts it into a Bokeh document.

    Attributes
    ----------
    page : Page
        That of the scenario that is chosen.
    """

    def __init__(self, explorer: Explorer) -> None:
        self.page = Page(explorer)
        bundled = [(name, name) for name in scenarios.names()]
        first = next((name for name in scenarios.names() if scenarios.load(name) == explorer.scenario), _GIVEN)
        self.names = Select(
            title="scenario", value=first, width=210, name="scenario",
            options=[*([] if first != _GIVEN else [(_GIVEN, _GIVEN)]), *bundled],
        )  # fmt: skip
        self.file = FileInput(accept=".toml", title="or a file (.toml)", width=230, name="file")
        self.keys = Keys([*ARROWS, "n", " "], lambda key, shift: self.page.press(key, shift))
        self.names.js_on_change("value", leave())
        self.names.on_change("value", lambda attribute, old, new: self._named(str(new)))
        self.file.on_change("value", lambda attribute, old, new: self._sent())
        self.document: Document | None = None
        self._given, self._shown, self._quiet = explorer.scenario, first, False
        self._head = row(self.names, self.file, styles={"flex-wrap": "wrap"}, tags=[self.keys.source])
        self._root = column(self._head, self.page.layout(), sizing_mode="stretch_width")

    def add_to(self, document: Document) -> None:
        """Put everything into a document."""
        document.title = "tadcore explorer"
        self.document = document
        self.page.attach(document)
        self.keys.listen(document)
        document.on_session_destroyed(lambda context: self.page.close())
        document.add_root(self._root)

    def show(self, sc: Scenario) -> None:
        """Show the page of another scenario; raises where its game has no equilibrium, and the page stays."""
        page = Page(Explorer(sc))
        self.page.close()
        self.page = page
        if self.document is not None:
            page.attach(self.document)
        self._root.children = [self._head, page.layout()]

    def _named(self, name: str) -> None:
        if self._quiet:
            return
        try:
            self.show(self._given if name == _GIVEN else scenarios.load(name))
            self._shown = name
        except TadcoreError as error:
            self.page.complain(str(error))
            self._select(self._shown)

    def _sent(self) -> None:
        """A file was sent, whose name comes after what it holds."""
        if self.document is not None and self.file.value:
            self.document.add_next_tick_callback(self._take)

    def _take(self) -> None:
        self.read(str(self.file.filename), str(self.file.value))
        self.file.clear()  # so that the same file, mended, can be sent again

    def read(self, name: str, value: str) -> None:
        """Show the scenario of a file that was sent in base 64, or say what is wrong with it."""
        try:
            sc = Scenario.from_toml_string(_text(name, value), name=name)
            self.show(sc)
        except TadcoreError as error:
            self.page.complain(str(error))
            return
        self._given = sc
        self.names.options = [(_GIVEN, name), *((each, each) for each in scenarios.names())]
        self._shown = _GIVEN
        self._select(_GIVEN)

    def _select(self, name: str) -> None:
        self._quiet = True
        self.names.value = name
        self._quiet = False


def _text(name: str, value: str) -> str:
    """What a file says that the browser sent in base 64."""
    try:
        data = base64.b64decode(value, validate=True)
        if len(data) > _LARGEST:
            raise ScenarioError(name, f"{len(data):,} bytes", f"a scenario of at most {_LARGEST:,} bytes")
        return data.decode("utf-8")
    except (binascii.Error, UnicodeDecodeError):
        raise ScenarioError(name, "something else", "a text in UTF-8") from None
