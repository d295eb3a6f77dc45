"""The players, each a table of a scenario; `tadcore.scenario.model` has what the fields mean."""

from __future__ import annotations

import math
from typing import ClassVar

from pydantic import Field

from .checked import CheckedModel
from .fields import Disturbed, Fraction, Position, Positive, Radius, Weight
from .tables import Sensing, Transmitter

_SENSING = "the [{}.sensing] table: failures of its own sensor, before the common ones"
_SENDING = "the [{}.communication] table: links to those who hear it, before the common ones"
_DISTURBANCE = "ς of this player, before the common one"


class Attacker(CheckedModel):
    """The attacker a: it sees everyone, wants the target and, unless suicidal, avoids the defenders."""

    _root: ClassVar[str] = "attacker"
    belongs: ClassVar[dict[str, str]] = {"evasion": "I1"}

    position: Position = Field(description="X_a(0), the initial position, 2 or 3 finite numbers")
    control_weight: Weight = Field(description="r_a, the cost of effort")
    capture_radius: Positive = Field(description="σ_a, within which it captures the target")
    target_running_weight: Weight = Field(default=1.0, description="q_aτ, weight on the distance to the target")
    target_terminal_weight: Weight = Field(default=1.0, description="f_aτ, the same at T")
    evasion: Fraction = Field(default=1.0, description="λ: 0 suicidal, 1 evading (I1 only)")
    disturbance: Disturbed | None = Field(default=None, description=_DISTURBANCE)


class Target(CheckedModel):
    """The target τ: it flees the attacker."""

    _root: ClassVar[str] = "target"
    belongs: ClassVar[dict[str, str]] = {
        "running_weight": "I1",
        "terminal_weight": "I1",
        "visibility_radius": "I2",
        "sensing": "I2",
        "communication": "I2",
    }

    position: Position = Field(description="X_τ(0), the initial position, 2 or 3 finite numbers")
    control_weight: Weight = Field(description="r_τ, the cost of effort")
    running_weight: Weight = Field(default=1.0, description="q_τa, weight on the distance to the attacker (I1 only)")
    terminal_weight: Weight = Field(default=1.0, description="f_τa, the same at T (I1 only)")
    visibility_radius: Radius = Field(
        default=math.inf, description="ζ_τ, visibility radius; inf for unlimited (I2 only)"
    )
    disturbance: Disturbed | None = Field(default=None, description=_DISTURBANCE)
    sensing: Sensing | None = Field(default=None, description=f"{_SENSING.format('target')} (I2 only)")
    communication: Transmitter | None = Field(default=None, description=f"{_SENDING.format('target')} (I2 only)")


class Defender(CheckedModel):
    """A defender d_i: it wants to intercept the attacker, and sees only what is near."""

    _root: ClassVar[str] = "defender"
    belongs: ClassVar[dict[str, str]] = {"running_weight": "I1", "terminal_weight": "I1"}

    position: Position = Field(description="X_d(0), the initial position, 2 or 3 finite numbers")
    control_weight: Weight = Field(description="r_d, the cost of effort")
    capture_radius: Positive = Field(description="σ_d, within which it intercepts the attacker")
    visibility_radius: Radius = Field(default=math.inf, description="ζ_d, visibility radius; inf for unlimited")
    running_weight: Weight = Field(default=1.0, description="q_da, weight on the distance to the attacker (I1 only)")
    terminal_weight: Weight = Field(default=1.0, description="f_da, the same at T (I1 only)")
    evasion_running_weight: Weight = Field(default=1.0, description="q_ad, the attacker's weight on evading it")
    evasion_terminal_weight: Weight = Field(default=1.0, description="f_ad, the same at T")
    disturbance: Disturbed | None = Field(default=None, description=_DISTURBANCE)
    sensing: Sensing | None = Field(default=None, description=_SENSING.format("defenders"))
    communication: Transmitter | None = Field(default=None, description=_SENDING.format("defenders"))
