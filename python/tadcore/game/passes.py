"""What happens between two instants of the grid, where termination is not tested: passes within a capture radius."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Pass:
    """A capture radius that is entered between two instants of the grid, where termination is not tested.

    It is entered before the one, if any, that ends the game at the next instant: with ``termination="continuous"`` the
    game would end at the first pass. The motion within a step is known exactly, z(t_k + s) = exp(Cs) z(t_k), and so are
    these times and the distance. Of a game that diverges, passes are listed up to the divergence only.

    Attributes
    ----------
    defender : int or None
        The defender within whose capture radius the attacker comes, 0-based; None where the attacker comes within its
        own of the target.
    start, end : float
        The instants t_k and t_{k+1}.
    time : float
        When the radius is entered.
    closest_time : float
        When the two are closest in this step.
    distance : float
        How close.
    """

    defender: int | None
    start: float
    end: float
    time: float
    closest_time: float
    distance: float

    def __str__(self) -> str:
        whom = "the target" if self.defender is None else f"d{self.defender + 1}"
        return (
            f"passes within σ of {whom} between t = {self.start:.10g} and {self.end:.10g} "
            f"(closest {self.distance:.6g} at t = {self.closest_time:.6g})"
        )
