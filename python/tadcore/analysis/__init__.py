"""Questions over many games: outcome maps, where to place a player, radii, sensitivity, sweeps over weights."""

from tadcore.statistics.radius import RadiusCurve
from tadcore.statistics.sobol import Sensitivity, sobol

from .boxes import CertifiedMap
from .budget import BestRadii, best_radii
from .certified import certified_map
from .loading import load_certified_map
from .maps import OutcomeMap, outcome_map
from .placement import BestStart, best_start
from .probabilities import ProbabilityMap, probability_map
from .radius import radius_curve
from .rare_events import rare
from .rarity import RareEvent
from .sensitivities import sensitivity
from .starts import start_share
from .sweeps import sweep
from .swept import SweepResult

__all__ = [
    "BestRadii",
    "BestStart",
    "CertifiedMap",
    "OutcomeMap",
    "ProbabilityMap",
    "RadiusCurve",
    "RareEvent",
    "Sensitivity",
    "SweepResult",
    "best_radii",
    "best_start",
    "certified_map",
    "load_certified_map",
    "outcome_map",
    "probability_map",
    "radius_curve",
    "rare",
    "sensitivity",
    "sobol",
    "start_share",
    "sweep",
]
