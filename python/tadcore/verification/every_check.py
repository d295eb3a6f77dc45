"""Every check of this package on one scenario or run, in one report."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np

from tadcore._shared.arrays import as_flag, as_index, as_seed
from tadcore._shared.calls import public
from tadcore.errors import NoEquilibriumError, ScenarioError, TadcoreError
from tadcore.game.equilibrium import Equilibrium, solve_equilibrium
from tadcore.scenarios.given import ScenarioLike, as_scenario
from tadcore.simulation.play import simulate
from tadcore.simulation.run import Run

from .bound.bounds import require_clarabel
from .checks.adapted_nash import check_nafne
from .checks.claims import BY_POSITIONS_ALONE
from .checks.consistency import check_consistency
from .checks.decentral import check_decentral
from .checks.ending import stops_early
from .checks.gains import check_gains
from .checks.geometry import check_geometry
from .checks.nash import check_equilibrium
from .checks.record import check_record, check_rows
from .checks.steps import check_steps
from .checks.turning import check_turning
from .report import Check, VerificationReport, combine, unresolved

_MOST = 10**6


@public
def verify(
    sc_or_run: ScenarioLike | Run,
    *,
    deviations: int = 2,
    instants: int = 20,
    starts: int = 0,
    seed: int = 0,
    bound: Literal[0, 1, 2] | bool = 0,
    turning: bool = False,
) -> VerificationReport:
    """Check the paper's theorems on a scenario or on a run.

    Parameters
    ----------
    sc_or_run : Scenario, path, name or Run
        A scenario, which is played first, or a run, which is checked as recorded.
    deviations : int
        Random admissible deviations of each player.
    instants : int
        At how many instants the Hessian of Θ is formed in full blocks.
    starts : int
        Random starts at each of those instants; none by default, since they take seconds.
    seed : int
        Key of the deviations and the starts, at least 0 and below 2⁶⁴.
    bound : {0, 1, 2} or bool
        Order of the relaxation that bounds Θ from below and reports the gap. 0 or False: none. 1 or True: at those
        instants, in milliseconds each; needs Clarabel, the extra ``bounds``. 2: at every instant, each bound proved in
        exact arithmetic; the paper's runs take minutes, and an instant at which more than 9 unknowns do not decouple
        is counted as not tried.
    turning : bool
        Whether to search for gains that turn, aI + bJ, at each instant of a run in the plane at which no certificate
        covers them: it takes seconds. Their gap to the scalar gains is measured, and the game is played with them and
        with their mirror images, too (``tadcore.simulate(…, gains="turning")``).

    Returns
    -------
    VerificationReport
        Every check with its measured value, its bound and, where it fails, a remedy; ``require_ok()`` raises. Its
        ``status`` is ``"undecided"`` where nothing fails and something could not be measured well enough: a game too
        stiff to follow, states that overflow.

    Raises
    ------
    NoEquilibriumError
        The game has no equilibrium on [0, T].
    ScenarioError
        The first argument is neither a scenario nor a run, or it is a variant of the game (`Run.variant`): with
        hysteresis or dwell, continuous termination, turning gains or a network from outside; a count or the seed is out
        of its range; or a bound of order one is asked for and Clarabel is not installed.

    Examples
    --------
    >>> import tadcore
    >>> report = tadcore.verify(tadcore.scenarios.load("paper-i1"))
    >>> report.status
    'passed'
    >>> report["nafne.value.defenders"].accepted
    True
    """
    given = sc_or_run if isinstance(sc_or_run, Run) else as_scenario(sc_or_run)
    asked = _Asked.checked(deviations, instants, starts, seed, bound, turning)
    if asked.bound == 1:
        require_clarabel()
    if isinstance(given, Run) and given.variant:
        raise ScenarioError("sc_or_run", f"a run with {given.variant}", "a run of the paper's game, without any")
    sc = given.scenario if isinstance(given, Run) else given
    try:
        run = given if isinstance(given, Run) else simulate(given)
        equilibrium = solve_equilibrium(sc)
    except (NoEquilibriumError, ScenarioError):
        raise
    except TadcoreError as error:
        return combine(f"{sc.interaction}: not played", [_undecided("play", error)])
    return _verified(run, equilibrium, asked)


class _Asked(NamedTuple):
    """What `verify` is asked for; its parameters."""

    deviations: int
    instants: int
    starts: int
    seed: int
    bound: int
    turning: bool

    @classmethod
    def checked(
        cls, deviations: object, instants: object, starts: object, seed: object, bound: object, turning: object
    ) -> _Asked:
        """From anything; raises `ScenarioError`."""
        counts = {"deviations": deviations, "instants": instants, "starts": starts}
        whole = {name: as_index(name, count, _MOST) for name, count in counts.items()}
        key, turns = as_seed(seed), as_flag("turning", turning)
        if not isinstance(bound, int | np.integer) or bound not in (0, 1, 2):
            raise ScenarioError("bound", bound, "0, 1 or 2: the order of the relaxation")
        return cls(**whole, seed=key, bound=int(bound), turning=turns)


def _verified(run: Run, equilibrium: Equilibrium, asked: _Asked) -> VerificationReport:
    """Every check on a run that was played, or those that mean anything for it."""
    sc, title = run.scenario, f"{run.scenario.interaction}: {run.outcome}"
    if run.diverged is not None and stops_early(run):
        why = f"the game {run.diverged}: it leaves the range of double precision after t = {run.times[-1]:g}"
        return combine(title, [_family("record", lambda: check_rows(run)), _undecided("play", TadcoreError(why))])
    parts = [
        _family("fne", lambda: check_equilibrium(sc, equilibrium, refine=True)),
        _family("record", lambda: check_record(run, equilibrium)),
    ]
    whole = next((check for check in parts[1] if check.name == "record.arrays"), None)
    if whole is not None and not whole.ok:
        note = "the record is not whole: nothing else can be checked of it"
        return combine(title, [*parts, VerificationReport("run", (), notes=(note,))])
    if len(run.times) < 2:
        note = "the game is over at t = 0: there is no play to check"
        return _settled(combine(title, [*parts, VerificationReport("run", (), notes=(note,))]))
    of_gains = {"instants": asked.instants, "starts": asked.starts, "seed": asked.seed, "bound": asked.bound}
    parts += [
        _adapted(run, equilibrium, asked),
        _family("consistency", lambda: check_consistency(run, equilibrium)),
        _family("gains", lambda: check_gains(run, equilibrium, **of_gains)),
        *([_family("turning", lambda: check_turning(run))] if asked.turning else []),
        _family("geometry", lambda: check_geometry(run, seed=asked.seed)),
        _family("decentral", lambda: check_decentral(run)),
        _steps(run),
    ]
    return _settled(combine(title, parts))


def _adapted(run: Run, equilibrium: Equilibrium, asked: _Asked) -> VerificationReport:
    """The network-adapted equilibrium, where the theorems claim anything of it."""
    if run.scenario.feedback == "receding":
        note = (
            "nafne: the theorems are of P(t) that solves its equation up to T; of a receding horizon nothing is claimed"
        )
        return VerificationReport("nafne", (), notes=(note,))
    if run.diverged is not None:
        error = ArithmeticError(f"the game {run.diverged}: deviations from it decide nothing")
        return _undecided("nafne", error)
    return _family("nafne", lambda: check_nafne(run, equilibrium, deviations=asked.deviations, seed=asked.seed))


def _steps(run: Run) -> VerificationReport:
    """Smaller steps, where they are of the same game."""
    if run.scenario.is_random:
        note = "steps: another step draws other failures and disturbances, so δ/2 and δ/4 are other games"
        return VerificationReport("steps", (), notes=(note,))
    return _family("steps", lambda: check_steps(run))


def _family(name: str, check: Callable[[], VerificationReport]) -> VerificationReport:
    """The checks of one module, or one undecided check where they cannot be computed."""
    try:
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # what is not finite decides nothing
            return check()
    except (ArithmeticError, np.linalg.LinAlgError, TadcoreError) as error:
        return _undecided(name, error)


def _undecided(name: str, error: Exception) -> VerificationReport:
    """What remains of checks that cannot be computed."""
    remedy = "the numerics do not reach that far: take a smaller step, a shorter horizon or less extreme weights"
    return VerificationReport(name, (Check(name, np.inf, 0.0, False, remedy, "", str(error)),))


def _settled(report: VerificationReport) -> VerificationReport:
    """The same report, undecided by whatever reads P(t) where P(t) could not be followed from node to node."""
    if all(check.converged for check in report if check.name.startswith("fne.riccati.")):
        return report
    why = "P(t) is not confirmed"
    checks = tuple(
        unresolved(check, why) if check.status == "failed" and check.name not in BY_POSITIONS_ALONE else check
        for check in report
    )
    return VerificationReport(report.title, checks, report.measurements, report.notes)
