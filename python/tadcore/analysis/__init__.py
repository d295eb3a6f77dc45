"""Questions over many games: outcome maps, the value of a radius, sensitivity, sweeps over weights."""

from .maps import OutcomeMap, outcome_map
from .radius import RadiusCurve, radius_curve
from .sensitivities import Sensitivity, sensitivity, sobol
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
