"""What the rules and the words of a scenario take: its fields and what follows from them; `Scenario` has all of it."""

from __future__ import annotations

from typing import Literal, Protocol

from tadcore._shared.arrays import Floats

from .players import Attacker, Defender, Target
from .tables import Communication, Disturbance, Sensing


class Shape(Protocol):
    """A scenario; its members are those of `tadcore.Scenario`."""

    @property
    def interaction(self) -> Literal["I1", "I2"]:
        """Which game."""

    @property
    def horizon(self) -> float:
        """T."""

    @property
    def step(self) -> float:
        """δ."""

    @property
    def synthesis_weights(self) -> tuple[float, ...]:
        """γ."""

    @property
    def feedback(self) -> Literal["finite", "receding"] | None:
        """The horizon over which P is solved."""

    @property
    def prediction_horizon(self) -> float | None:
        """T_h."""

    @property
    def criterion(self) -> Literal["paper", "component"] | None:
        """What is minimised."""

    @property
    def sensing(self) -> Sensing | None:
        """The table of failures."""

    @property
    def communication(self) -> Communication | None:
        """The table of links."""

    @property
    def disturbance(self) -> Disturbance | None:
        """The table of disturbances."""

    @property
    def attacker(self) -> Attacker:
        """The attacker."""

    @property
    def target(self) -> Target:
        """The target."""

    @property
    def defenders(self) -> tuple[Defender, ...]:
        """The defenders."""

    @property
    def n(self) -> int:
        """Number of defenders."""

    @property
    def dim(self) -> int:
        """Number of axes."""

    @property
    def steps(self) -> int:
        """K."""

    @property
    def players(self) -> tuple[str, ...]:
        """Labels of all."""

    @property
    def constrained(self) -> tuple[str, ...]:
        """Labels of the players with limited sight."""

    @property
    def positions(self) -> Floats:
        """Initial positions."""

    @property
    def visibility_radii(self) -> Floats:
        """ζ."""

    @property
    def capture_radii(self) -> Floats:
        """σ."""

    def parts(self) -> list[tuple[tuple[str | int, ...], Attacker | Target | Defender]]:
        """Every player with where it stands."""
