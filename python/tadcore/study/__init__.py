"""Studies: many games around one scenario, drawn, played in chunks, kept on disk and counted."""

from .collect import StoppingRule
from .result import StudyResult, load_study
from .study import Study

__all__ = ["StoppingRule", "Study", "StudyResult", "load_study"]
