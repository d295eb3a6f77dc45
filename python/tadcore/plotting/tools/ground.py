"""Ink and paper: what is drawn in black and grey on white is drawn in white and grey on a dark ground."""

from __future__ import annotations

import matplotlib as mpl
from matplotlib.colors import to_hex, to_rgb


def is_dark() -> bool:
    """Whether axes are dark in the style in force, as in Matplotlib's ``dark_background``."""
    red, green, blue = to_rgb(_ground())
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue < 0.4


def ink(grey: float = 0.0) -> str:
    """The colour of lines and letters: black, or a grey between it and the paper."""
    level = 1.0 - grey if is_dark() else grey
    return {0.0: "#000000", 1.0: "#ffffff"}.get(level, f"{level:g}")


def paper() -> str:
    """The colour of what is hollow, and of rims that keep marks apart: that of the axes."""
    return to_hex(_ground()) if is_dark() else "white"


def _ground() -> str:
    """The colour behind what is drawn."""
    axes = mpl.rcParams["axes.facecolor"]
    found: str = mpl.rcParams["figure.facecolor"] if axes == "none" else axes
    return "white" if found == "none" else found
