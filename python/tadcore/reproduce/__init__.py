"""The paper's section VI, computed, compared and drawn."""

from .comparison import Report, Row
from .paper import compare, reproduce

__all__ = ["Report", "Row", "compare", "reproduce"]
