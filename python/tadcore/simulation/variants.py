"""What sets a run apart from one by the default rules, in words."""

from __future__ import annotations

from typing import Protocol

TURNING_WORDS = {False: "turning gains", True: "mirrored turning gains"}
"""Gains that turn, and whether their mirror images are played."""


class Variant(Protocol):
    """A run, as far as its rules go; `tadcore.Run` is one."""

    @property
    def variant(self) -> str:
        """What sets it apart; empty where nothing does."""

    @property
    def hysteresis(self) -> float:
        """See `tadcore.simulate`."""

    @property
    def dwell(self) -> float:
        """See `tadcore.simulate`."""


def told(run: Variant) -> str:
    """The variant as it stands in a sentence."""
    edges = "edges with " if run.hysteresis > 0.0 or run.dwell > 0.0 else ""
    return edges + run.variant
