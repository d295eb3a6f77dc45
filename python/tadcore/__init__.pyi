from . import (
    analysis as analysis,
    cli as cli,
    errors as errors,
    explorer as explorer,
    game as game,
    plotting as plotting,
    report as report,
    reproduce as reproduce,
    sampling as sampling,
    scenario as scenario,
    scenarios as scenarios,
    simulation as simulation,
    statistics as statistics,
    study as study,
    verification as verification,
)
from ._core import __version__ as __version__
from .analysis.boxes import CertifiedMap as CertifiedMap
from .analysis.budget import BestRadii as BestRadii, best_radii as best_radii
from .analysis.certified import certified_map as certified_map
from .analysis.loading import load_certified_map as load_certified_map
from .analysis.maps import OutcomeMap as OutcomeMap, outcome_map as outcome_map
from .analysis.placement import BestStart as BestStart, best_start as best_start
from .analysis.probabilities import ProbabilityMap as ProbabilityMap, probability_map as probability_map
from .analysis.radius import radius_curve as radius_curve
from .analysis.rare_events import rare as rare
from .analysis.rarity import RareEvent as RareEvent
from .analysis.sweeps import sweep as sweep
from .analysis.swept import SweepResult as SweepResult
from .errors import (
    NoEquilibriumError as NoEquilibriumError,
    OutOfMemoryError as OutOfMemoryError,
    ScenarioError as ScenarioError,
    StoreError as StoreError,
    TadcoreError as TadcoreError,
    VerificationError as VerificationError,
    WorkerError as WorkerError,
)
from .game.changes import NetworkChange as NetworkChange
from .game.divergence import Divergence as Divergence
from .game.equilibrium import Equilibrium as Equilibrium, solve_equilibrium as solve_equilibrium
from .game.network import VisibilityNetwork as VisibilityNetwork
from .game.outcome import Outcome as Outcome, OutcomeKind as OutcomeKind
from .game.passes import Pass as Pass
from .game.synthesis import Gains as Gains, synthesize as synthesize
from .scenario.model import Scenario as Scenario
from .scenario.players import Attacker as Attacker, Defender as Defender, Target as Target
from .scenario.tables import (
    Communication as Communication,
    Disturbance as Disturbance,
    Sensing as Sensing,
    Transmitter as Transmitter,
)
from .simulation.batch import Batch as Batch, simulate_batch as simulate_batch
from .simulation.loading import load_run as load_run
from .simulation.play import simulate as simulate
from .simulation.run import Run as Run
from .statistics import HalfWidth as HalfWidth
from .statistics.radius import RadiusCurve as RadiusCurve
from .study.study import Study as Study, StudyResult as StudyResult, load_study as load_study
from .verification import VerificationReport as VerificationReport, verify as verify
