"""What a recorded game is to those who draw or examine it.

`tadcore.Run` is one. Figures and the functions of this package take anything of this shape, so that they know nothing
of how a game is played, and a run can offer its figures as methods.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import Floats, Numbers
from tadcore.errors import ScenarioError
from tadcore.scenario.model import Scenario

from .changes import Interval, NetworkChange
from .course import Course
from .divergence import Divergence
from .outcome import Outcome
from .passes import Pass


class Recorded(Protocol):
    """A game of n defenders with its L + 1 instants; shapes and orders are those of `tadcore.Run`."""

    @property
    def scenario(self) -> Scenario:
        """What was played."""

    @property
    def outcome(self) -> Outcome:
        """How it ended."""

    @property
    def diverged(self) -> Divergence | None:
        """When it diverged; None where it did not."""

    @property
    def times(self) -> Floats:
        """Instants, shape (L + 1,)."""

    @property
    def position(self) -> Floats:
        """Positions, shape (L + 1, n + 2, dim)."""

    @property
    def control(self) -> Floats:
        """Controls, shape (L + 1, n + 2, dim)."""

    @property
    def adjacency(self) -> NDArray[np.bool_]:
        """𝒜, shape (L + 1, m, N); the last row repeats the last network in force."""

    @property
    def gains(self) -> Numbers:
        """Rows of the feedback, shape (L + 1, m, N); complex where they may turn."""

    @property
    def theta(self) -> Floats:
        """Θ₁ or Θ₂, shape (L + 1,)."""

    @property
    def theta_terms(self) -> Floats:
        """Its terms, unweighted, shape (L + 1, 4 or 3)."""

    @property
    def passes(self) -> tuple[Pass, ...]:
        """Capture radii entered between two instants."""

    @property
    def seen(self) -> NDArray[np.bool_]:
        """What each player saw itself, shape (L + 1, m, N): 𝒜 but for what was reported."""

    @property
    def course(self) -> Course | None:
        """What failed, who heard whom; None where nothing surrounds the game."""

    @property
    def network_changes(self) -> tuple[NetworkChange, ...]:
        """The initial network, then every change."""

    def intervals(self) -> tuple[Interval, ...]:
        """The stretches of time with one network."""


def scalar_gains(run: Recorded) -> Floats:
    """The gains of a run with scalar ones.

    Raises
    ------
    ScenarioError
        Its gains may turn.
    """
    if np.iscomplexobj(run.gains):
        raise ScenarioError("run", "a run with turning gains", "one with scalar gains")
    return run.gains
