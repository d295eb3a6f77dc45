from .motion.animation import Animation as Animation
from .run.compare import compare as compare
from .run.externality import externality as externality
from .run.foreign import run_of as run_of
from .run.gains import gains as gains
from .run.network import network as network
from .run.raster import MAX_ROWS as MAX_ROWS, visibility as visibility
from .run.series import MAX_VERTICALS as MAX_VERTICALS, controls as controls, distances as distances, theta as theta
from .run.trajectories import MAX_EDGE_LABELS as MAX_EDGE_LABELS, trajectories as trajectories
from .study.certified import certified_map as certified_map
from .study.charts import (
    comparison as comparison,
    incidence as incidence,
    outcome_probabilities as outcome_probabilities,
    radius_curve as radius_curve,
    sensitivity as sensitivity,
)
from .study.joint import outcomes_over as outcomes_over
from .study.maps import outcome_map as outcome_map
from .study.probability import probability_map as probability_map
from .study.radii import radius_curves as radius_curves
from .study.shares import outcomes_by_input as outcomes_by_input, outcomes_by_inputs as outcomes_by_inputs
from .study.sweeps import sweep as sweep
from .tools.labels import Labels as Labels
from .tools.save import save as save
from .tools.style import COLUMN as COLUMN, PAGE as PAGE, style as style
