"""The reduced matrices of a game, in one form for both interactions.

Every control of the game is a row of one stack, ordered d1 … dn, target, attacker, so ż = B u with B of shape
(N, n + 2). The parties of the Nash equilibrium are ``defenders``, ``target``, ``attacker`` in I1 (eq:fullobj), and
``team``, ``attacker`` in I2, where the team minimises -J (eq:obj:zero_sum). Party p minimises

    J_p = ½‖z(T)‖²_{F_p} + ½∫(‖z‖²_{Q_p} + Σ_i s_{p,i} r_i ‖u_i‖²)dt,

with s_{p,i} = 1 on its own controls and, in I2, -1 on the opponent's. With its value matrix P_p the Riccati equations
(eq:Riccati, eq:RDE) are then one: for the rows G of u = Gz, G_p = -R_p⁻¹B_pᵀP_p,

    Ṗ_p = -(P_p C + CᵀP_p + Q_p + Gᵀ diag(s_p r) G),   C = BG.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from tadcore._shared.arrays import Floats
from tadcore.scenario.model import Scenario


class FeedbackSolution(Protocol):
    """What is verified of an equilibrium: `tadcore.Equilibrium` has it."""

    times: Floats
    P: dict[str, Floats]

    @property
    def feedback(self) -> Mapping[str, Floats]:
        """Rows (K + 1, N) by player label."""


@dataclass(frozen=True, eq=False)
class Matrices:
    """Reduced matrices of one game; see the head of this module."""

    parties: tuple[str, ...]
    members: tuple[slice, ...]
    """Which controls each party owns."""
    B: Floats
    r: Floats
    effort: Floats
    """s_{p,i} r_i, shape (parties, n + 2)."""
    Q: Floats
    F: Floats
    """Shape (parties, N, N)."""

    @property
    def size(self) -> int:
        """N."""
        return len(self.B)

    def values(self, P: Mapping[str, Floats]) -> Floats:
        """Value matrices by party, shape (parties, …, N, N), from the groups of an equilibrium."""
        if "team" in P:
            return np.stack([-P["team"], P["team"]])
        return np.stack([P[party] for party in self.parties])

    def rows(self, values: Floats) -> Floats:
        """G, shape (…, n + 2, N): the equilibrium feedback that belongs to value matrices."""
        parts = [-np.swapaxes(self.B[:, own], 0, 1) @ values[p] for p, own in enumerate(self.members)]
        stacked: Floats = np.concatenate(parts, axis=-2) / self.r[:, None]
        return stacked

    def weights(self, G: Floats) -> Floats:
        """Q_p + Gᵀ diag(s_p r) G for every party, shape (parties, …, N, N)."""
        Gt = np.swapaxes(G, -1, -2)
        own = [self.Q[p] + Gt @ (self.effort[p][:, None] * G) for p in range(len(self.parties))]
        return np.stack(own)

    def slope(self, values: Floats, G: Floats | None = None) -> Floats:
        """Ṗ_p under the rows G of all players; under the equilibrium rows of the values themselves by default."""
        rows = self.rows(values) if G is None else G
        half = values @ (self.B @ rows)
        slope: Floats = -(half + np.swapaxes(half, -1, -2) + self.weights(rows))
        return slope


def matrices_of(sc: Scenario) -> Matrices:
    """The matrices of a scenario's game."""
    n, team, a, tau = sc.n, sc.defenders, sc.attacker, sc.target
    B = np.hstack([np.eye(n + 1), -np.ones((n + 1, 1))])
    r = np.array([*(d.control_weight for d in team), tau.control_weight, a.control_weight])
    evade = [[d.evasion_running_weight for d in team], [d.evasion_terminal_weight for d in team]]
    reach = [a.target_running_weight, a.target_terminal_weight]
    if sc.interaction == "I2":
        zero_sum = [np.diag([*(-np.array(evade[i])), reach[i]]) for i in (0, 1)]
        sign = np.array([*([-1.0] * (n + 1)), 1.0])
        return Matrices(
            parties=("team", "attacker"),
            members=(slice(0, n + 1), slice(n + 1, n + 2)),
            B=B,
            r=r,
            effort=np.stack([-sign * r, sign * r]),
            Q=np.stack([-zero_sum[0], zero_sum[0]]),
            F=np.stack([-zero_sum[1], zero_sum[1]]),
        )
    chase = [[d.running_weight for d in team], [d.terminal_weight for d in team]]
    flee = [tau.running_weight, tau.terminal_weight]
    state = [
        np.stack(
            [
                np.diag([*chase[i], 0.0]),
                np.diag([*([0.0] * n), -flee[i]]),
                np.diag([*(-a.evasion * np.array(evade[i])), reach[i]]),
            ]
        )
        for i in (0, 1)
    ]
    members = (slice(0, n), slice(n, n + 1), slice(n + 1, n + 2))
    effort = np.zeros((3, n + 2))
    for p, own in enumerate(members):
        effort[p, own] = r[own]
    return Matrices(("defenders", "target", "attacker"), members, B, r, effort, state[0], state[1])


def stacked_rows(feedback: Mapping[str, Floats], players: tuple[str, ...]) -> Floats:
    """Rows of all players, shape (K + 1, n + 2, N)."""
    return np.stack([feedback[player] for player in players], axis=1)
