"""Games that diverge: the players part without bound, and what is computed says nothing of a pursuit any more.

Under limited sight the closed loop may be unstable by itself, whatever the step. The size of a game at t_k is the
largest distance from a player to the attacker, max ‖z_i(t_k)‖, over the start's own scale, the largest distance between
any two players at t = 0. It does not change where all lengths are scaled, or everybody is moved, turned or reflected. A
game *diverges* at the first instant of the grid, its end included, at which the size exceeds ``SIZE``; it is played on
by the same rules, and how it then ends is recorded, but never counted as an outcome.
"""

from __future__ import annotations

from dataclasses import dataclass

SIZE = 1e3
"""Beyond it a game has diverged; the core's own constant, whose reasons are in ``docs/decisions``."""


@dataclass(frozen=True)
class Divergence:
    """When a game diverged, and how far it went.

    Attributes
    ----------
    time : float
        The first instant of the grid at which the size exceeds 1000.
    size : float
        The largest size up to the end of the game: the largest distance from a player to the attacker, over the
        largest distance between any two players at the start. A lower bound where the game leaves the range of double
        precision.
    """

    time: float
    size: float

    def __str__(self) -> str:
        return f"diverges at t = {self.time:.10g}, up to {self.size:.2g} times the size of its start"
