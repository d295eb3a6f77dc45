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
    from .analysis.maps import OutcomeMap, outcome_map
    from .analysis.radius import RadiusCurve, radius_curve
    from .analysis.sweeps import SweepResult, sweep
    from .errors import (
        NoEquilibriumError,
        ScenarioError,
        StoreError,
        TadcoreError,
        VerificationError,
        WorkerError,
    )
    from .game.equilibrium import Equilibrium, solve_equilibrium
    from .game.network import NetworkChange, VisibilityNetwork
    from .game.outcome import Outcome, OutcomeKind
    from .game.synthesis import Gains, synthesize
    from .scenario.model import Attacker, Defender, Scenario, Target
    from .simulation.batch import Batch, simulate_batch
    from .simulation.run import Run, simulate
    from .statistics import HalfWidth
    from .study.result import StudyResult, load_study
    from .study.study import Study
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
    "Batch": "simulation.batch",
    "Defender": "scenario",
    "Equilibrium": "game.equilibrium",
    "Gains": "game.synthesis",
    "HalfWidth": "statistics",
    "NetworkChange": "game.network",
    "NoEquilibriumError": "errors",
    "Outcome": "game.outcome",
    "OutcomeKind": "game.outcome",
    "OutcomeMap": "analysis.maps",
    "RadiusCurve": "analysis.radius",
    "Run": "simulation",
    "Scenario": "scenario",
    "ScenarioError": "errors",
    "StoreError": "errors",
    "Study": "study",
    "StudyResult": "study.result",
    "SweepResult": "analysis.sweeps",
    "TadcoreError": "errors",
    "Target": "scenario",
    "VerificationError": "errors",
    "VerificationReport": "verification",
    "VisibilityNetwork": "game.network",
    "WorkerError": "errors",
    "__version__": "_core",
    "load_study": "study.result",
    "outcome_map": "analysis.maps",
    "radius_curve": "analysis.radius",
    "simulate": "simulation",
    "simulate_batch": "simulation.batch",
    "solve_equilibrium": "game.equilibrium",
    "sweep": "analysis.sweeps",
    "synthesize": "game.synthesis",
    "verify": "verification",
}
_WINGS = frozenset(
    {
        "analysis",
        "cli",
        "errors",
        "explorer",
        "game",
        "plotting",
        "report",
        "reproduce",
        "sampling",
        "scenario",
        "scenarios",
        "simulation",
        "statistics",
        "study",
        "verification",
    }
)


def __getattr__(name: str) -> Any:
    """Import what is asked for when it is asked for: ``import tadcore`` alone loads nothing heavy."""
    if name in _HOMES:
        value = getattr(import_module(f".{_HOMES[name]}", __name__), name)
        globals()[name] = value
        return value
    if name in _WINGS:
        return import_module(f".{name}", __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*__all__, *_WINGS, *globals()})
