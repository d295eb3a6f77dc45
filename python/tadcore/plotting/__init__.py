"""Figures of runs and of studies, as the field prints them.

Every function draws in the axes it is given, or in new ones, and returns them; none changes a global setting. Figures
read at one column (3.5 in) and across two (7.16 in), to a colour-blind reader and in grey.
"""

from ._animation import Animation
from ._compare import compare
from ._externality import externality
from ._gains import gains
from ._labels import Labels
from ._network import network
from ._raster import MAX_ROWS, visibility
from ._save import save
from ._series import MAX_VERTICALS, controls, distances, theta
from ._style import COLUMN, PAGE, style
from ._trajectories import MAX_EDGE_LABELS, trajectories
from .maps import outcome_map
from .shares import outcomes_by_input, outcomes_by_inputs
from .studies import comparison, incidence, outcome_probabilities, radius_curve, sensitivity

__all__ = [
    "COLUMN",
    "MAX_EDGE_LABELS",
    "MAX_ROWS",
    "MAX_VERTICALS",
    "PAGE",
    "Animation",
    "Labels",
    "compare",
    "comparison",
    "controls",
    "distances",
    "externality",
    "gains",
    "incidence",
    "network",
    "outcome_map",
    "outcome_probabilities",
    "outcomes_by_input",
    "outcomes_by_inputs",
    "radius_curve",
    "save",
    "sensitivity",
    "style",
    "theta",
    "trajectories",
    "visibility",
]
