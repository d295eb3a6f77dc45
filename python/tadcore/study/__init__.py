"""Studies: many games around one scenario, drawn, played in chunks, kept on disk and counted."""

from .collect import StoppingRule
from .merging import Merged, merge_store
from .part import StudyPart
from .reading import verify_store
from .study import Study, StudyResult, load_study

__all__ = [
    "Merged",
    "StoppingRule",
    "Study",
    "StudyPart",
    "StudyResult",
    "load_study",
    "merge_store",
    "verify_store",
]
