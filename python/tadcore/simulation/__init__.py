"""Games played: one with everything recorded, or many in a batch with their outcomes alone."""

from tadcore.game.passes import Pass

from .batch import Batch, simulate_batch
from .play import simulate
from .run import Run

__all__ = ["Batch", "Pass", "Run", "simulate", "simulate_batch"]
