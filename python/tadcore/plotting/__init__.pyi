from .motion.animation import Animation
from .run.compare import compare
from .run.externality import externality
from .run.gains import gains
from .run.network import network
from .run.raster import MAX_ROWS, visibility
from .run.series import MAX_VERTICALS, controls, distances, theta
from .run.trajectories import MAX_EDGE_LABELS, trajectories
from .study.charts import comparison, incidence, outcome_probabilities, radius_curve, sensitivity
from .study.maps import outcome_map
from .study.shares import outcomes_by_input, outcomes_by_inputs
from .tools.labels import Labels
from .tools.save import save
from .tools.style import COLUMN, PAGE, style

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
