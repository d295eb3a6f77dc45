"""The game itself: its equilibrium, its gains, its network, and how it ends."""

from .changes import Interval, NetworkChange
from .chattering import Chatter
from .course import Contact, Course, EdgeOutage, Outage
from .divergence import Divergence
from .equilibrium import Equilibrium, solve_equilibrium
from .network import VisibilityNetwork
from .outcome import Outcome, OutcomeKind
from .passes import Pass
from .recorded import Recorded
from .synthesis import Gains, synthesize

__all__ = [
    "Chatter",
    "Contact",
    "Course",
    "Divergence",
    "EdgeOutage",
    "Equilibrium",
    "Gains",
    "Interval",
    "NetworkChange",
    "Outage",
    "Outcome",
    "OutcomeKind",
    "Pass",
    "Recorded",
    "VisibilityNetwork",
    "solve_equilibrium",
    "synthesize",
]
