"""Figures of many games: outcome maps, shares, curves with bands."""
