"""What the trials of a study say: probabilities, incidence, comparisons, and when to stop.

Every function takes plain arrays of outcomes, or the result of a study, and returns a small object that prints as a
table, converts to pandas, and is drawn by a function of `tadcore.plotting`.
"""

from .comparison import Comparison, compare, paired
from .differences import difference_interval
from .incidence import Incidence, incidence, incidence_of
from .intervals import OutcomeProbabilities, probabilities, probabilities_of, proportion_interval
from .outcomes import TrialOutcomes, outcome_counts, outcome_names
from .radii import RadiusCurves
from .radius import RadiusCurve
from .reached import ReachedTime
from .sequences import HalfWidth, mixture_interval
from .single_radii import Breakpoints, SmallestRadius
from .starts import StartShare, start_share_of
from .stopping import Stopping
from .tally import Tally

__all__ = [
    "Breakpoints",
    "Comparison",
    "HalfWidth",
    "Incidence",
    "OutcomeProbabilities",
    "RadiusCurve",
    "RadiusCurves",
    "ReachedTime",
    "SmallestRadius",
    "StartShare",
    "Stopping",
    "Tally",
    "TrialOutcomes",
    "compare",
    "difference_interval",
    "incidence",
    "incidence_of",
    "mixture_interval",
    "outcome_counts",
    "outcome_names",
    "paired",
    "probabilities",
    "probabilities_of",
    "proportion_interval",
    "start_share_of",
]
