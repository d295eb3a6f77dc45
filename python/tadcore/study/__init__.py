"""Studies: many games around one scenario, drawn, played in chunks, kept on disk and counted."""

from .collect import StoppingRule
from .study import Study, StudyResult, load_study

__all__ = ["StoppingRule", "Study", "StudyResult", "load_study"]
