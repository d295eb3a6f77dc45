"""Target-attacker-defender linear-quadratic differential games with limited observations.

>>> import tadcore
>>> run = tadcore.simulate(tadcore.scenarios.load("paper-i1"))
>>> print(run.outcome)
d1 intercepts the attacker at t = 1.395

A `Scenario` says what is played; `solve_equilibrium`, `synthesize`, `simulate` and `simulate_batch` compute. Bad input
raises `ScenarioError`, a game without an equilibrium `NoEquilibriumError`.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from . import scenarios
    from ._core import __version__
    from .batch import Batch, simulate_batch
    from .equilibrium import Equilibrium, solve_equilibrium
    from .errors import NoEquilibriumError, ScenarioError, TadcoreError
    from .network import NetworkChange, VisibilityNetwork
    from .outcome import Outcome, OutcomeKind
    from .scenario import Attacker, Defender, Scenario, Target
    from .simulation import Run, simulate
    from .synthesis import Gains, synthesize

__all__ = [
    "Attacker",
    "Batch",
    "Defender",
    "Equilibrium",
    "Gains",
    "NetworkChange",
    "NoEquilibriumError",
    "Outcome",
    "OutcomeKind",
    "Run",
    "Scenario",
    "ScenarioError",
    "TadcoreError",
    "Target",
    "VisibilityNetwork",
    "__version__",
    "scenarios",
    "simulate",
    "simulate_batch",
    "solve_equilibrium",
    "synthesize",
]

_HOMES = {
    "Attacker": "scenario",
    "Batch": "batch",
    "Defender": "scenario",
    "Equilibrium": "equilibrium",
    "Gains": "synthesis",
    "NetworkChange": "network",
    "NoEquilibriumError": "errors",
    "Outcome": "outcome",
    "OutcomeKind": "outcome",
    "Run": "simulation",
    "Scenario": "scenario",
    "ScenarioError": "errors",
    "TadcoreError": "errors",
    "Target": "scenario",
    "VisibilityNetwork": "network",
    "__version__": "_core",
    "simulate": "simulation",
    "simulate_batch": "batch",
    "solve_equilibrium": "equilibrium",
    "synthesize": "synthesis",
}
_ROOMS = frozenset(_HOMES.values()) | {"cli", "explorer", "plotting", "reproduce", "scenarios"}


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
