"""The gains as minimisers of Θ: first order everywhere, second order in full blocks, other starts on request.

Of three questions the first two have an answer. *Critical?* The gradient (eq:errgradient) at every instant. *A local
minimum?* The Hessian with every block free, its exact smallest eigenvalue. *The global one?* Where the solver holds a
certificate it is proved; elsewhere `multistart` searches for something lower and `theta_bound` says how much lower any
gains could be.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.sparse.linalg import LinearOperator, eigsh

from tadcore._shared.arrays import Floats
from tadcore.game.changes import changed_rows
from tadcore.game.equilibrium import solve_equilibrium
from tadcore.game.recorded import scalar_gains
from tadcore.game.synthesis import synthesize
from tadcore.scenarios.given import ScenarioLike, as_scenario
from tadcore.simulation.run import Run
from tadcore.verification.bound.along import bound_along
from tadcore.verification.bound.bounds import ThetaBound, bound_theta, require_clarabel
from tadcore.verification.oracle.draws import generator
from tadcore.verification.oracle.matrices import FeedbackSolution, matrices_of
from tadcore.verification.oracle.objective import FullObjective
from tadcore.verification.oracle.optimality import CRITICAL, optimality
from tadcore.verification.report import Check, Measurement, VerificationReport

_CURVATURE, _LOWER, _BELOW, _TIGHT = 1e-9, 1e-8, 1e-10, 1e-6
_DENSE = 400


def lowest_curvature(objective: FullObjective, x: Floats) -> tuple[float, float]:
    """The smallest and the largest eigenvalue of ∇²Θ over all block directions; (0, 0) where nobody sees anyone."""
    size = objective.unknowns
    if size == 0:
        return 0.0, 0.0
    if size <= _DENSE:
        spectrum = np.linalg.eigvalsh(objective.hessian_product(x, np.eye(size)))
        return float(spectrum[0]), float(spectrum[-1])
    product = LinearOperator((size, size), matvec=lambda v: objective.hessian_product(x, v), dtype=np.float64)
    start = np.ones(size)
    ends = [eigsh(product, k=1, which=w, v0=start, return_eigenvectors=False)[0] for w in ("SA", "LA")]
    return float(ends[0]), float(ends[1])


def multistart(objective: FullObjective, x: Floats, starts: int, rng: np.random.Generator) -> float:
    """The lowest Θ that SciPy's BFGS finds from random starts of the size of ``x``; inf for none."""
    size = max(float(np.abs(x).max(initial=0.0)), 1.0)
    best = np.inf
    for _ in range(starts if objective.unknowns else 0):
        found = minimize(
            objective.theta,
            rng.normal(scale=size, size=objective.unknowns),
            jac=objective.gradient,
            method="BFGS",
            options={"gtol": 1e-10, "maxiter": 2000},
        )
        best = min(best, float(found.fun))
    return best


def check_gains(
    run: Run, equilibrium: FeedbackSolution, *, instants: int = 20, starts: int = 0, seed: int = 0, bound: int = 0
) -> VerificationReport:
    """Check that the gains of a run minimise Θ.

    Parameters
    ----------
    run : Run
        The run.
    equilibrium : Equilibrium
        The scenario's Riccati solution.
    instants : int
        At how many instants the Hessian is formed: the first under each network, then spread evenly.
    starts : int
        Random starts at each of those instants; none by default, since they take seconds.
    seed : int
        Key of the starts.
    bound : {0, 1, 2}
        Order of the relaxation that bounds Θ from below: 0 none; 1 at each of those instants, with the extra
        ``bounds``; 2 at every instant, proved exactly, where at most 9 unknowns do not decouple.

    Returns
    -------
    VerificationReport
        Solver status, gradients at every instant, curvature in full blocks, what random starts found, and the gap to
        the lower bound.

    Raises
    ------
    ScenarioError
        A bound is asked for and Clarabel is not installed.
    """
    if bound == 1:
        require_clarabel()
    sc, length = run.scenario, len(run.times) - 1
    m = matrices_of(sc)
    values = m.values(equilibrium.P)
    remedy = "the solver stopped short: synthesize the instant again and report the scenario"
    unconverged = float(run.unconverged)
    checks = [Check("gains.solver", unconverged, 0.0, True, remedy, _label(run), "instants short of the tolerance")]
    slopes = optimality(sc, m, values[:, :length], run.adjacency[:length], scalar_gains(run)[:length]).gradient
    at = int(np.argmax(slopes))
    steepest = float(slopes[at])
    remedy = "the gains are not critical points of Θ: they are not what the synthesis gives"
    where = f"t = {run.times[at]:.6g}"
    checks.append(Check("gains.gradient", steepest, CRITICAL, True, remedy, "eq:errgradient", where))
    chosen = _instants(run, instants)
    checks += _local_minima(run, values, chosen, starts, seed)
    share = run.certified / len(run.times)
    measured = [Measurement("gains.certified", share, "share of rows whose gains are proved globally optimal")]
    if bound:
        bounded, found = _bounded(run, values, chosen) if bound == 1 else _bounded_by_proof(run, values)
        checks += bounded
        measured += found
    return VerificationReport("gains", tuple(checks), tuple(measured))


