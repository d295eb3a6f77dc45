"""Theorems fbne and zero:sum:game: the feedback is a Nash equilibrium of the game in which everyone sees everything.

Two questions, each by SciPy and from the scenario's weights alone.

*Does P solve the Riccati equation?* Every P(t_{k+1}) is carried one step back by DOP853 and compared with P(t_k).

*Does anyone gain by deviating?* With the others' feedback frozen, each party's best response is known exactly
(`tadcore.verification.best_responses`); at an equilibrium it saves nothing.
"""

from __future__ import annotations

import numpy as np

from tadcore._shared.arrays import Floats
from tadcore.game.equilibrium import solve_equilibrium
from tadcore.scenario.model import Scenario
from tadcore.verification.oracle.flow import riccati_within
from tadcore.verification.oracle.matrices import FeedbackSolution, matrices_of, stacked_rows
from tadcore.verification.oracle.responses import REGRET, BestResponse, best_responses, is_smooth
from tadcore.verification.report import Check, Measurement, VerificationReport, number

_FEWEST, _MOST = 800, 6400
_DEFECT, _TERMINAL, _FEEDBACK, _RECEDING = 1e-10, 1e-14, 1e-12, 1e-9
_COARSEST = 50


def riccati_defect(sc: Scenario, equilibrium: FeedbackSolution) -> dict[str, Floats]:
    """How far P(t_k) is from P(t_{k+1}) carried back one step, by party.

    Parameters
    ----------
    sc : Scenario
        The game.
    equilibrium : Equilibrium
        P on the grid.

    Returns
    -------
    dict of str to ndarray, shape (K,)
        Largest entry of the difference at every step, relative to the largest of the party's P on it; inf
        throughout where the flow breaks down.
    """
    m = matrices_of(sc)
    values = m.values(equilibrium.P)
    found = riccati_within(m, values[:, 1:], sc.horizon / sc.steps)
    if found is None:
        return {party: np.full(sc.steps, np.inf) for party in m.parties}
    off = np.abs(found[1] - values[:, :-1]).max(axis=(2, 3))
    scale = np.maximum(np.abs(values[:, :-1]).max(axis=(2, 3)), np.abs(values[:, 1:]).max(axis=(2, 3)))
    relative = np.divide(off, scale, out=np.where(off > 0, np.inf, 0.0), where=scale > 0)
    return dict(zip(m.parties, relative, strict=True))


def check_equilibrium(
    sc: Scenario, equilibrium: FeedbackSolution | None = None, *, refine: bool | None = None
) -> VerificationReport:
    """Check that a Riccati solution solves its equations and that its feedback is a Nash equilibrium.

    Parameters
    ----------
    sc : Scenario
        The game and its initial state.
    equilibrium : Equilibrium, optional
        What to check; `tadcore.solve_equilibrium` of the scenario by default.
    refine : bool, optional
        Whether the regret may be that of the library's solution at more instants, where the grid is too coarse to play
        between its instants; by default only if `equilibrium` is not given.

    Returns
    -------
    VerificationReport
        Riccati defect and terminal value, feedback rows, and the regret of each party relative to what it pays. With a
        receding horizon all of that of the finite game up to the prediction horizon, and that P is its P(0) throughout.
    """
    eq = solve_equilibrium(sc) if equilibrium is None else equilibrium
    if sc.feedback == "receding":
        return _receding(sc, eq)
    refine = equilibrium is None if refine is None else refine
    m = matrices_of(sc)
    values = m.values(eq.P)
    rows = stacked_rows(eq.feedback, sc.players)
    theorem = "thm:fbne" if sc.interaction == "I1" else "thm:zero:sum:game"
    riccati, law = ("eq:Riccati", "eq:1d") if sc.interaction == "I1" else ("eq:RDE", "eq:zero_sum_control1, 2")
    checks, followed = [], True
    for party, defect in riccati_defect(sc, eq).items():
        k = int(np.argmax(defect))
        remedy = "P does not solve its equation there: solve the equilibrium again, and report this scenario"
        value = float(defect[k])
        followed &= value < np.inf
        where = f"t = {float(eq.times[k]):.6g}" if value < np.inf else "the flow inside a step is too stiff to follow"
        checks.append(Check(f"fne.riccati.{party}", value, _DEFECT, value < np.inf, remedy, riccati, where))
    terminal = float(np.abs(values[:, -1] - m.F).max() / np.abs(m.F).max())
    remedy = "P(T) must be the terminal weights"
    checks.append(Check("fne.terminal", terminal, _TERMINAL, True, remedy, f"{theorem}, P(T) = F"))
    given = m.rows(values)
    off = np.abs(rows - given).max(axis=(1, 2)) / np.maximum(np.abs(given).max(axis=(1, 2)), 1e-300)
    k = int(np.argmax(off))
    remedy = "the feedback must be that of P, u = -R⁻¹BᵀPz"
    checks.append(Check("fne.feedback", float(off[k]), _FEEDBACK, True, remedy, law, f"t = {eq.times[k]:.6g}"))
    measured = []
    for found in _responses(sc, rows, refine=refine, followed=followed):
        remedy = f"{found.party} gain by deviating: this feedback is no equilibrium of this game"
        name, where = f"fne.regret.{found.party}", f"J = {number(found.cost)}"
        checks.append(Check(name, abs(found.relative), REGRET, found.converged, remedy, theorem, where))
        measured.append(
            Measurement(f"fne.J.{found.party}", found.cost, "cost of the equilibrium from this start, to T")
        )
    return VerificationReport(f"equilibrium of {sc!r}", tuple(checks), tuple(measured))


