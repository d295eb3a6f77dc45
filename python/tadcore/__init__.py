"""Target-attacker-defender linear-quadratic differential games with limited observations.

>>> import tadcore
>>> run = tadcore.simulate(tadcore.scenarios.load("paper-i1"))
>>> print(run.outcome)
d1 intercepts the attacker at t = 1.395

A `Scenario` says what is played; `solve_equilibrium`, `synthesize`, `simulate` and `simulate_batch` compute; a `Study`
draws, plays and keeps as many games as one likes, and `sweep` repeats it over weights. Bad input raises
`ScenarioError`, a game without an equilibrium `NoEquilibriumError`.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from . import scenarios
    from ._core import __version__
    from .batch import Batch, simulate_batch
    from .equilibrium import Equilibrium, solve_equilibrium
    from .errors import NoEquilibriumError, ScenarioError, StoreError, TadcoreError, VerificationError, WorkerError
    from .maps import OutcomeMap, outcome_map
    from .network import NetworkChange, VisibilityNetwork
    from .outcome import Outcome, OutcomeKind
    from .radius import RadiusCurve, radius_curve
    from .result import StudyResult, load_study
    from .scenario import Attacker, Defender, Scenario, Target
    from .simulation import Run, simulate
    from .statistics import HalfWidth
    from .study import Study
    from .sweeps import SweepResult, sweep
    from .synthesis import Gains, synthesize
    from .verification import VerificationReport, verify

__all__ = [
    "Attacker",
    "Batch",
    "Defender",
    "Equilibrium",
    "Gains",
    "HalfWidth",
    "NetworkChange",
    "NoEquilibriumError",
    "Outcome",
    "OutcomeKind",
    "OutcomeMap",
    "RadiusCurve",
    "Run",
    "Scenario",
    "ScenarioError",
    "StoreError",
    "Study",
    "StudyResult",
    "SweepResult",
    "TadcoreError",
    "Target",
    "VerificationError",
    "VerificationReport",
    "VisibilityNetwork",
    "WorkerError",
    "__version__",
    "load_study",
    "outcome_map",
    "radius_curve",
    "scenarios",
    "simulate",
    "simulate_batch",
    "solve_equilibrium",
    "sweep",
    "synthesize",
    "verify",
]

_HOMES = {
    "Attacker": "scenario",
    "Batch": "batch",
    "Defender": "scenario",
    "Equilibrium": "equilibrium",
    "Gains": "synthesis",
    "HalfWidth": "statistics",
    "NetworkChange": "network",
    "NoEquilibriumError": "errors",
    "Outcome": "outcome",
    "OutcomeKind": "outcome",
    "OutcomeMap": "maps",
    "RadiusCurve": "radius",
    "Run": "simulation",
    "Scenario": "scenario",
    "ScenarioError": "errors",
    "StoreError": "errors",
    "Study": "study",
    "StudyResult": "result",
    "SweepResult": "sweeps",
    "TadcoreError": "errors",
    "Target": "scenario",
    "VerificationError": "errors",
    "VerificationReport": "verification",
    "VisibilityNetwork": "network",
    "WorkerError": "errors",
    "__version__": "_core",
    "load_study": "result",
    "outcome_map": "maps",
    "radius_curve": "radius",
    "simulate": "simulation",
    "simulate_batch": "batch",
    "solve_equilibrium": "equilibrium",
    "sweep": "sweeps",
    "synthesize": "synthesis",
    "verify": "verification",
}
_ROOMS = frozenset(_HOMES.values()) | {
    "cli",
    "explorer",
    "plotting",
    "report",
    "reproduce",
    "sampling",
    "scenarios",
    "sensitivity",
    "store",
}


def __getattr__(name: str) -> Any:
    """Import what is asked for when it is asked for: ``import tadcore`` alone loads nothing heavy."""
    if name in _HOMES:
        value = getattr(import_module(f".{_HOMES[name]}", __name__), name)
        globals()[name] = value
        return value
    if name in _ROOMS:
        return import_module(f".{name}", __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*__all__, *_ROOMS, *globals()})
