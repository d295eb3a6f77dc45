"""A lower bound on Θ over all gains that a network allows, and the gap it leaves: relaxations of order one and two.

Order one
---------

Θ is γ₁‖GᵀRG - M‖² plus a sum of squares ‖Ax - b‖² of expressions linear in the unknowns x of G (eq:errfun1,
eq:errfun2). For every symmetric Y of N × N, ‖GᵀRG - M‖² ≥ 2⟨Y, GᵀRG - M⟩ - ‖Y‖². So Θ lies above a quadratic function
of x and, where its matrix H(Y) = AᵀA + 2γ₁D(Y) is positive definite, above

    β(Y) = ‖b‖² - 2γ₁⟨Y, M⟩ - γ₁‖Y‖² - hᵀH(Y)⁻¹h,   h = Aᵀb,   xᵀD(Y)x = ⟨Y, GᵀRG⟩.

The largest β is a semidefinite program in Y alone, N(N + 1)/2 unknowns: the dual of Shor's relaxation, which puts any X
with X - xxᵀ positive semidefinite in place of xxᵀ. Clarabel solves it. β is then evaluated anew by NumPy at its Y,
moved towards the identity where H is not positive definite, so the bound holds up to rounding however accurate the
solver was.

- At a critical point with residual X*, β(X*) = Θ* exactly where H(X*) is positive semidefinite. That is the certificate
  of the synthesis (`tadcore.Gains.certified`): the bound is tight if and only if some minimiser can be certified.
- The library's gains are scalars, one for each player seen. The paper's are blocks of dim × dim. Split into a multiple
  of the identity, a symmetric part without trace and an antisymmetric one, and averaged over all rotations, blocks keep
  the terms linear in them and can only lower the convex ones. So Θ/dim ≥ β there too, if Y also makes the quadratic
  form of antisymmetric blocks positive definite. In I2 the two forms are the same; in I1 they are not, since ΔQ_τ and
  ΔQ_a are X + Xᵀ and the transpose of an antisymmetric block is its negative. ``blocks=True`` asks for this.
- Where a gap is left nothing is proved: a minimum may be global all the same.

Order two
---------
Θ less the bound is written as a sum of squares of polynomials of degree two, and that is checked in whole numbers
(`tadcore.verification.bound.proof`): a bound of this order is *proved*, for the polynomial Θ whose coefficients are
made of the doubles P(t_k), r and γ without rounding. It holds for scalar gains. It needs no solver but NumPy's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from importlib.util import find_spec
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import minimize

from tadcore._shared.arrays import Floats, as_adjacency, as_index
from tadcore.errors import MISSING, ScenarioError
from tadcore.game.equilibrium import solve_equilibrium
from tadcore.game.network import VisibilityNetwork
from tadcore.game.synthesis import synthesize
from tadcore.scenarios.given import ScenarioLike, as_scenario
from tadcore.verification.oracle.matrices import matrices_of
from tadcore.verification.oracle.objective import FullObjective

from .proof import Proof
from .relaxation import Form, solve
from .second_order import largest_group, relax

_TIGHT = 1e-6
_FLOOR = 1e-6
_LOWER = 1e-9
MOST_UNKNOWNS = 14
"""Of a group that shares no monomial with the others: with more, the relaxation of order two takes gigabytes."""


@dataclass(frozen=True)
class ThetaBound:
    """A lower bound on Θ at one (instant, network) beside the best value known.

    Attributes
    ----------
    value : float
        The bound, in reduced norms like ``Gains.theta``; no gains of the kind asked for have a smaller Θ. -inf where
        the solver returned nothing usable, or, with order two, nothing that could be proved.
    theta : float
        Θ of the gains that are compared with it; with order two rounded up from its exact value.
    scale : float
        Θ of standing still, G = 0: what rounding in the bound is relative to.
    status : str
        How the solver ended: Clarabel's word, such as ``"Solved"``, or ``"closed form"`` where no solver is needed.
        With order two ``"proved"`` or ``"not proved"``: what the exact check said.
    iterations : int
        Steps of the solver.
    multiplier : ndarray, shape (N, N), or None
        Y, at which the bound of order one can be evaluated again.
    order : {1, 2}
        Of the relaxation.
    proof : Proof or None
        What order two proves the bound by; ``proof.holds()`` checks it again, exactly.
    lower : ndarray, shape (m, N), or None
        Gain rows with a lower Θ, where order two found some: the bound is then that of their Θ, and the search that
        gave the gains has missed them.
    """

    value: float
    theta: float
    scale: float
    status: str
    iterations: int
    multiplier: Floats | None = field(repr=False)
    order: Literal[1, 2] = 1
    proof: Proof | None = field(default=None, repr=False)
    lower: Floats | None = field(default=None, repr=False)

    @property
    def gap(self) -> float:
        """Θ less the bound: at most this much could still be gained. Negative by rounding only."""
        return self.theta - self.value

    @property
    def relative_gap(self) -> float:
        """The gap over Θ, or over a millionth of ``scale`` where Θ is smaller than that."""
        return self.gap / max(self.theta, _FLOOR * self.scale, 1e-300) if self.gap else 0.0

    @property
    def tight(self) -> bool:
        """Whether the relative gap is below 1e-6: Θ is the global minimum to that accuracy.

        With order one up to the rounding of the bound; with order two by an exact proof.
        """
        return self.relative_gap < _TIGHT

    @property
    def proved(self) -> bool:
        """Whether the bound has passed an exact check, which only that of order two can."""
        return self.proof is not None


def theta_bound(
    sc: ScenarioLike,
    *,
    step: int,
    adjacency: ArrayLike | VisibilityNetwork,
    blocks: bool = False,
    order: Literal[1, 2] = 1,
) -> ThetaBound:
    """Bound Θ from below at instant t_k under a network, and compare it with the gains of `tadcore.synthesize`.

    Parameters
    ----------
    sc : Scenario, path or name
        The game.
    step : int
        k of the instant t_k, 0 … K.
    adjacency : array_like, shape (m, N), or VisibilityNetwork
        𝒜: row i whom player i sees, entry j ≠ i the player j, entry i the attacker; 0-1 or bool.
    blocks : bool
        Whether to bound Θ/dim over the paper's dim × dim blocks, and not over scalar gains alone. Order one only.
    order : {1, 2}
        Of the relaxation. 1: milliseconds, by Clarabel (the extra ``bounds``), in doubles. 2: proved in exact
        arithmetic, without extras; 0.1 s at five unknowns, seconds at nine, minutes and gigabytes at fourteen.

    Returns
    -------
    ThetaBound
        The bound, the gap and the solver's status.

    Raises
    ------
    ScenarioError
        The instant is not on the grid, or the adjacency has another shape or other entries than 0 and 1. Order one:
        Clarabel is not installed. Order two: blocks are asked for, or more than 14 unknowns do not decouple.
    NoEquilibriumError
        The game has no equilibrium on [0, T].

    Examples
    --------
    >>> import tadcore
    >>> sc = tadcore.scenarios.load("paper-i1")
    >>> tadcore.verification.theta_bound(sc, step=0, adjacency=[[0, 1, 0, 0], [1, 1, 0, 0], [0, 0, 0, 0]]).tight
    True

    Where order one leaves a gap, order two may close it:

    >>> network = [[0, 0, 0, 0], [1, 1, 1, 0], [0, 1, 1, 0]]
    >>> tadcore.verification.theta_bound(sc, step=0, adjacency=network).tight
    False
    >>> tadcore.verification.theta_bound(sc, step=0, adjacency=network, order=2).proved
    True
    """
    if isinstance(order, bool) or order not in (1, 2):
        raise ScenarioError("order", order, "1 or 2")
    if order == 1:
        require_clarabel()
    elif blocks:
        raise ScenarioError("blocks", blocks, "False with order=2, which bounds Θ over scalar gains")
    sc = as_scenario(sc)
    seen = as_adjacency(adjacency, (len(sc.constrained), sc.n + 1))
    k = as_index("step", step, sc.steps)
    m = matrices_of(sc)
    objective = FullObjective(sc, m, m.values(solve_equilibrium(sc).P)[:, k], seen, dim=1)
    found = synthesize(sc, step=k, adjacency=seen)
    if order == 1:
        return bound_theta(objective, found.theta, blocks=blocks)
    most = largest_group(objective)
    if most > MOST_UNKNOWNS:
        raise ScenarioError(
            "adjacency", f"{most} unknowns that do not decouple", f"at most {MOST_UNKNOWNS} with order=2"
        )
    return prove_theta(objective, found.rows)


def require_clarabel() -> None:
    """Refuse to go on without the solver, naming the extra that brings it."""
    if find_spec("clarabel") is None:
        raise ScenarioError("bound", MISSING, "asked for with Clarabel installed: pip install 'tadcore[bounds]'")


def bound_theta(objective: FullObjective, theta: float, *, blocks: bool = False) -> ThetaBound:
    """Bound an objective in reduced gains (``dim=1``); `theta` is the value that the gap is measured from.

    Parameters
    ----------
    objective : FullObjective
        Θ at one instant and one network, with one axis.
    theta : float
        The best Θ known.
    blocks : bool
        Whether the bound is to hold for gains in full blocks.

    Returns
    -------
    ThetaBound
        The bound, the gap and the solver's status.
    """
    form = Form(objective, blocks)
    if form.size == 0 or form.gamma == 0.0:  # a constant, or linear least squares
        solution = np.linalg.lstsq(form.A, form.b, rcond=None)[0]
        residual = form.A @ solution - form.b
        value = float(residual @ residual) + form.gamma * float(np.sum(form.M**2))
        return ThetaBound(value, theta, form.scale, "closed form", 0, -form.M if form.gamma else 0.0 * form.M)
    Y, status, iterations = solve(form)
    value, Y = form.best(Y)
    return ThetaBound(value, theta, form.scale, status, iterations, Y)


def prove_theta(objective: FullObjective, rows: Floats, near: Proof | None = None, *, deep: bool = False) -> ThetaBound:
    """Bound an objective in reduced gains (``dim=1``) by the relaxation of order two, and prove the bound.

    Parameters
    ----------
    objective : FullObjective
        Θ at one instant and one network, with one axis.
    rows : ndarray, shape (m, N)
        The gains that are compared with the bound.
    near : Proof, optional
        That of the same network at a near instant: where to begin.
    deep : bool
        Whether a near instant will begin there, so that a few more steps pay.

    Returns
    -------
    ThetaBound
        The bound, its proof and, where gains with a lower Θ were found, those.
    """
    x = objective.blocks(rows)
    scale = objective.theta(0.0 * x)
    found = relax(objective, x, _FLOOR * scale, near, deep=deep)
    theta, steps, lower = found.theta, found.steps, None
    if found.point is not None:
        descent = minimize(objective.theta, found.point, jac=objective.gradient, method="BFGS", options={"gtol": 1e-12})
        if descent.fun < float(theta) * (1.0 - _LOWER):
            lower, found = objective.rows(descent.x), relax(objective, descent.x, _FLOOR * scale)
            steps += found.steps
    proof = found.proof
    value = math.nextafter(float(proof.bound), -math.inf) if proof else -math.inf
    status = "proved" if proof else "not proved"
    above = math.nextafter(float(theta), math.inf)
    return ThetaBound(value, above, scale, status, steps, None, order=2, proof=proof, lower=lower)
