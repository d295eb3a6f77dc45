"""The record against the equations: every array and every number of a run, recomputed from the scenario and P(t).

`tadcore.verification.checks.claims` has the table of what is claimed; NumPy alone decides all of it but
``record.synthesis``, which asks the library's own synthesis.
"""

from __future__ import annotations

import numpy as np

from tadcore.game.recorded import scalar_gains
from tadcore.simulation.run import Run
from tadcore.verification.oracle.matrices import FeedbackSolution, matrices_of, stacked_rows
from tadcore.verification.oracle.optimality import optimality
from tadcore.verification.report import VerificationReport

from .around import check_around
from .arrays import check_arrays
from .certificates import check_certified, check_synthesis
from .ending import check_divergence, check_outcome, check_start, check_times
from .motion import check_costs, check_motion
from .strategies import check_admissible, check_control, check_last_row, check_network, check_theta


def check_record(run: Run, equilibrium: FeedbackSolution) -> VerificationReport:
    """Check everything that a run records against what defines it.

    Parameters
    ----------
    run : Run
        The run.
    equilibrium : Equilibrium
        The scenario's Riccati solution.

    Returns
    -------
    VerificationReport
        Start, instants and end from the scenario; the network from the distances, and from the draws of its trial where
        something fails or is told; gains within what the network shows,
        controls, motion, Θ and costs from the gains and P; the terminal row; the number of proofs. Of a record that is
        not whole, only that.
    """
    whole = check_arrays(run)
    if not whole.ok:
        return VerificationReport("record", (whole,))
    m, length = matrices_of(run.scenario), len(run.times)
    values = m.values(equilibrium.P)[:, :length]
    rows = stacked_rows(equilibrium.feedback, run.scenario.players)[:length]
    rows[:, : scalar_gains(run).shape[1]] = scalar_gains(run)
    checks = [whole, check_start(run), check_times(run), check_outcome(run), check_divergence(run)]
    checks += [check_network(run)] if run.course is None else check_around(run)
    checks += [check_admissible(run)]
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows decides nothing
        if length > 1:
            checks += [*check_motion(run, m, rows), check_control(run, rows), check_theta(run, m, values)]
        found = optimality(run.scenario, m, values, run.adjacency, scalar_gains(run))
        checks += [check_costs(run, m, rows), check_last_row(run, m, values, rows, found)]
        checks += [check_certified(run, found), check_synthesis(run)]
    return VerificationReport("record", tuple(checks))


def check_rows(run: Run) -> VerificationReport:
    """Check a record that stops before its end, as of a game that leaves the range of double precision.

    Parameters
    ----------
    run : Run
        The run.

    Returns
    -------
    VerificationReport
        Start, instants, divergence, network and gains within sight; nothing that may overflow.
    """
    whole = check_arrays(run)
    if not whole.ok:
        return VerificationReport("record", (whole,))
    checks = (check_start(run), check_times(run), check_divergence(run), check_network(run), check_admissible(run))
    return VerificationReport("record", (whole, *checks))
