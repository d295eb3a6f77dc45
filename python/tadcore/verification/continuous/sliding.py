"""Chattering and its limit: a run at δ, δ/2, δ/4, … beside the continuous game, in which the edge slides.

On the grid an edge that chatters flips every few steps, and the distance of its two players stays within O(δ) of the
radius. As δ → 0 the flips grow without bound while three numbers converge, each to what Filippov's rule gives along the
circle (`tadcore.verification.play_by_events`): when the stretch begins, when it ends, and the share of the time in it
that the edge is there, which is the mean of α. Agreement of the two routes is evidence that either is right: one never
looks at the circle, the other never flips.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tadcore._shared.arrays import Floats
from tadcore._shared.shares import share
from tadcore.game.network import Edge
from tadcore.scenarios.given import ScenarioLike
from tadcore.simulation.play import simulate
from tadcore.simulation.run import Run
from tadcore.verification.checks.steps import refined

from .events import play_by_events
from .plays import EventPlay


@dataclass(frozen=True, eq=False)
class SlidingStudy:
    """The chattering of a scenario at several steps and its continuous limit; made by `sliding_study`.

    Arrays have one row for each sliding mode of ``play.slides`` and one column for each step; nan where no stretch of
    chattering at that step overlaps the sliding mode.

    Attributes
    ----------
    play : EventPlay
        The game in continuous time.
    steps : ndarray, shape (S,)
        δ, δ/2, ….
    ends : ndarray, shape (S,)
        When the game ends with each step.
    start, end : ndarray, shape (slides, S)
        First and last flip.
    flips : ndarray, shape (slides, S)
        How many.
    share : ndarray, shape (slides, S)
        Share of the instants between them at which the edge is there.
    drift : ndarray, shape (slides, S)
        Largest difference of the distance and the radius between them.
    """

    play: EventPlay
    steps: Floats
    ends: Floats
    start: Floats
    end: Floats
    flips: Floats
    share: Floats
    drift: Floats

    def __repr__(self) -> str:
        limit = self.play.outcome.time if self.play.outcome is not None else np.nan
        lines = [f"SlidingStudy: {len(self.play.slides)} sliding modes; the continuous game ends at {limit:.6g}"]
        for step, end in zip(self.steps, self.ends, strict=True):
            lines.append(f"  δ = {step:<10.6g} ends at {end:.6g}")
        for s, slide in enumerate(self.play.slides):
            names = ", ".join("→".join(edge) for edge in slide.edges)
            there = share(slide.share)
            lines.append(f"  {names}: slides from {slide.start:.6g} to {slide.end:.6g}, there {there} of it")
            for c, step in enumerate(self.steps):
                if np.isnan(self.flips[s, c]):
                    lines.append(f"    δ = {step:<10.6g} no chattering then")
                    continue
                lines.append(
                    f"    δ = {step:<10.6g} {self.flips[s, c]:.0f} flips from {self.start[s, c]:.6g} to "
                    f"{self.end[s, c]:.6g}, there {share(self.share[s, c])} of it, within {self.drift[s, c]:.2g} of ζ"
                )
        return "\n".join(lines)


def sliding_study(sc: ScenarioLike, *, halvings: int = 3) -> SlidingStudy:
    """Play a scenario in continuous time and at δ, δ/2, δ/4, …, and compare each sliding mode with the chattering.

    Parameters
    ----------
    sc : Scenario, path or name
        The scenario, without failures, links and disturbances; its step is the first.
    halvings : int
        How many times the step is halved.

    Returns
    -------
    SlidingStudy
        The continuous game, and what every step makes of its sliding modes.

    Raises
    ------
    ScenarioError
        The game has failures, links or disturbances.
    NoEquilibriumError
        The game has no equilibrium on [0, T].
    """
    play = play_by_events(sc)
    runs = [simulate(finer) for finer in refined(sc, halvings)]
    cells = np.full((5, len(play.slides), len(runs)), np.nan)
    for s, slide in enumerate(play.slides):
        for c, run in enumerate(runs):
            loud = [
                x for x in run.chattering if x.edge == slide.edges[0] and x.start < slide.end and slide.start < x.end
            ]
            if loud:
                found = max(loud, key=lambda x: x.end - x.start)
                cells[:, s, c] = found.start, found.end, found.flips, *_between(run, found.edge, found.start, found.end)
    steps = np.array([run.scenario.step for run in runs])
    return SlidingStudy(play, steps, np.array([run.outcome.time for run in runs]), *cells)


def _between(run: Run, edge: Edge, start: float, end: float) -> tuple[float, float]:
    """Share of the instants in [start, end) at which an edge is there, and how far its distance is from the radius."""
    players = run.scenario.players
    i, j = (players.index(label) for label in edge)
    at = slice(*np.searchsorted(run.times, [start, end]).tolist())
    there = run.adjacency[at, i, i if j == len(players) - 1 else j]
    distance = np.linalg.norm(run.position[at, i] - run.position[at, j], axis=-1)
    return float(there.mean()), float(np.abs(distance - run.scenario.visibility_radii[i]).max())
