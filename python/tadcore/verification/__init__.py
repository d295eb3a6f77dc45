"""The paper's theorems as things to run: whether it is Nash, for which indices, and whether a minimum is one.

`verify` runs every check on a scenario or on a run and returns a `VerificationReport`. The pieces can be called alone:

==========================  =====================================================================================
room                        what it answers
==========================  =====================================================================================
``fne``, ``responses``      does P solve its Riccati equation, and does anyone gain by deviating (thm:fbne,
                            thm:zero:sum:game)
``adapted``, ``nafne``      S, ΔQ^Ad, the indices J^Ad in continuous time and their identities (thm:thm1, thm:thm2)
``record``                  is the record what the equations say
``consistency``             full sight gives the equilibrium (thm:consistency); how far the indices are from the own
``gains``, ``objective``    gradient, curvature in full blocks, other starts, how often certificates hold
``bounds``                  a lower bound on Θ by semidefinite programming, and the gap (extra ``bounds``)
``geometry``                straight line (thm:straight_line), radius delay (thm:delayproperty), symmetries
``steps``                   δ, δ/2, δ/4: what depends on the step
``events``, ``sliding``     the continuous game by its event times, sliding modes included; how chattering tends to them
``externality``             the jump of every player's control at every change of the network
``decentral``               the synthesis as a protocol between players (rem:networkexternality)
==========================  =====================================================================================

Everything here is computed by NumPy and SciPy from the scenario's weights and the record.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from tadcore.errors import ScenarioError, VerificationError
from tadcore.game.chattering import Chatter, chatter
from tadcore.game.equilibrium import solve_equilibrium
from tadcore.game.externality import control_jumps
from tadcore.simulation.run import Run, simulate
from tadcore.verification.bound.bounds import ThetaBound, require_clarabel, theta_bound
from tadcore.verification.checks.adapted_nash import check_nafne, gap_order, sampling_gap
from tadcore.verification.checks.consistency import check_consistency, index_distance
from tadcore.verification.checks.decentral import Decentralised, check_decentral, decentralise
from tadcore.verification.checks.gains import (
    CertificateRates,
    certificate_rates,
    check_gains,
    lowest_curvature,
    multistart,
)
from tadcore.verification.checks.geometry import (
    check_geometry,
    moved,
    off_the_line,
    radius_delay,
    relabelled,
)
from tadcore.verification.checks.nash import check_equilibrium, riccati_defect
from tadcore.verification.checks.record import check_record
from tadcore.verification.checks.steps import (
    Refinement,
    StepStudy,
    check_steps,
    refine_batch,
    step_study,
)
from tadcore.verification.continuous.events import play_by_events
from tadcore.verification.continuous.plays import Event, EventPlay, Slide
from tadcore.verification.continuous.sliding import SlidingStudy, sliding_study
from tadcore.verification.oracle.adapted import Adapted, Deviation, Index
from tadcore.verification.oracle.indices import AdaptedWeights, adapted_weights
from tadcore.verification.oracle.responses import BestResponse, best_responses

from .report import Check, Measurement, VerificationReport, combine

if TYPE_CHECKING:
    from tadcore.scenario.model import Scenario

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
    "ThetaBound",
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
    "radius_delay",
    "refine_batch",
    "relabelled",
    "riccati_defect",
    "sampling_gap",
    "sliding_study",
    "step_study",
    "theta_bound",
    "verify",
]


def verify(
    sc_or_run: Scenario | Run,
    *,
    deviations: int = 2,
    instants: int = 20,
    starts: int = 0,
    seed: int = 0,
    bound: bool = False,
) -> VerificationReport:
    """Check the paper's theorems on a scenario or on a run.

    Parameters
    ----------
    sc_or_run : Scenario or Run
        A scenario, which is played first, or a run, which is checked as recorded.
    deviations : int
        Random admissible deviations of each player.
    instants : int
        At how many instants the Hessian of Θ is formed in full blocks.
    starts : int
        Random starts at each of those instants; none by default, since they take seconds.
    seed : int
        Key of the deviations and the starts.
    bound : bool
        Whether to bound Θ from below at those instants and report the gap; needs Clarabel, the extra ``bounds``.

    Returns
    -------
    VerificationReport
        Every check with its measured value, its bound and, where it fails, a remedy; ``require_ok()`` raises.

    Raises
    ------
    NoEquilibriumError
        The game has no equilibrium on [0, T].
    ScenarioError
        The argument is neither a scenario nor a run, or a run with hysteresis or dwell, or a bound is asked for and
        Clarabel is not installed.

    Examples
    --------
    >>> import tadcore
    >>> report = tadcore.verify(tadcore.scenarios.load("paper-i1"))
    >>> report.ok
    True
    >>> report["nafne.value.defenders"].accepted
    True
    """
    from tadcore.scenario.model import Scenario

    if not isinstance(sc_or_run, Scenario | Run):
        raise ScenarioError("sc_or_run", sc_or_run, "a Scenario or a Run")
    if bound:
        require_clarabel()
    if isinstance(sc_or_run, Run) and sc_or_run.variant:
        raise ScenarioError("sc_or_run", f"a run with {sc_or_run.variant}", "a run of the paper's game, without either")
    run = simulate(sc_or_run) if isinstance(sc_or_run, Scenario) else sc_or_run
    equilibrium = solve_equilibrium(run.scenario)
    title = f"{run.scenario.interaction}: {run.outcome}"
    parts = [check_equilibrium(run.scenario)]
    if len(run.times) < 2:
        note = "the game is over at t = 0: there is no play to check"
        return combine(title, [*parts, VerificationReport("run", (), notes=(note,))])
    parts += [
        check_record(run, equilibrium),
        check_nafne(run, equilibrium, deviations=deviations, seed=seed),
        check_consistency(run, equilibrium),
        check_gains(run, equilibrium, instants=instants, starts=starts, seed=seed, bound=bound),
        check_geometry(run, seed=seed),
        check_decentral(run),
        check_steps(run),
    ]
    return combine(title, parts)
