"""A lower bound on Θ over all gains that a network allows, by semidefinite programming, and the gap it leaves.

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
"""

from __future__ import annotations

from dataclasses import dataclass, field
from importlib.util import find_spec

import numpy as np
from numpy.typing import ArrayLike

from tadcore._shared.arrays import Floats, as_adjacency, as_index
from tadcore.errors import MISSING, ScenarioError
from tadcore.game.equilibrium import solve_equilibrium
from tadcore.game.network import VisibilityNetwork
from tadcore.game.synthesis import synthesize
from tadcore.scenarios.given import ScenarioLike, as_scenario
from tadcore.verification.oracle.matrices import matrices_of
from tadcore.verification.oracle.objective import FullObjective

from .relaxation import Form, solve

_TIGHT = 1e-6
_FLOOR = 1e-6


@dataclass(frozen=True)
class ThetaBound:
    """A lower bound on Θ at one (instant, network) beside the best value known.

    Attributes
    ----------
    value : float
        The bound, in reduced norms like ``Gains.theta``; no gains of the kind asked for have a smaller Θ. -inf where
        the solver returned nothing usable.
    theta : float
        Θ of the gains that are compared with it.
    scale : float
        Θ of standing still, G = 0: what rounding in the bound is relative to.
    status : str
        How the solver ended: Clarabel's word, such as ``"Solved"``, or ``"closed form"`` where no solver is needed.
    iterations : int
        Steps of the solver.
    multiplier : ndarray, shape (N, N)
        Y, at which the bound can be evaluated again.
    """

    value: float
    theta: float
    scale: float
    status: str
    iterations: int
    multiplier: Floats = field(repr=False)

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
        """Whether the relative gap is below 1e-6: Θ is proved to be the global minimum to that accuracy."""
        return self.relative_gap < _TIGHT


def theta_bound(
    sc: ScenarioLike, *, step: int, adjacency: ArrayLike | VisibilityNetwork, blocks: bool = False
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
        Whether to bound Θ/dim over the paper's dim × dim blocks, and not over scalar gains alone.

    Returns
    -------
    ThetaBound
        The bound, the gap and the solver's status.

    Raises
    ------
    ScenarioError
        Clarabel is not installed, the instant is not on the grid, or the adjacency has another shape or other entries
        than 0 and 1.
    NoEquilibriumError
        The game has no equilibrium on [0, T].

    Examples
    --------
    >>> import tadcore
    >>> sc = tadcore.scenarios.load("paper-i1")
    >>> bound = tadcore.verification.theta_bound(sc, step=0, adjacency=[[0, 0, 0, 0], [1, 1, 1, 0], [0, 1, 1, 0]])
    >>> bound.tight
    True
    """
    require_clarabel()
    sc = as_scenario(sc)
    seen = as_adjacency(adjacency, (len(sc.constrained), sc.n + 1))
    k = as_index("step", step, sc.steps)
    m = matrices_of(sc)
    objective = FullObjective(sc, m, m.values(solve_equilibrium(sc).P)[:, k], seen, dim=1)
    return bound_theta(objective, synthesize(sc, step=k, adjacency=seen).theta, blocks=blocks)


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
