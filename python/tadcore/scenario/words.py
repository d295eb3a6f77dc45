"""A scenario in a few lines for a reader."""

from __future__ import annotations

import math

from tadcore._shared.html import as_html, line, thinned

from . import worlds
from .shape import Shape

_NAMES = {
    "I1": "I1, defenders against attacker and target",
    "I2": "I2, defenders and target against attacker",
}


def describe(sc: Shape) -> str:
    """The players, the horizon, the radii, and what surrounds the game."""
    lines = [_NAMES[sc.interaction], f"T = {sc.horizon:g}, δ = {sc.step:g}, {sc.steps} steps, {sc.dim} axes"]
    if sc.interaction == "I1":
        lines[0] += f" (λ = {sc.attacker.evasion:g})"
    if sc.feedback == "receding":
        lines.append(f"receding horizon: P is that at the beginning of T_h = {sc.prediction_horizon:g} throughout")
    if sc.criterion == "component":
        lines.append("team criterion: whoever knows everything plays its row of the equilibrium")
    gamma = sc.synthesis_weights
    if len(set(gamma)) > 1:
        lines.append(f"γ = ({', '.join(f'{g:g}' for g in gamma)})")
    first = 3 if sc.interaction == "I1" else 1
    if missing := [f"γ{i + 1}" for i in range(first, len(gamma)) if gamma[i] == 0.0]:
        lines.append(f"{' = '.join(missing)} = 0: the gains are the limit of a small weight on S")
    sight = dict(zip(sc.constrained, sc.visibility_radii, strict=True))
    capture = dict(zip([*sc.players[: sc.n], "attacker"], sc.capture_radii, strict=True))
    for label, position in zip(sc.players, sc.positions, strict=True):
        place = ", ".join(f"{x:g}" for x in position)
        line = f"{label:<8} at ({place}), {_reach(sight.get(label, math.inf))}"
        lines.append(line + (f", captures within {capture[label]:g}" if label in capture else ""))
    return "\n".join([*lines, *worlds.describe(sc)])


def html_of(sc: Shape) -> str:
    """The same as a table for notebooks."""
    sight = dict(zip(sc.constrained, sc.visibility_radii, strict=True))
    capture = dict(zip([*sc.players[: sc.n], "attacker"], sc.capture_radii, strict=True))
    efforts = [*(d.control_weight for d in sc.defenders), sc.target.control_weight, sc.attacker.control_weight]
    rows = [
        [
            player,
            f"({', '.join(f'{x:g}' for x in at)})",
            f"{sight.get(player, math.inf):g}".replace("inf", "∞"),
            f"{capture[player]:g}" if player in capture else "–",
            f"{effort:g}",
            "",
        ]
        for player, at, effort in zip(sc.players, sc.positions, efforts, strict=True)
    ]
    head = ["", "starts at", "visibility ζ", "capture σ", "control weight r", ""]
    title, grid = describe(sc).splitlines()[:2]
    return as_html(title, head, thinned(rows), line("; ".join([grid, *worlds.describe(sc)])))


def _reach(radius: float) -> str:
    return "unlimited sight" if math.isinf(radius) else f"visibility radius {radius:g}"
