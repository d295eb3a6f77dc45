"""Figures of a run, as the field prints them.

Every function draws in the axes it is given, or in new ones, and returns them; none changes a global setting. Figures
read at one column (3.5 in) and across two (7.16 in), to a colour-blind reader and in grey.
"""

from ._animation import Animation
from ._compare import compare
from ._gains import gains
from ._labels import Labels
from ._network import network
from ._raster import MAX_ROWS, visibility
from ._save import save
from ._series import MAX_VERTICALS, controls, distances, theta
from ._style import COLUMN, PAGE, style
from ._trajectories import MAX_EDGE_LABELS, trajectories

__all__ = [
    "COLUMN",
    "MAX_EDGE_LABELS",
    "MAX_ROWS",
    "MAX_VERTICALS",
    "PAGE",
    "Animation",
    "Labels",
    "compare",
    "controls",
    "distances",
    "gains",
    "network",
    "save",
    "style",
    "theta",
    "trajectories",
    "visibility",
]
