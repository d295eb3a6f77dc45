"""The keyboard: what is pressed on the page, wherever no field, slider or button has the keys for itself."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from bokeh.models import ColumnDataSource, CustomJS

if TYPE_CHECKING:
    from bokeh.document import Document

STEP, STRIDE = 0.05, 0.5
"""How far an arrow key moves a player, alone and with Shift."""
ARROWS = {"ArrowLeft": (-1, 0), "ArrowRight": (1, 0), "ArrowUp": (0, 1), "ArrowDown": (0, -1)}
HELP = (
    "<b>Drag</b> a player's start, or the rim of its visibility disc (the small diamond). <b>Keys</b>: arrows move "
    f"the chosen player's start by {STEP:g}, with Shift by {STRIDE:g}; <i>n</i> chooses the next player; the space bar "
    "plays and pauses."
)

_LEAVE = """
if (window.tadcore_pointed) {
  let at = document.activeElement;
  while (at?.shadowRoot?.activeElement) at = at.shadowRoot.activeElement;
  at?.blur();
}
"""
_LISTEN = """
let n = 0;
document.addEventListener('pointerdown', () => { window.tadcore_pointed = true; }, true);
document.addEventListener('keydown', () => { window.tadcore_pointed = false; }, true);
document.addEventListener('pointerup', () => setTimeout(() => {
  let at = document.activeElement;
  while (at?.shadowRoot?.activeElement) at = at.shadowRoot.activeElement;
  if (window.tadcore_pointed && at?.matches('button, .noUi-handle')) at.blur();
}), true);
document.addEventListener('keydown', (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || !known.includes(event.key)) return;
  const at = event.composedPath()[0];
  if (at instanceof Element) {
    if (at.matches('input, textarea, select, [role=slider], .noUi-handle') || at.isContentEditable) return;
    if (event.key === ' ' && at.closest('button, [role=button], [tabindex="0"]')) return;
  }
  event.preventDefault();
  source.data = {key: [event.key], shift: [event.shiftKey], n: [n++]};
});
"""


def leave() -> CustomJS:
    """What takes the focus, and with it the keys, from whatever the pointer has just changed; the keyboard keeps it."""
    return CustomJS(code=_LEAVE)


class Keys:
    """Hears the keys of a page; ``pressed`` is called with each, and whether Shift is held."""

    def __init__(self, known: Sequence[str], pressed: Callable[[str, bool], None]) -> None:
        self._known, self._pressed = list(known), pressed
        self.source = ColumnDataSource(data={"key": [], "shift": [], "n": []}, name="keys")
        self.source.on_change("data", lambda attribute, old, new: self._heard(new))

    def listen(self, document: Document) -> None:
        """Hear what is pressed on the page of a document; `source` must be a part of it."""
        code = CustomJS(args={"source": self.source, "known": self._known}, code=_LISTEN)
        document.js_on_event("document_ready", code)

    def _heard(self, data: Any) -> None:
        for key, shift in zip(data["key"], data["shift"], strict=True):
            if key in self._known:
                self._pressed(str(key), bool(shift))