def _label(run: Run) -> str:
    """Where the paper has the problem that the gains solve."""
    return "eq:optproblem" if run.scenario.interaction == "I1" else "eq:optproblem2"


def _local_minima(run: Run, values: Floats, chosen: NDArray[np.int_], starts: int, seed: int) -> list[Check]:
    """Curvature in full blocks, and what random starts find there."""
    sc, m = run.scenario, matrices_of(run.scenario)
    flattest, lower, worst, where_lower = np.inf, 0.0, 0.0, 0
    for k in chosen:
        objective = FullObjective(sc, m, values[:, k], run.adjacency[k], team=True)
        x = objective.blocks(scalar_gains(run)[k])
        low, high = lowest_curvature(objective, x)
        if high > 0:
            flattest = min(flattest, low / high)
        if starts and objective.unknowns:
            here = objective.theta(x)
            rng = generator(seed, k)
            lower = float(here - multistart(objective, x, starts, rng)) / max(here, 1e-10 * objective.theta(0.0 * x))
            if lower > worst:
                worst, where_lower = lower, k
    checks = []
    if np.isfinite(flattest):
        remedy = "a saddle of Θ: the gains can be improved in directions outside the Kronecker form"
        value = max(0.0, -flattest)
        detail = f"smallest over largest {flattest:.2g}, {len(chosen)} instants"
        checks.append(Check("gains.curvature", value, _CURVATURE, True, remedy, _label(run), detail))
    if starts:
        remedy = "a start in full blocks went lower: blocks that turn do better there, or a worse minimum was taken"
        where = f"{starts} starts at each of {len(chosen)} instants" + (
            f", t = {run.times[where_lower]:.6g}" if worst else ""
        )
        checks.append(Check("gains.multistart", worst, _LOWER, True, remedy, _label(run), where))
    return checks


def _bounded(run: Run, values: Floats, chosen: NDArray[np.int_]) -> tuple[list[Check], list[Measurement]]:
    """Bounds of order one, over all rows: Θ under the team criterion lies above them, too."""
    sc, m = run.scenario, matrices_of(run.scenario)
    bounds = [
        bound_theta(FullObjective(sc, m, values[:, k], run.adjacency[k], dim=1), float(run.theta[k]))
        for k in chosen.tolist()
    ]
    found = f"largest (Θ - lower bound)/Θ of {len(bounds)} instants, {sum(b.tight for b in bounds)} of them tight"
    return [_below(bounds, [float(run.theta[k]) for k in chosen], _label(run))], [_gap(bounds, found)]


def _bounded_by_proof(run: Run, values: Floats) -> tuple[list[Check], list[Measurement]]:
    """Bounds of order two, wherever one is proved."""
    along = bound_along(run, values)
    bounds = list(along.bounds.values())
    proved = Measurement("gains.proved", along.share, along.words)
    if not bounds:
        return [], [proved]
    below = _below(bounds, [float(run.theta[k]) for k in along.bounds], _label(run))
    missed = max((b.relative_gap for b in bounds if b.lower is not None), default=0.0)
    remedy = "gains with a lower Θ exist: report the scenario, since the search has missed them"
    where = f"{sum(b.lower is not None for b in bounds)} of {len(bounds)} instants"
    check = Check("gains.missed", missed, _TIGHT, True, remedy, _label(run), where)
    return [below, check], [_gap(bounds, f"largest (Θ - proved bound)/Θ of {len(bounds)} instants"), proved]


