"""Radii by number: ζ with a switch for unlimited sight, σ."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from bokeh.layouts import row
from bokeh.models import Slider, Toggle

from .figures import plain
from .surroundings import show_value

if TYPE_CHECKING:
    from bokeh.models import LayoutDOM

    from tadcore.scenario.model import Scenario

_LEAST, _MOST = 0.05, 10.0  # ends of a visibility slider
_SMALL, _LARGE = 0.01, 0.6  # of one of a capture radius


class Radii:
    """The sliders; ``see`` and ``capture`` are called with a player and its new radius."""

    def __init__(self, sc: Scenario, see: Callable[[str, float], None], capture: Callable[[str, float], None]) -> None:
        self._see, self._capture, self._quiet = see, capture, False
        self.zeta: dict[str, tuple[Slider, Toggle]] = {}
        self.sigma: dict[str, Slider] = {}
        for player in sc.constrained:
            slider = Slider(start=_LEAST, end=_MOST, step=0.05, value=1.0, title=f"ζ of {plain(player)}", width=190)
            switch = Toggle(label="∞", width=40, align="end")
            slider.on_change("value", lambda a, old, new, p=player: self._moved(p))
            switch.on_change("active", lambda a, old, new, p=player: self._moved(p))
            self.zeta[player] = slider, switch
        for player in _armed(sc):
            slider = Slider(start=_SMALL, end=_LARGE, step=0.01, value=0.1, title=f"σ of {plain(player)}", width=230)
            slider.on_change("value", lambda a, old, new, p=player: self._changed(p, new))
            self.sigma[player] = slider
        self.show(sc)

    @property
    def rows(self) -> list[LayoutDOM]:
        """The sliders, those of sight each with its switch."""
        return [*(row(slider, switch) for slider, switch in self.zeta.values()), *self.sigma.values()]

    def show(self, sc: Scenario) -> None:
        """Bring the sliders to what a scenario says."""
        self._quiet = True
        for player, radius in zip(sc.constrained, map(float, sc.visibility_radii), strict=True):
            slider, switch = self.zeta[player]
            switch.active = math.isinf(radius)
            show_value(slider, not switch.active)
            if not switch.active:
                slider.update(start=min(_LEAST, radius), end=max(_MOST, radius), value=radius)
        for player, radius in zip(_armed(sc), map(float, sc.capture_radii), strict=True):
            self.sigma[player].update(start=min(_SMALL, radius), end=max(_LARGE, radius), value=radius)
        self._quiet = False

    def _moved(self, player: str) -> None:
        if not self._quiet:
            slider, switch = self.zeta[player]
            show_value(slider, not switch.active)
            self._see(player, math.inf if switch.active else float(slider.value))

    def _changed(self, player: str, radius: float) -> None:
        if not self._quiet:
            self._capture(player, radius)


def _armed(sc: Scenario) -> tuple[str, ...]:
    """Who has a capture radius."""
    return (*sc.players[: sc.n], "attacker")
