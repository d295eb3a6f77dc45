"""The tables of what surrounds a game: what fails, who is told, what displaces the players.

All of them are left out in the paper's game. `docs/theory/worlds.md` has the mathematics.

==============================================  ==========================================================
field                                           meaning
==============================================  ==========================================================
``mean_time_to_failure``, ``_to_repair``        of a player's whole sensor
``mean_time_detected``, ``mean_time_missed``    of a single edge whose two players are within range
``begin``                                       "up", or "stationary": in the law of a long time
``radius``                                      ρ, within which a player is heard
``mean_time_up``, ``mean_time_down``            of a link
``relays``                                      how many players may pass on a report, one after another
``frame``                                       "relative": members report what they see; "common": also where
                                                they are, in a frame that all share
``defenders``, ``target``, ``attacker``         ς, displacement per square root of time
==============================================  ==========================================================
"""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field

from .checked import CheckedModel
from .fields import Disturbed, LinkRadius, MeanTime, Relays


class Sensing(CheckedModel):
    """Failures of sensors and of single edges: on/off chains in continuous time, given by their mean times.

    As the table of a scenario it holds for every player with limited sight; a player's own table goes before it, field
    by field.
    """

    _root: ClassVar[str] = "sensing"

    mean_time_to_failure: MeanTime | None = Field(
        default=None, description="mean time that a player's whole sensor works; inf for never a failure"
    )
    mean_time_to_repair: MeanTime | None = Field(
        default=None, description="mean time until it works again; left out or inf, it has failed for good"
    )
    mean_time_detected: MeanTime | None = Field(
        default=None, description="mean time that one player in range stays detected; inf for always"
    )
    mean_time_missed: MeanTime | None = Field(
        default=None, description="mean time until it is detected again; left out or inf, it is lost for good"
    )
    begin: Literal["up", "stationary"] | None = Field(
        default=None, description='"up": all works at first (the default); "stationary": as after a long time'
    )


class Transmitter(CheckedModel):
    """The links by which one player is heard."""

    _root: ClassVar[str] = "communication"

    radius: LinkRadius | None = Field(
        default=None, description="ρ, within which others hear it; inf for any distance; left out, nobody does"
    )
    mean_time_up: MeanTime | None = Field(default=None, description="mean time that a link works; inf for always")
    mean_time_down: MeanTime | None = Field(
        default=None, description="mean time until it works again; left out or inf, it is lost for good"
    )


class Communication(Transmitter):
    """Who is told what the others see, among the players with limited sight."""

    relays: Relays | None = Field(
        default=None, description="how many players may pass on a report, one after another; no bound by default"
    )
    frame: Literal["relative", "common"] | None = Field(
        default=None,
        description='"relative": reports of what is seen (the default); "common": also of the own place, in one frame',
    )
    begin: Literal["up", "stationary"] | None = Field(
        default=None, description='"up": all links work at first (the default); "stationary": as after a long time'
    )


class Disturbance(CheckedModel):
    """Independent random displacement of the players: dX_p = u_p dt + ς_p dW_p."""

    _root: ClassVar[str] = "disturbance"

    defenders: Disturbed | None = Field(default=None, description="ς of every defender")
    target: Disturbed | None = Field(default=None, description="ς of the target")
    attacker: Disturbed | None = Field(default=None, description="ς of the attacker")
