"""What is played: the scenario and its players, checked and immutable."""

from .model import Attacker, Defender, Scenario, Target

__all__ = ["Attacker", "Defender", "Scenario", "Target"]