def _gap(bounds: Sequence[ThetaBound], found: str) -> Measurement:
    """The widest gap."""
    widest = max(bounds, key=lambda b: b.relative_gap)
    meaning = f"{found}; there Θ = {widest.theta:.6g}, gap {widest.gap:.3g}"
    return Measurement("gains.gap", max(widest.relative_gap, 0.0), meaning)


def _below(bounds: Sequence[ThetaBound], recorded: Sequence[float], label: str) -> Check:
    """Whether no bound lies above the Θ recorded: one that does is wrong, or the Θ is."""
    above = max((b.value - theta) / max(b.scale, 1e-300) for b, theta in zip(bounds, recorded, strict=True))
    remedy = "Θ lies below a proved lower bound: Θ is not that of gains which the network allows"
    ended = sorted({b.status for b in bounds})
    usable = all(np.isfinite(b.value) for b in bounds)
    return Check("gains.bound", max(above, 0.0), _BELOW, usable, remedy, label, f"solver: {', '.join(ended)}")


def _instants(run: Run, most: int) -> NDArray[np.int_]:
    """The first instant under each network, then instants spread over the run, at most ``most``."""
    length = len(run.times) - 1
    first = np.concatenate([[0], changed_rows(run.adjacency[:length])])
    if len(first) > most:  # a network that chatters
        first = first[np.linspace(0, len(first) - 1, most).astype(int)]
    spread = np.linspace(0, length - 1, max(most - len(first), 0)).astype(int)
    return np.unique(np.concatenate([first, spread]).astype(int))


@dataclass(frozen=True)
class CertificateRates:
    """In how many random instants each claim about optimality holds.

    Attributes
    ----------
    trials : int
        Random (instant, network) pairs.
    converged : int
        Solver within its tolerance.
    certified : int
        Proved globally optimal.
    curved : int
        Smallest curvature in full blocks not below rounding.
    beaten : int
        A random start went lower.
    beaten_certified : int
        … although the minimum was certified: the proof would be wrong.
    starts : dict of str to int
        Starting points of the descents that found the minima.
    """

    trials: int
    converged: int
    certified: int
    curved: int
    beaten: int
    beaten_certified: int
    starts: dict[str, int]


def certificate_rates(sc: ScenarioLike, *, trials: int = 200, starts: int = 0, seed: int = 0) -> CertificateRates:
    """Draw instants and networks of one game at random and count the instants at which each claim holds.

    Parameters
    ----------
    sc : Scenario, path or name
        The game.
    trials : int
        How many pairs; instants are uniform on the grid, networks have a density uniform in [0, 1].
    starts : int
        Random starts in full blocks for each pair.
    seed : int
        Key of all draws; trial i depends on (seed, i) alone.

    Returns
    -------
    CertificateRates
        The counts.
    """
    sc = as_scenario(sc)
    m = matrices_of(sc)
    values = m.values(solve_equilibrium(sc).P)
    shape = (len(sc.constrained), sc.n + 1)
    counts = dict.fromkeys(("converged", "certified", "curved", "beaten", "beaten_certified"), 0)
    found_from: dict[str, int] = {}
    for trial in range(trials):
        rng = generator(seed, trial)
        k, adjacency = int(rng.integers(sc.steps + 1)), rng.random(shape) < rng.random()
        found = synthesize(sc, step=k, adjacency=adjacency)
        objective = FullObjective(sc, m, values[:, k], adjacency, team=True)
        x = objective.blocks(found.rows)
        low, high = lowest_curvature(objective, x)
        best = multistart(objective, x, starts, rng)
        beaten = bool(best < found.theta - _LOWER * max(found.theta, 1e-10 * objective.theta(0.0 * x)))
        counts["converged"] += found.converged
        counts["certified"] += found.certified
        counts["curved"] += bool(low >= -_CURVATURE * high)
        counts["beaten"] += beaten
        counts["beaten_certified"] += beaten and found.certified
        found_from[found.start] = found_from.get(found.start, 0) + 1
    return CertificateRates(trials, **counts, starts=dict(sorted(found_from.items())))
