"""Sliders of what surrounds a game: the radius of links, and the mean times of sensors, single edges and links.

They hold for all players: they are the common tables of the scenario. A player's own table still goes before them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from bokeh.layouts import row
from bokeh.models import Slider, Toggle

if TYPE_CHECKING:
    from bokeh.models import LayoutDOM

    from tadcore.scenario.model import Scenario

RADIUS = "communication.radius"
_CHAINS = (
    ("sensing.mean_time_to_failure", "sensing.mean_time_to_repair"),
    ("sensing.mean_time_detected", "sensing.mean_time_missed"),
    ("communication.mean_time_up", "communication.mean_time_down"),
)
_MOST, _LEAST = 10.0, 0.01
_TITLES = {
    RADIUS: "ρ of links (0: none)",
    "sensing.mean_time_to_failure": "sensor works (∞: always)",
    "sensing.mean_time_to_repair": "sensor failed (∞: for good)",
    "sensing.mean_time_detected": "edge detected (∞: always)",
    "sensing.mean_time_missed": "edge missed (∞: for good)",
    "communication.mean_time_up": "link up (∞: always)",
    "communication.mean_time_down": "link down (∞: for good)",
}


def surroundings_of(sc: Scenario) -> dict[str, float]:
    """The common radius of links, 0 for none, and the common mean times, inf where none is given."""
    values = {}
    for path in _TITLES:
        table, name = path.split(".")
        found = getattr(getattr(sc, table), name, None)
        values[path] = float(found) if found is not None else 0.0 if path == RADIUS else math.inf
    return values


def tables_of(sc: Scenario, values: Mapping[str, float]) -> dict[str, dict[str, Any] | None]:
    """The common tables with these values; what would do nothing is left out, and a table without anything."""
    found: dict[str, dict[str, Any]] = {"sensing": {}, "communication": {}}
    if values[RADIUS] > 0.0:
        found["communication"]["radius"] = values[RADIUS]
    for first, then in _CHAINS:
        table, name = first.split(".")
        if math.isfinite(values[first]) and (table == "sensing" or values[RADIUS] > 0.0):
            found[table][name] = values[first]
            if math.isfinite(values[then]):
                found[table][then.split(".")[1]] = values[then]
    for table, fields in found.items():
        given = getattr(sc, table)
        kept = {} if given is None or not fields else given.model_dump(exclude_none=True)
        others = ("relays", "frame") + (("begin",) if any(name.startswith("mean") for name in fields) else ())
        fields.update({name: kept[name] for name in others if name in kept})
    return {table: fields or None for table, fields in found.items()}


def show_value(slider: Slider, there: bool) -> None:
    """Let a slider stand for a number, or, where a switch says ∞, for none."""
    slider.disabled, slider.show_value = not there, there


class Surroundings:
    """The sliders; ``changed`` is called with all values when one of them is moved."""

    def __init__(self, sc: Scenario, changed: Callable[[Mapping[str, float]], None]) -> None:
        self._changed, self._quiet = changed, False
        self.sliders: dict[str, tuple[Slider, Toggle]] = {}
        alone = len(sc.constrained) == 1  # has nobody to talk to
        for path in (path for path in _TITLES if not (alone and path.startswith("communication"))):
            least = 0.0 if path == RADIUS else _LEAST
            slider = Slider(start=least, end=_MOST, step=0.01, value=1.0, title=_TITLES[path], width=190)
            switch = Toggle(label="∞", width=40, align="end")
            slider.on_change("value", lambda a, old, new: self._moved())
            switch.on_change("active", lambda a, old, new: self._moved())
            self.sliders[path] = slider, switch
        self.show(sc)

    @property
    def rows(self) -> list[LayoutDOM]:
        """The sliders, each with its switch."""
        return [row(slider, switch) for slider, switch in self.sliders.values()]

    def show(self, sc: Scenario) -> None:
        """Bring the sliders to what a scenario says."""
        self._quiet = True
        for path, value in surroundings_of(sc).items():
            if path in self.sliders:
                slider, switch = self.sliders[path]
                switch.active = math.isinf(value)
                show_value(slider, not switch.active)
                if math.isfinite(value):
                    slider.update(start=min(slider.start, value), end=max(slider.end, value), value=value)
        self._quiet = False

    def _moved(self) -> None:
        if self._quiet:
            return
        values = {path: 0.0 if path == RADIUS else math.inf for path in _TITLES}
        for path, (slider, switch) in self.sliders.items():
            show_value(slider, not switch.active)
            values[path] = math.inf if switch.active else float(slider.value)
        self._changed(values)
