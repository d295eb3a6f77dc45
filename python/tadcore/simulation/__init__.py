"""Games played: one with everything recorded, or many in a batch with their outcomes alone."""

from .batch import Batch, simulate_batch
from .loading import load_run
from .run import Run, simulate

__all__ = ["Batch", "Run", "load_run", "simulate", "simulate_batch"]
