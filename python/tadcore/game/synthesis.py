"""The gains of the players with limited sight at one instant and one network.

The rows g_i of u_i = g_i z have the lowest Θ₁ (eq:errfun1 of Singh and Reddy) or Θ₂ (eq:errfun2) that a search finds
over what the network lets player i use, g_i = K_i 𝓘_i (eq:nwadapt), each K_i made of scalars times the identity:

    I1  Θ₁ = γ₁‖ΔQ_d‖² + γ₂‖ΔQ_τ‖² + γ₃‖ΔQ_a‖² + γ₄‖S₁‖²   (eq:perfindex)
    I2  Θ₂ = γ₁‖ΔQ‖² + γ₂‖S₂‖² + γ₃‖S₃‖²                     (eq:perfmatzsg)

Norms are Frobenius norms of the reduced factors. The paper's matrices are these ⊗ I, so its Θ is dim times the one
reported here; among scalars the minimiser is the same. `Gains.certified` tells where it is proved to be global among
them.

The scalars are a choice. The paper's K_i has blocks of dim × dim; a descent in blocks that begins at scalars stays in
scalars, but blocks that turn, aI + bJ with J a quarter turn, can have a lower Θ, and with them their mirror images
aI - bJ: the minimiser is then not unique. The library's gains are the lowest of those that commute with reflections.
`Gains.certified_blocks` tells where no blocks have a lower Θ. In the plane ``gains="turning"`` takes the lowest among
blocks aI + bJ, which act as the complex numbers a + ib.

A common factor of γ changes Θ alone: the gains are bitwise the same for γ and 2^k γ. Without weight on S (γ₄ = 0 in
I1, γ₂ or γ₃ = 0 in I2) equal minima may differ, by the sign of a row at the least; the gains are then the limit of a
small weight, the minimum nearest to the equilibrium.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from tadcore._shared.arrays import Floats, Numbers, as_adjacency, as_flag, as_index, complex_of
from tadcore._shared.calls import public
from tadcore.errors import ScenarioError
from tadcore.scenario.model import Scenario
from tadcore.scenarios.given import ScenarioLike, as_scenario

from .compiled import game_of
from .network import VisibilityNetwork

GainKind: TypeAlias = Literal["scalar", "turning"]
"""What gains are made of: scalars times the identity, or blocks aI + bJ of the plane."""

_TURN = np.array([[0.0, -1.0], [1.0, 0.0]])
_TERMS = {"I1": ("dQ_d", "dQ_tau", "dQ_a", "S1"), "I2": ("dQ", "S2", "S3")}


def theta_terms(interaction: Literal["I1", "I2"]) -> tuple[str, ...]:
    """Names of the terms of Θ, in the order of γ."""
    return _TERMS[interaction]


def as_gains(sc: Scenario, gains: object, *, mirror: object) -> Literal["scalar", "turning", "mirror"]:
    """Return the two as one word of the core, or raise `ScenarioError`."""
    mirrored = as_flag("mirror", mirror)
    if isinstance(gains, str) and gains == "scalar":
        if mirrored:
            raise ScenarioError("mirror", mirror, 'False, or gains "turning": scalar gains are their own mirror image')
        return "scalar"
    if not isinstance(gains, str) or gains != "turning":
        raise ScenarioError("gains", gains, '"scalar" or "turning"')
    if sc.dim != 2:
        raise ScenarioError("gains", gains, f'"scalar": only in the plane do gains turn, and here are {sc.dim} axes')
    return "mirror" if mirrored else "turning"


@dataclass(frozen=True, eq=False, repr=False)
class Gains:
    """Gains at one (instant, network); made by `synthesize`.

    Attributes
    ----------
    players : tuple of str
        Labels of the m rows: d1 … dn, and in I2 the target.
    rows : ndarray, shape (m, N)
        u_i = rows[i] @ z, z of shape (N, dim). Row i is the reduced factor of K_i 𝓘_i. Of gains that turn complex:
        u_x + iu_y = rows[i] @ (z_x + iz_y).
    K : dict of str to ndarray, shape (dim, dim·N)
        The paper's K_i by player (eq:kpart), zero in the blocks of players that i does not see.
    theta : float
        Θ₁ or Θ₂ of these gains, in reduced norms (the paper's is dim times this).
    terms : dict of str to float
        The squared norms that Θ weighs, unweighted: dQ_d, dQ_tau, dQ_a, S1 or dQ, S2, S3.
    weights : dict of str to float
        γ under the same names; ``theta`` is the sum of ``weights[t] * terms[t]``. Where S (or S2, S3) has weight 0, the
        gains are the limit of a small weight: of equal minima the one nearest to the equilibrium.
    iterations : int
        Steps of the solver.
    converged : bool
        Whether the relative gradient norm reached the tolerance; `status` says how it ended. Where players differ more
        than a hundredfold, and where γ gives S next to no weight, also whether Newton's model has no more than 10⁻⁷ of
        Θ to gain; under a weight on S that is lost in the rounding of the gradient, never.
    status : str
        How the solver ended.
    gradient_norm : float
        Norm of the gradient at the end, relative to the parts that cancel in it. Where these differ more than a
        hundredfold from player to player, or γ gives S next to no weight, the largest of a player, relative to that
        player's parts.
    certified : bool
        Whether these gains are proved to be a global minimum of Θ among scalar gains, up to rounding. False where they
        turn.
    certified_blocks : bool
        Whether they are proved to be one among the paper's gains too, all blocks of dim × dim, those that turn
        included. In I2 wherever `certified`. False says nothing: blocks need not do better there.
    start : {"canonical", "complex", "stacked", "reversed", "between"}
        Starting point of the descent that found it: the canonical one, a further one of the search, or the point
        between the minima at two instants around.
    restarts_left_out : int
        Further starting points that promised to lead lower but were not tried: with more than seven defenders at most
        twenty-four are tried in each of up to four rounds. 0 elsewhere.
    """

    players: tuple[str, ...]
    rows: Numbers
    K: dict[str, Floats]
    theta: float
    terms: dict[str, float]
    weights: dict[str, float]
    iterations: int
    converged: bool
    status: str
    gradient_norm: float
    certified: bool
    certified_blocks: bool
    start: Literal["canonical", "complex", "stacked", "reversed", "between"]
    restarts_left_out: int = 0

    @property
    def turns(self) -> bool:
        """Whether blocks aI + bJ are lower than scalar gains: whether some b is not zero."""
        return bool(np.iscomplexobj(self.rows) and self.rows.imag.any())

    def __repr__(self) -> str:
        state = f"converged in {self.iterations}" if self.converged else f"NOT converged ({self.status})"
        return f"Gains({', '.join(self.players)}: Θ={self.theta:.6g}, {state}, gradient {self.gradient_norm:.1e})"


@public
def synthesize(
    sc: ScenarioLike,
    *,
    step: int,
    adjacency: ArrayLike | VisibilityNetwork,
    method: Literal["newton", "restarts", "descent"] = "newton",
    max_iterations: int | None = None,
    gains: GainKind = "scalar",
    mirror: bool = False,
) -> Gains:
    """The gains at instant t_k under a given network.

    They depend on the game, the instant and the network alone, not on positions and not on the past trajectory.

    Parameters
    ----------
    sc : Scenario, path or name
        The game.
    step : int
        k of the instant t_k, 0 … K.
    adjacency : array_like, shape (m, N), or VisibilityNetwork
        𝒜: row i whom player i sees, entry j ≠ i the player j, entry i the attacker; 0-1 or bool.
    method : {"newton", "restarts", "descent"}
        ``"newton"``: the gains of runs, by Newton's method with the exact Hessian. At some instants of the grid, its
        anchors, from the canonical start with restarts; between two of them from between the minima there, if these
        are near each other. ``"restarts"``: with restarts at this instant, whatever lies around it.
        ``"descent"``: gradient descent with the gradients printed in the paper (eq:errgradient).
    max_iterations : int, optional
        Stop after this many steps, at this instant alone; the result then says that it has not converged.
    gains : {"scalar", "turning"}
        ``"turning"``, in the plane: of blocks aI + bJ, J a quarter turn, those of lowest Θ that a search finds. It
        begins at the scalar gains, and returns these, with zero imaginary parts, where it is proved that no blocks
        are lower, or none lower by more than 10⁻⁹ of Θ are found. By Newton's method, without a limit of steps.
    mirror : bool
        Of gains that turn the mirror image, aI - bJ, has the same Θ. The one returned has a positive first imaginary
        part in ``rows``, row by row, those aside that are zero up to rounding; with True it has a negative one.

    Returns
    -------
    Gains
        The minimiser, every term of Θ and how the solver ended.

    Raises
    ------
    ScenarioError
        The instant is not on the grid, the adjacency has another shape or other entries than 0 and 1, or gains are to
        turn in space, by another method or within a limit of steps.
    NoEquilibriumError
        The game has no equilibrium on [0, T].

    Examples
    --------
    >>> import tadcore
    >>> sc = tadcore.scenarios.load("paper-i1")
    >>> blind = tadcore.synthesize(sc, step=0, adjacency=[[0, 0, 0, 0]] * 3)
    >>> bool((blind.rows == 0).all())
    True
    """
    sc = as_scenario(sc)
    shape = (len(sc.constrained), sc.n + 1)
    seen = as_adjacency(adjacency, shape)
    k = as_index("step", step, sc.steps)
    if not isinstance(method, str) or method not in ("newton", "restarts", "descent"):
        raise ScenarioError("method", method, '"newton", "restarts" or "descent"')
    limit = None if max_iterations is None else as_index("max_iterations", max_iterations, 2**31 - 1, least=1)
    kind = as_gains(sc, gains, mirror=mirror)
    if kind != "scalar" and method != "newton":
        raise ScenarioError("method", method, '"newton" for gains that turn')
    if kind != "scalar" and limit is not None:
        raise ScenarioError("max_iterations", limit, "None for gains that turn")
    core = game_of(sc).synthesize(k, seen, method=method, max_iterations=limit, gains=kind)
    names = theta_terms(sc.interaction)
    axes = np.eye(sc.dim)
    blocks = {label: np.kron(row, axes) for label, row in zip(sc.constrained, core.K, strict=True)}
    if core.K_turn is not None:
        for label, row in zip(sc.constrained, core.K_turn, strict=True):
            blocks[label] += np.kron(row, _TURN)
    rows: Numbers = core.rows
    if kind != "scalar":
        rows = complex_of(rows, np.zeros_like(rows) if core.turn is None else core.turn)
    return Gains(
        players=sc.constrained,
        rows=rows,
        K=blocks,
        theta=core.theta,
        terms=dict(zip(names, map(float, core.terms), strict=True)),
        weights=dict(zip(names, sc.synthesis_weights, strict=True)),
        iterations=core.iterations,
        converged=core.converged,
        status=core.status,
        gradient_norm=core.gradient_norm,
        certified=core.certified,
        certified_blocks=core.certified_blocks,
        start=core.start,
        restarts_left_out=core.restarts_left_out,
    )
