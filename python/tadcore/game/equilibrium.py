"""The feedback Nash equilibrium of the game in which everyone sees everything.

Interaction I1, Theorem fbne of Singh and Reddy: three coupled Riccati equations (eq:Riccati), from P_p(T) = F_p back,

    Ṗ_p = P_p A + Aᵀ P_p - P_p S_p P_p - Q_p,   A = S_d P_d + S_τ P_τ + S_a P_a,   p = d, τ, a,

and u_p = -R_p⁻¹ B_pᵀ P_p z (eq:1d). Interaction I2, Theorem zero:sum:game: one symmetric equation (eq:RDE),

    Ṗ = -Q + P (S_a - S_dτ) P,   P(T) = F,

and u_a = -R_a⁻¹ B_aᵀ P z, u_dτ = R_dτ⁻¹ B_dτᵀ P z.

Every weight is a scalar times the identity of the axes, so P is kept as its reduced factor p, N × N with N = n + 1,
in the order d1 … dn, target; the paper's matrix is p ⊗ I. Everything is dimensionless.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from tadcore import _core
from tadcore._shared.arrays import Floats, as_index
from tadcore._shared.text import one_of
from tadcore.scenario.model import Scenario
from tadcore.scenarios.given import ScenarioLike, as_scenario

from .compiled import game_of

_MOST_AXES = 100


class Equilibrium:
    """The Riccati solution on the grid and the feedback it gives; made by `solve_equilibrium`.

    Attributes
    ----------
    times : ndarray, shape (K + 1,)
        The grid, t_0 = 0 … t_K = T.
    P : dict of str to ndarray, shape (K + 1, N, N)
        The reduced solution by group: ``"defenders"``, ``"target"``, ``"attacker"`` in I1, ``"team"`` in I2.
        Read-only, in copies and after pickling too.
    integrator_steps : int
        Steps the integrator accepted.
    """

    def __init__(self, core: _core.Equilibrium, times: Floats, sc: Scenario) -> None:
        self._core = core
        self._players = sc.players
        self._dim = sc.dim
        self.times = times
        solution = core.P
        solution.flags.writeable = False
        self.P: dict[str, Floats] = dict(zip(core.groups, solution, strict=True))
        self.integrator_steps = core.steps

    @cached_property
    def residual(self) -> dict[str, Floats]:
        """Relative residual of the Riccati equation at every node, shape (K + 1,), by group."""
        return dict(zip(self._core.groups, self._core.residual(), strict=True))

    @property
    def max_residual(self) -> float:
        """The largest entry of `residual`."""
        return max(float(values.max()) for values in self.residual.values())

    @cached_property
    def feedback(self) -> dict[str, Floats]:
        """Rows of the equilibrium feedback, shape (K + 1, N), by player label.

        At t_k each player's control is ``feedback[player][k] @ z``, z of shape (N, dim) with one row X_p - X_a for
        each of d1 … dn, target (eq:1d in I1, eq:zero_sum_control1 and eq:zero_sum_control2 in I2).
        """
        rows = self._core.feedback()
        return {player: rows[:, i] for i, player in enumerate(self._players)}

    def full(self, name: str, k: int, dim: int | None = None) -> Floats:
        """The paper's own matrix P(t_k) = p ⊗ I, shape (dim·N, dim·N).

        Parameters
        ----------
        name : str
            A key of `P`.
        k : int
            Instant on the grid, 0 … K.
        dim : int, optional
            Number of axes; the scenario's by default.

        Raises
        ------
        ScenarioError
            There is no such group or no such instant.
        """
        group = one_of("name", name, self.P)
        k = as_index("k", k, len(self.times) - 1)
        axes = self._dim if dim is None else as_index("dim", dim, _MOST_AXES, least=1)
        return np.kron(self.P[group][k], np.eye(axes))

    def __getstate__(self) -> dict[str, Any]:
        """What a pickle or a copy holds: every number, and not the core's own solution."""
        state = {**self.__dict__, "residual": self.residual, "feedback": self.feedback}
        state.pop("_core", None)
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        for solution in self.P.values():
            solution.flags.writeable = False

    def __repr__(self) -> str:
        nodes, size = len(self.times), len(self._players) - 1
        groups = ", ".join(self.P)
        return (
            f"Equilibrium({groups}: {size}×{size} on {nodes:,} nodes to T={self.times[-1]:g}, "
            f"largest residual {self.max_residual:.1e})"
        )


def solve_equilibrium(sc: ScenarioLike) -> Equilibrium:
    """The feedback Nash equilibrium of a scenario's game on its grid.

    Positions and radii play no part in it: scenarios that share weights, horizon and step share the solution.

    Parameters
    ----------
    sc : Scenario, path or name
        The game.

    Returns
    -------
    Equilibrium
        P on the grid, its residual and the feedback rows.

    Raises
    ------
    NoEquilibriumError
        The Riccati solution escapes before t = 0: the game has no equilibrium on [0, T].

    Examples
    --------
    >>> import tadcore
    >>> eq = tadcore.solve_equilibrium(tadcore.scenarios.load("paper-i1"))
    >>> eq.P["defenders"].shape, eq.full("defenders", 0).shape
    ((1201, 4, 4), (8, 8))
    """
    sc = as_scenario(sc)
    game = game_of(sc)
    return Equilibrium(game.equilibrium(), game.times, sc)
