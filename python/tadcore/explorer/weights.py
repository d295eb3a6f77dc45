"""Sliders of what makes another game: the horizon, the weights of one player, λ, and γ of the synthesis."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from bokeh.layouts import column
from bokeh.models import Div, Slider

from .figures import plain

if TYPE_CHECKING:
    from bokeh.models import LayoutDOM

    from tadcore.scenario.model import Scenario

_LIGHT, _HEAVY = 0.05, 5.0  # ends of the slider of a weight
_LONGEST, _FINE = 10.0, 0.1  # of the horizon, and about the least change of it
_GAMMA = "synthesis_weights"


class Weights:
    """The sliders; ``changed`` is called with the path of a field and its new value."""

    def __init__(self, sc: Scenario, player: str, changed: Callable[[str, object], None]) -> None:
        self._changed, self._quiet, self._sc = changed, False, sc
        coarse = sc.step * max(1, round(_FINE / sc.step))
        self.horizon = Slider(start=coarse, end=_LONGEST, step=coarse, value=1.0, title="T · horizon", width=230)
        self.horizon.on_change("value", lambda a, old, new: self._moved("horizon", self._on_grid(float(new))))
        self.gamma = [
            Slider(start=0.0, end=1.0, step=0.05, value=0.5, title=f"γ{'₁₂₃₄'[i]} · synthesis", width=230)
            for i in range(len(sc.synthesis_weights))
        ]
        for slider in self.gamma:
            slider.on_change("value", lambda a, old, new: self._moved(_GAMMA, self._gammas()))
        self.fields: dict[str, Slider] = {}
        self._whose = Div()
        self._place = column()
        self.choose(sc, player)

    @property
    def rows(self) -> list[LayoutDOM]:
        """The sliders: the horizon, those of the chosen player, those of the synthesis."""
        return [self.horizon, self._whose, self._place, Div(text="<b>all players</b>"), *self.gamma]

    def choose(self, sc: Scenario, player: str) -> None:
        """Show the weights of another player."""
        self._sc, self._player = sc, player
        self._whose.text = f"<b>weights of {plain(player)}</b>, the chosen player"
        self.fields = {f"{player}.{name}": _slider(part) for name, part in _weights_of(sc, player).items()}
        for path, slider in self.fields.items():
            slider.on_change("value", lambda a, old, new, p=path: self._moved(p, float(new)))
        self.show(sc)
        self._place.children = list(self.fields.values())

    def show(self, sc: Scenario) -> None:
        """Bring the sliders to what a scenario says."""
        self._sc, self._quiet = sc, True
        self.horizon.update(end=max(_LONGEST, sc.horizon), start=min(self.horizon.start, sc.horizon), value=sc.horizon)
        for slider, value in zip(self.gamma, sc.synthesis_weights, strict=True):
            slider.value = value
        owner = _owner(sc, self._player)
        for path, slider in self.fields.items():
            value = getattr(owner, path.rpartition(".")[2])
            slider.update(start=min(slider.start, value), end=max(slider.end, value), value=value)
        self._quiet = False

    def _gammas(self) -> tuple[float, ...]:
        return tuple(float(slider.value) for slider in self.gamma)

    def _on_grid(self, horizon: float) -> float:
        """The nearest horizon that the step divides, at least one step."""
        return max(1, round(horizon / self._sc.step)) * self._sc.step

    def _moved(self, path: str, value: object) -> None:
        if not self._quiet:
            self._changed(path, value)


def _owner(sc: Scenario, player: str) -> Any:
    """The table of a player."""
    return sc.defenders[sc.players.index(player)] if player in sc.players[: sc.n] else getattr(sc, player)


def _weights_of(sc: Scenario, player: str) -> dict[str, tuple[str, bool]]:
    """The weights of a player that its game has: the title of each, and whether it lies in [0, 1]."""
    table = type(_owner(sc, player))
    found = {}
    for name, field in table.model_fields.items():
        fraction = name == "evasion"
        if (fraction or name.endswith("_weight")) and table.belongs.get(name, sc.interaction) == sc.interaction:
            symbol = str(field.description).partition(":" if fraction else ",")[0]
            found[name] = f"{symbol} · {name.replace('_', ' ')}", fraction
    return found


def _slider(part: tuple[str, bool]) -> Slider:
    title, fraction = part
    low, high = (0.0, 1.0) if fraction else (_LIGHT, _HEAVY)
    return Slider(start=low, end=high, step=0.05, value=high, title=title, width=230)
