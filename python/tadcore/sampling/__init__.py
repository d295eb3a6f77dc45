"""How the varied quantities of a study are drawn."""

from .base import Block, Sampler
from .shapes import Annulus, Box, Choice, Cycle, Disk, Gaussian

__all__ = ["Annulus", "Block", "Box", "Choice", "Cycle", "Disk", "Gaussian", "Sampler"]
