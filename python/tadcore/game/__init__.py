"""The game itself: its equilibrium, its gains, its network, and how it ends."""

from .chattering import Chatter
from .equilibrium import Equilibrium, solve_equilibrium
from .network import Interval, NetworkChange, VisibilityNetwork
from .outcome import Outcome, OutcomeKind
from .synthesis import Gains, synthesize

__all__ = [
    "Chatter",
    "Equilibrium",
    "Gains",
    "Interval",
    "NetworkChange",
    "Outcome",
    "OutcomeKind",
    "VisibilityNetwork",
    "solve_equilibrium",
    "synthesize",
]
