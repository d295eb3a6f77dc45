"""The visibility network in the paper's own form, for a reader to inspect.

Row i of the augmented adjacency 𝒜 (eq:extadj of Singh and Reddy) says whom player i sees: entry j ≠ i the player j,
entry i the attacker. The rows are the players with limited sight, d1 … dn and in I2 the target; the columns are
d1 … dn, target. A player p sees q where their distance is at most ζ_p (eq:limob, a closed ball).

===========================  ==============================  ============================================
here                         paper                           shape
===========================  ==============================  ============================================
``adjacency``                𝒜                               (m, N), N = n + 1, m = n in I1 and N in I2
``Ad``                       Ad (eq:Adij)                    (n, n)
``Phi_a``                    Φ_a                             (n, n), diagonal
``Phi_tau``                  Φ_τ of I1                       (n, 1)
``information_matrix(p)``    𝓘_{d_i}, 𝓘_τ (eq:infomatrix)    (dim·N, dim·N)
``information_matrix_team``  𝓘_d                             (n·dim·N, dim·N)
===========================  ==============================  ============================================

This is for looking at one instant; runs use the compiled core.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tadcore import _core
from tadcore._shared.arrays import as_adjacency, as_index, as_positions, shape_of
from tadcore.errors import ScenarioError
from tadcore.scenarios.given import ScenarioLike, as_scenario

Edge: TypeAlias = tuple[str, str]
"""Who sees whom, such as ``("d1", "attacker")``."""


class VisibilityNetwork:
    """Who sees whom at one instant; immutable.

    Parameters
    ----------
    adjacency : array_like of bool, shape (m, N)
        𝒜, with m = N - 1 (I1) or m = N (I2).

    Raises
    ------
    ScenarioError
        The array has another shape or an entry that is neither 0 nor 1.

    Examples
    --------
    >>> net = VisibilityNetwork([[1, 1, 0], [0, 0, 1]])
    >>> net.edges()
    (('d1', 'd2'), ('d1', 'attacker'), ('d2', 'target'))
    """

    __slots__ = ("_adjacency",)

    def __init__(self, adjacency: ArrayLike) -> None:
        shape = shape_of(adjacency)
        if len(shape) != 2 or shape[1] < 2 or shape[0] not in (shape[1] - 1, shape[1]):
            raise ScenarioError("adjacency", f"shape {shape}", "of shape (n, n + 1) in I1 or (n + 1, n + 1) in I2")
        self._adjacency = as_adjacency(adjacency, (shape[0], shape[1]))
        self._adjacency.flags.writeable = False

    @property
    def adjacency(self) -> NDArray[np.bool_]:
        """𝒜, shape (m, N), read-only."""
        return self._adjacency

    @classmethod
    def from_positions(cls, sc: ScenarioLike, positions: ArrayLike | None = None) -> VisibilityNetwork:
        """The network of players at ``positions``, shape (n + 2, dim); the scenario's own start by default.

        The compiled core decides, by the arithmetic of a run: from states relative to the attacker, in doubles.
        """
        sc = as_scenario(sc)
        at = sc.positions if positions is None else as_positions(positions, (sc.n + 2, sc.dim))
        return cls(_core.observe(at, sc.visibility_radii))

    @property
    def n(self) -> int:
        """Number of defenders."""
        return int(self.adjacency.shape[1]) - 1

    @property
    def players(self) -> tuple[str, ...]:
        """Labels d1 … dn, target, attacker."""
        return (*(f"d{i}" for i in range(1, self.n + 1)), "target", "attacker")

    @property
    def observers(self) -> tuple[str, ...]:
        """Labels of the rows of 𝒜."""
        return self.players[: len(self.adjacency)]

    @property
    def Ad(self) -> NDArray[np.int_]:
        """Which defender sees which, shape (n, n), zero on the diagonal."""
        among = self.adjacency[: self.n, : self.n].astype(np.int_)
        np.fill_diagonal(among, 0)
        return among

    @property
    def Phi_a(self) -> NDArray[np.int_]:
        """Which defender sees the attacker, shape (n, n), diagonal."""
        return np.diag(np.diag(self.adjacency[: self.n, : self.n])).astype(np.int_)

    @property
    def Phi_tau(self) -> NDArray[np.int_]:
        """Which defender sees the target, shape (n, 1)."""
        return self.adjacency[: self.n, self.n :].astype(np.int_)

    def information_matrix(self, player: str | int, dim: int = 2) -> NDArray[np.int_]:
        """𝓘 of one player, shape (dim·N, dim·N): 𝓘 z is what it may use of z.

        diag(row i) · (I_N with -1 down column i off the diagonal) ⊗ I_dim, eq:infomatrix.

        Parameters
        ----------
        player : str or int
            A label such as ``"d2"`` or ``"target"``, or the row's index.
        dim : int
            Number of axes.
        """
        i = self._row(player)
        size = self.n + 1
        relative = np.eye(size, dtype=np.int_)
        relative[:, i] = -1
        relative[i, i] = 1
        axes = np.eye(as_index("dim", dim, 100, least=1), dtype=np.int_)
        return np.kron(self.adjacency[i].astype(np.int_)[:, None] * relative, axes)

    @property
    def information_matrix_team(self) -> NDArray[np.int_]:
        """𝓘_d = col{𝓘_{d_1}, …, 𝓘_{d_n}} in the plane, shape (2 n N, 2 N)."""
        return np.vstack([self.information_matrix(i) for i in range(self.n)])

    def edges(self) -> tuple[Edge, ...]:
        """Every edge as (who sees, who is seen), by observer."""
        return edges_of(self.adjacency, self.players)

    def _row(self, player: str | int) -> int:
        if isinstance(player, str) and player in self.observers:
            return self.observers.index(player)
        if isinstance(player, int | np.integer) and 0 <= player < len(self.observers):
            return int(player)
        rule = f"a player with limited sight: {', '.join(self.observers)}, or an index below {len(self.observers)}"
        raise ScenarioError("player", player, rule)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, VisibilityNetwork) and np.array_equal(self.adjacency, other.adjacency)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.adjacency,)

    def __hash__(self) -> int:
        return hash((self.adjacency.shape, self.adjacency.tobytes()))

    def __repr__(self) -> str:
        arrows = ", ".join(f"{p}→{q}" for p, q in self.edges())
        return f"VisibilityNetwork({arrows or 'no edges'})"


def edges_of(adjacency: NDArray[np.bool_], players: Sequence[str]) -> tuple[Edge, ...]:
    """The edges of 𝒜 by observer, the attacker last."""
    attacker = len(players) - 1
    seen = ((int(i), attacker if i == j else int(j)) for i, j in zip(*np.nonzero(adjacency), strict=True))
    return tuple((players[i], players[j]) for i, j in sorted(seen))
