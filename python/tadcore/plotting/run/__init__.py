"""Figures of one recorded run, or of two overlaid."""
