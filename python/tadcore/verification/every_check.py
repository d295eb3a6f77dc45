"""Every check of this package on one scenario or run, in one report."""

from __future__ import annotations

from tadcore.errors import ScenarioError
from tadcore.game.equilibrium import solve_equilibrium
from tadcore.scenario.model import Scenario
from tadcore.simulation.run import Run, simulate

from .bound.bounds import require_clarabel
from .checks.adapted_nash import check_nafne
from .checks.consistency import check_consistency
from .checks.decentral import check_decentral
from .checks.gains import check_gains
from .checks.geometry import check_geometry
from .checks.nash import check_equilibrium
from .checks.record import check_record
from .checks.steps import check_steps
from .report import VerificationReport, combine


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
