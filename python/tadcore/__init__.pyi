from . import (
    analysis,
    cli,
    errors,
    explorer,
    game,
    plotting,
    report,
    reproduce,
    sampling,
    scenario,
    scenarios,
    simulation,
    statistics,
    study,
    verification,
)
from ._core import __version__
from .analysis.maps import OutcomeMap, outcome_map
from .analysis.radius import RadiusCurve, radius_curve
from .analysis.sweeps import SweepResult, sweep
from .errors import NoEquilibriumError, ScenarioError, StoreError, TadcoreError, VerificationError, WorkerError
from .game.changes import NetworkChange
from .game.equilibrium import Equilibrium, solve_equilibrium
from .game.network import VisibilityNetwork
from .game.outcome import Outcome, OutcomeKind
from .game.synthesis import Gains, synthesize
from .scenario.model import Attacker, Defender, Scenario, Target
from .simulation.batch import Batch, simulate_batch
from .simulation.run import Run, simulate
from .statistics import HalfWidth
from .study.study import Study, StudyResult, load_study
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
    "analysis",
    "cli",
    "errors",
    "explorer",
    "game",
    "load_study",
    "outcome_map",
    "plotting",
    "radius_curve",
    "report",
    "reproduce",
    "sampling",
    "scenario",
    "scenarios",
    "simulate",
    "simulate_batch",
    "simulation",
    "solve_equilibrium",
    "statistics",
    "study",
    "sweep",
    "synthesize",
    "verification",
    "verify",
]
