"""How a player looks: colour, marker, line and symbol, the same in every figure.

Colours are those of Okabe and Ito, which readers with any of the common colour deficiencies can tell apart.
Colour is never the only difference: each player has its own marker and its own dash pattern too, so that a grey
print loses nothing.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import matplotlib as mpl

from tadcore._shared.arrays import as_flag
from tadcore.game.recorded import Recorded

from .ground import ink

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.backend_bases import RendererBase


COLUMN = 3.5
"""Width in inches of one journal column."""
PAGE = 7.16
"""Width in inches of two journal columns."""

_DEFENDER_COLOURS = ("#0072B2", "#009E73", "#CC79A7", "#3D97CE", "#B87E00")  # the last two darker, to be read in grey
_DEFENDER_MARKERS = ("o", "s", "^", "D", "v", "P", "h")
_DEFENDER_DASHES: tuple[Any, ...] = (
    "-",
    (0, (5, 1.5)),
    (0, (6, 1.5, 1, 1.5)),
    (0, (1.2, 1.2)),
    (0, (3, 1, 1, 1, 1, 1)),
)

_NOTE = "note"
_PAPER: Any = {
    "font.family": "STIXGeneral",
    "mathtext.fontset": "stix",
    "font.size": 9,
    "axes.labelsize": 9,
    "axes.titlesize": 9,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "legend.fontsize": 8,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.3,
    "lines.markersize": 5,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "grid.color": "0.9",
    "grid.linewidth": 0.5,
    "savefig.bbox": None,
}


_GROUND = "#14171c"
_DARK: Any = {
    **dict.fromkeys(("figure.facecolor", "axes.facecolor", "savefig.facecolor"), _GROUND),
    **dict.fromkeys(("text.color", "axes.labelcolor", "axes.titlecolor", "xtick.color", "ytick.color"), "0.92"),
    "axes.edgecolor": "0.75",
    "grid.color": "0.25",
    "hatch.color": "0.1",
}


@dataclass(frozen=True, slots=True)
class Look:
    """The appearance of one player."""

    symbol: str
    """Mathtext: ``$d_1$``, ``$\\tau$``, ``$a$``."""
    colour: str
    marker: str
    dashes: Any


def symbol(player: str) -> str:
    """Return the mathtext symbol, without dollar signs, of the player labelled ``player``."""
    if player == "target":
        return r"\tau"
    if player == "attacker":
        return "a"
    return f"d_{{{player.removeprefix('d')}}}"


def look(player: str) -> Look:
    """Return how the player labelled ``player`` ("d1", …, "d*" for the team, "target", "attacker") is drawn."""
    text = f"${symbol(player)}$"
    if player == "target":
        return Look(text, ink(), "*", (0, (8, 2)))
    if player == "attacker":
        return Look(text, "#D55E00", "X", (0, (2, 1)))
    if player == "d*":
        return Look(text, ink(0.35), "P", (0, (4, 1, 1, 1)))
    i = int(player.removeprefix("d")) - 1
    return Look(
        text,
        _DEFENDER_COLOURS[i % len(_DEFENDER_COLOURS)],
        _DEFENDER_MARKERS[i % len(_DEFENDER_MARKERS)],
        _DEFENDER_DASHES[i % len(_DEFENDER_DASHES)],
    )


def edge_text(observer: str, seen: Sequence[str], *, lost: bool = False) -> str:
    r"""Return the label of an edge: ``$d_2\to a$``, several at once ``$d_2\to a, d_1$``, a lost one struck out."""
    arrow = r"\nrightarrow" if lost else r"\to"
    others = r",\,".join(symbol(p) for p in seen)
    return f"${symbol(observer)}{arrow} {others}$"


def outcome_text(run: Recorded) -> str:
    """Return the outcome in a line of mathtext, for a title."""
    if run.diverged is not None:
        return f"diverges at $t={run.diverged.time:.6g}$"
    at = f"$t={run.outcome.time:.6g}$"
    if run.outcome.kind == "intercepted":
        return f"$d_{{{int(run.outcome.defender or 0) + 1}}}$ intercepts $a$ at {at}"
    if run.outcome.kind == "captured":
        return rf"$a$ captures $\tau$ at {at}"
    return f"no capture until {at}"


def world_text(run: Recorded) -> str:
    """What surrounds the game in a few words, with what it was drawn from; empty for the paper's game."""
    world = run.scenario.world
    if run.course is None:
        return ""
    outside = ["a network from outside"] if run.course.from_outside else []
    if world is None:
        return ", ".join(outside)
    there = {"failures": world.fails, "reports": world.talks, "disturbances": world.shakes}
    drawn = [f"seed {run.course.seed}", f"trial {run.course.trial}"] if world.is_random else []
    return ", ".join([*(word for word, is_there in there.items() if is_there), *outside, *drawn])


@contextmanager
def style(*, dark: bool = False) -> Iterator[None]:
    """Set type and line weights as a two-column journal prints them, inside a ``with`` block only.

    Every function of this package draws in whatever style is in force, so this is for the reader who wants the look of
    the bundled figures. Draw and save inside the block: ticks take their font when they are first drawn.

    Parameters
    ----------
    dark : bool
        Whether to draw on a dark ground, for slides. What is black on white is then white; so it is in any style with
        dark axes, such as Matplotlib's ``dark_background``.
    """
    chosen = {**_PAPER, **_DARK} if as_flag("dark", dark) else _PAPER
    with contextlib.ExitStack() as last, mpl.rc_context(chosen):
        try:
            yield
        finally:
            # a notebook's backend switches this on when the first figure loads it, which may be in the block
            last.callback(mpl.interactive, mpl.is_interactive())


def time_label(*runs: Recorded) -> str:
    """The label of an axis of time, which says up to where a game that diverges is drawn."""
    lost = [run.diverged.time for run in runs if run.diverged is not None]
    return f"time $t$, up to the divergence at {max(lost):.6g}" if lost else "time $t$"


def note(ax: Axes, text: str) -> None:
    """Write a small remark under the label of the horizontal axis, or under 3-D axes; a second one under the first."""
    plane = ax.name != "3d"
    for there in ax.texts:
        if there.get_gid() == _NOTE:
            there.set_text(f"{there.get_text()}\n{text}")
            return
    ax.annotate(
        text,
        (0.5, 0.0),
        xycoords=ax.xaxis.label if plane else "axes fraction",
        xytext=(0, -2),
        textcoords="offset points",
        ha="center",
        va="top",
        fontsize="x-small",
        color=ink(0.3),
        annotation_clip=False,
        gid=_NOTE,
    )


def points(renderer: RendererBase) -> float:
    """Return the pixels in one typographic point."""
    pixels: Any = renderer.points_to_pixels(1.0)
    return float(pixels)
