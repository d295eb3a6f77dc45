"""What is played: the scenario with its players and tables, checked and immutable."""

from .model import Scenario
from .players import Attacker, Defender, Target
from .tables import Communication, Disturbance, Sensing, Transmitter
from .worlds import World

__all__ = [
    "Attacker",
    "Communication",
    "Defender",
    "Disturbance",
    "Scenario",
    "Sensing",
    "Target",
    "Transmitter",
    "World",
]
