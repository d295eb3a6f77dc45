"""Numerical checks of a record and of the paper's theorems: Nash property, indices, minima of Θ, symmetries, the step.

`verify` runs every check on a scenario or on a run and returns a `VerificationReport`. The pieces can be called alone:

===========================================  ==========================================================================
module                                       what it answers
===========================================  ==========================================================================
``checks.nash``, ``oracle.responses``        does P solve its Riccati equation, and does anyone gain by deviating
                                             (thm:fbne, thm:zero:sum:game)
``oracle.adapted``, ``checks.adapted_nash``  S, ΔQ^Ad, the indices J^Ad in continuous time and their identities
                                             (thm:thm1, thm:thm2)
``checks.record``, ``checks.claims``         is everything that a run records what the scenario and the equations say
``checks.consistency``                       full observation gives the equilibrium (thm:consistency); how far the
                                             indices are from the players' own
``checks.gains``, ``oracle.objective``       gradient, curvature in full blocks, other starts, share of certified gains
``bound``                                    lower bounds on Θ and the gap: order one by semidefinite programming
                                             (extra ``bounds``), order two by sums of squares, proved exactly
``checks.turning``                           blocks that turn: how much lower Θ is along a game, and what it ends with
``checks.geometry``                          straight line (thm:straight_line), radius delay (thm:delayproperty),
                                             symmetries
``checks.steps``                             δ, δ/2, δ/4: what depends on the step
``continuous``                               the continuous game by its event times, sliding modes included; how
                                             chattering tends to them
``checks.decentral``                         the synthesis as a protocol between players (rem:networkexternality)
`control_jumps`                              the jump of every player's control at every change of the network
===========================================  ==========================================================================

NumPy and SciPy alone compute everything in ``oracle``, and with it every check of a record, of P(t) and of the
indices, from the scenario's weights, the record and P(t). ``docs/verification.md`` lists the checks that compare the
library with itself: consistency, geometry, steps, the central side of the protocol, the counts of the solver, and the
finer P that a regret on a coarse grid needs.
"""

from tadcore.errors import VerificationError
from tadcore.game.chattering import Chatter, chatter
from tadcore.game.externality import control_jumps

from .bound.bounds import ThetaBound, theta_bound
from .bound.sampled import TableProof, prove_table
from .checks.adapted_nash import check_nafne, gap_order, sampling_gap
from .checks.consistency import check_consistency, index_distance
from .checks.decentral import Decentralised, check_decentral, decentralise
from .checks.gains import CertificateRates, certificate_rates, check_gains, lowest_curvature, multistart
from .checks.geometry import check_geometry, moved, off_the_line, radius_delay, relabelled
from .checks.nash import check_equilibrium, riccati_defect
from .checks.record import check_record
from .checks.steps import Refinement, StepStudy, check_steps, refine_batch, step_study
from .checks.turning import TurningStudy, turning_study
from .continuous.events import play_by_events
from .continuous.plays import Event, EventPlay, Slide
from .continuous.sliding import SlidingStudy, sliding_study
from .every_check import verify
from .oracle.adapted import Adapted, Deviation, Index
from .oracle.indices import AdaptedWeights, adapted_weights
from .oracle.responses import BestResponse, best_responses
from .report import Check, Measurement, VerificationReport

__all__ = [
    "Adapted",
    "AdaptedWeights",
    "BestResponse",
    "CertificateRates",
    "Chatter",
    "Check",
    "Decentralised",
    "Deviation",
    "Event",
    "EventPlay",
    "Index",
    "Measurement",
    "Refinement",
    "Slide",
    "SlidingStudy",
    "StepStudy",
    "TableProof",
    "ThetaBound",
    "TurningStudy",
    "VerificationError",
    "VerificationReport",
    "adapted_weights",
    "best_responses",
    "certificate_rates",
    "chatter",
    "check_consistency",
    "check_decentral",
    "check_equilibrium",
    "check_gains",
    "check_geometry",
    "check_nafne",
    "check_record",
    "check_steps",
    "control_jumps",
    "decentralise",
    "gap_order",
    "index_distance",
    "lowest_curvature",
    "moved",
    "multistart",
    "off_the_line",
    "play_by_events",
    "prove_table",
    "radius_delay",
    "refine_batch",
    "relabelled",
    "riccati_defect",
    "sampling_gap",
    "sliding_study",
    "step_study",
    "theta_bound",
    "turning_study",
    "verify",
]
