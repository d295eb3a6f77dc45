"""Figures of runs and of studies, as the field prints them.

Every function draws in the axes it is given, or in new ones, and returns them; none changes a global setting. Figures
read at one column (3.5 in) and across two (7.16 in), to a colour-blind reader and in grey.
"""

from tadcore.plotting.motion.animation import Animation
from tadcore.plotting.run.compare import compare
from tadcore.plotting.run.externality import externality
from tadcore.plotting.run.gains import gains
from tadcore.plotting.run.network import network
from tadcore.plotting.run.raster import MAX_ROWS, visibility
from tadcore.plotting.run.series import MAX_VERTICALS, controls, distances, theta
from tadcore.plotting.run.trajectories import MAX_EDGE_LABELS, trajectories
from tadcore.plotting.study.charts import (
    comparison,
    incidence,
    outcome_probabilities,
    radius_curve,
    sensitivity,
)
from tadcore.plotting.study.maps import outcome_map
from tadcore.plotting.study.shares import outcomes_by_input, outcomes_by_inputs
from tadcore.plotting.tools.labels import Labels
from tadcore.plotting.tools.save import save
from tadcore.plotting.tools.style import COLUMN, PAGE, style

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
