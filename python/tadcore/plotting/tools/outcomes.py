"""How an outcome looks: a fill, a hatch and a line of its own, the same in every figure.

Fills keep the hue of whoever brings the outcome about, at lightnesses that differ in greyscale; hatches tell
apart what a grey print would still confuse.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from matplotlib.colors import to_rgb
from matplotlib.patches import Patch

from tadcore._shared.arrays import Floats
from tadcore.scenario.paths import short
from tadcore.statistics.outcomes import is_defender

from .ground import ink
from .style import look, symbol

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_HATCHES = ("", "////", "....", "xxxx", "----", "oo")
_LIGHT = (0.62, 0.45, 0.3)  # share of white in the fills of defenders, in turn


@dataclass(frozen=True, slots=True)
class OutcomeLook:
    """The appearance of one outcome."""

    label: str
    """In words, players in mathtext."""
    colour: str
    """Of lines and marks."""
    fill: tuple[float, float, float]
    hatch: str
    marker: str
    dashes: Any


def outcome_look(name: str) -> OutcomeLook:
    """Return how the outcome ``name`` ("timeout", "captured", "diverged", "no_equilibrium", "d1", …) is drawn."""
    if name == "diverged":
        return OutcomeLook("diverged", "#6A3D9A", (0.36, 0.33, 0.4), "++", "x", (0, (5, 1, 1, 1, 1, 1)))
    if name == "no_equilibrium":
        return OutcomeLook("no equilibrium", "#1F78B4", (0.85, 0.9, 0.95), "**", "s", (0, (3, 1, 1, 1)))
    if name == "timeout":
        return OutcomeLook("timeout", ink(0.4), (0.97, 0.97, 0.97), "", "v", (0, (1, 2.5)))
    if name == "captured":
        who = look("attacker")
        return OutcomeLook("captured", who.colour, _tint(who.colour, 0.12), r"\\\\", who.marker, who.dashes)
    if name == "intercepted":
        return OutcomeLook("intercepted", ink(), (0.75, 0.75, 0.75), "", "o", "-")
    who, i = look(name), int(name.removeprefix("d")) - 1
    fill = _tint(who.colour, _LIGHT[i % len(_LIGHT)])
    return OutcomeLook(f"by {who.symbol}", who.colour, fill, _HATCHES[i % len(_HATCHES)], who.marker, who.dashes)


def listed(what: str, given: object, known: Sequence[str]) -> str:
    """What was given, if it is one of those that are known; raises ValueError."""
    if not isinstance(given, str) or given not in known:
        raise ValueError(f"no {what} {given!r}; one of {', '.join(known)}")
    return given


def parts_of(names: Sequence[str]) -> list[str]:
    """The outcomes that exclude one another and are certain together: "intercepted" by its defenders."""
    lost = [name for name in names if name in ("diverged", "no_equilibrium")]
    return [*(name for name in names if is_defender(name)), "captured", "timeout", *lost]


def boxes(names: Sequence[str]) -> list[Patch]:
    """Legend entries of filled areas."""
    looks = [outcome_look(name) for name in names]
    return [Patch(facecolor=it.fill, edgecolor="0.25", hatch=it.hatch, linewidth=0.5, label=it.label) for it in looks]


def stack(ax: Axes, x: Floats, base: Floats, top: Floats, name: str) -> None:
    """Fill one outcome's layer of a stack of steps, and draw its upper rim."""
    it = outcome_look(name)
    ax.fill_between(x, base, top, step="post", facecolor=it.fill, hatch=it.hatch, edgecolor="0.35", linewidth=0.0)
    ax.step(x, top, where="post", color="0.25", linewidth=0.6)


def quantity_label(name: str) -> str:
    """An output of a sensitivity analysis in words."""
    if name in ("timeout", "captured", "intercepted", "diverged") or is_defender(name):
        return f"“{outcome_look(name).label}”"
    return "the termination time" if name == "time" else name


def input_label(name: str) -> str:
    """``defenders.0.position.x``, radii and control weights as symbols, anything else as it is."""
    owner, _, rest = short(name).partition(".")
    if owner not in ("attacker", "target") and not is_defender(owner):
        return name
    letter = {"visibility_radius": r"\zeta", "capture_radius": r"\sigma", "control_weight": "r"}.get(rest)
    axis = rest.removeprefix("position.")
    if letter:
        return f"${letter}_{{{symbol(owner)}}}$"
    return f"${axis}_{{{symbol(owner)}}}(0)$" if axis in ("x", "y", "z") else name


def _tint(colour: str, white: float) -> tuple[float, float, float]:
    r, g, b = (white + (1.0 - white) * part for part in to_rgb(colour))
    return r, g, b