def predicted(sc: Scenario) -> Scenario:
    """The finite game up to the prediction horizon, whose P(0) a receding one plays throughout."""
    ahead = sc.prediction_horizon or sc.horizon
    steps = max(int(np.ceil(ahead / sc.step - 1e-9)), _COARSEST)
    return sc.replace({"feedback": None, "prediction_horizon": None, "horizon": ahead, "step": ahead / steps})


def _receding(sc: Scenario, eq: FeedbackSolution) -> VerificationReport:
    """The checks of the finite game ahead, and P and the feedback at every instant against its beginning."""
    finite, m = predicted(sc), matrices_of(sc)
    ahead = solve_equilibrium(finite)
    report = check_equilibrium(finite, ahead, refine=True)
    values, first = m.values(eq.P), m.values(ahead.P)[:, :1]
    rows, given = stacked_rows(eq.feedback, sc.players), m.rows(first)
    parts = {
        "fne.receding": (np.abs(values - first).max(axis=(2, 3)) / np.abs(first).max(axis=(2, 3))).max(axis=0),
        "fne.receding.feedback": np.abs(rows - given).max(axis=(1, 2)) / np.maximum(np.abs(given).max(), 1e-300),
    }
    remedy = "at every instant P must be that at the beginning of a game as long as the prediction horizon"
    checks = list(report)
    for name, off in parts.items():
        k = int(np.argmax(off))
        checks.append(Check(name, float(off[k]), _RECEDING, True, remedy, "", f"t = {eq.times[k]:.6g}"))
    return VerificationReport(f"equilibrium of {sc!r}", tuple(checks), report.measurements)


def _responses(sc: Scenario, rows: Floats, *, refine: bool, followed: bool) -> tuple[BestResponse, ...]:
    """The best responses to the feedback, at more instants where the grid needs them; nan where P(t) is too stiff."""
    if not followed:  # what P does inside a step is not known: there is nothing to respond to
        return tuple(BestResponse(party, np.nan, np.nan, False, np.nan) for party in matrices_of(sc).parties)
    fine = sc
    while refine and (fine.steps < _FEWEST or (fine.steps < _MOST and not is_smooth(fine, rows))):
        # the same equilibrium at more instants, to play between them
        fine = sc.replace(step=sc.horizon / (sc.steps * -(-max(2 * fine.steps, _FEWEST) // sc.steps)))
        rows = stacked_rows(solve_equilibrium(fine).feedback, sc.players)
    return best_responses(fine, rows)
