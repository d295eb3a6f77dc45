"""Questions over many games: outcome maps, the value of a radius, sensitivity, sweeps over weights."""

from tadcore.statistics.radius import RadiusCurve
from tadcore.statistics.sobol import Sensitivity, sobol

from .maps import OutcomeMap, outcome_map
from .radius import radius_curve
from .sensitivities import sensitivity
from .sweeps import SweepResult, sweep

__all__ = [
    "OutcomeMap",
    "RadiusCurve",
    "Sensitivity",
    "SweepResult",
    "outcome_map",
    "radius_curve",
    "sensitivity",
    "sobol",
    "sweep",
]
