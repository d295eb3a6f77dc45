"""A study as one page: tables, figures and provenance in a single HTML file that needs nothing beside it."""

from .page import report

__all__ = ["report"]
