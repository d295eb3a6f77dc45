r"""The value of a radius: outcome probabilities against the visibility or capture radius of one player, or of a team.

A radius is no part of the game's weights, so every radius is played with the same gains and, here, from the same M
starts: common random numbers. The differences between radii are then differences between pairs of trials, and far
better known than the probabilities themselves (`tadcore.statistics.compare`).

For one start the outcome is *piecewise constant* in ζ_i: a trajectory changes only where ζ_i passes a distance from
player i to another at some instant of the grid, and between two such distances the whole game is the same. It is *not
monotone* in general: a defender that sees further plays another game from that moment on, and may lose what it would
have won; so P(intercepted) may fall where ζ_i grows, and no monotone band or bisection over the whole range is used.

- **Pointwise** intervals are Wilson's; **bands** hold at all R radii at once, for one outcome: Clopper and Pearson's
  exact intervals, each with (1 - level) / R (Bonferroni, whatever the dependence between radii). Of L players asked for
  together they hold at all L R radii, each with (1 - level) / (L R).
- **Differences** against a reference radius and **slopes** between neighbouring radii, the value of a unit of radius,
  :math:`(P(r_{k+1}) - P(r_k)) / (r_{k+1} - r_k)`, carry paired score intervals, each by itself.
- Of a study that a rule was asked to stop, all of these are confidence sequences instead.
- **Breakpoints**, on request: for each trial and each pair of neighbouring radii with different outcomes, bisection
  finds a radius at which the outcome changes, and continues until the changes found lead from the one outcome to the
  other. A pair of neighbours with the same outcome is taken to hold none; a finer grid sees more.
"""

from __future__ import annotations

from typing import overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tadcore._shared.arrays import Floats, as_amount
from tadcore._shared.calls import public
from tadcore._shared.progress import bar
from tadcore.errors import ScenarioError
from tadcore.scenarios.given import ScenarioLike
from tadcore.simulation.batch import Batch
from tadcore.statistics import TrialOutcomes, outcome_names
from tadcore.statistics.confidence import Confidence
from tadcore.statistics.differences import discordant
from tadcore.statistics.outcomes import indicators
from tadcore.statistics.radii import RadiusCurves
from tadcore.statistics.radius import RadiusCurve, RadiusKind, paired_differences
from tadcore.study.study import Study

from .breakpoints import breakpoints
from .replays import Replays, ending_of, refuse_random, seed_of, starts_of


@overload
def radius_curve(
    source: ScenarioLike | Study | TrialOutcomes,
    positions: ArrayLike | None = None,
    *,
    player: str = ...,
    radii: ArrayLike,
    kind: RadiusKind = ...,
    reference: float | None = ...,
    level: float | None = ...,
    refine: bool = ...,
    tolerance: float = ...,
    seed: int = ...,
    threads: int | None = ...,
    progress: bool = ...,
) -> RadiusCurve: ...


@overload
def radius_curve(
    source: ScenarioLike | Study | TrialOutcomes,
    positions: ArrayLike | None = None,
    *,
    player: list[str] | tuple[str, ...],
    radii: ArrayLike,
    kind: RadiusKind = ...,
    reference: float | None = ...,
    level: float | None = ...,
    refine: bool = ...,
    tolerance: float = ...,
    seed: int = ...,
    threads: int | None = ...,
    progress: bool = ...,
) -> RadiusCurves: ...


@public
def radius_curve(
    source: ScenarioLike | Study | TrialOutcomes,
    positions: ArrayLike | None = None,
    *,
    player: str | list[str] | tuple[str, ...] = "d1",
    radii: ArrayLike,
    kind: RadiusKind = "visibility",
    reference: float | None = None,
    level: float | None = None,
    refine: bool = False,
    tolerance: float = 1e-9,
    seed: int = 0,
    threads: int | None = None,
    progress: bool = False,
) -> RadiusCurve | RadiusCurves:
    """Play the same starts at every radius of one player, or of several, one after the other.

    Parameters
    ----------
    source : Scenario, path, name, Study or StudyResult
        The game, or a study whose trials are played, again or for the first time. What it varies stays varied, but for
        the radius in question, and a game ends as in the study, at an instant or at the crossing itself.
    positions : array_like, shape (M, n + 2, dim), optional
        M independent starts; required with a Scenario, and not taken with a study.
    player : str or list of str
        ``"d1"`` … ``"dn"`` (or ``"defenders[0]"`` …); in I2 ``"target"`` for its visibility, and ``"attacker"`` for its
        capture radius; ``"d*"`` for one radius that all defenders share. Of several, each has its curve, the others
        keeping their own radii.
    radii : array_like, shape (R,)
        Radii to play, increasing. Visibility may end in inf.
    kind : {"visibility", "capture"}
        ζ or σ.
    reference : float, optional
        The radius to take differences against; the player's own in the scenario by default, for ``"d*"`` the radii that
        the defenders have there.
    level : float
        Confidence level of intervals and bands; 0.95, or that of the rule that was asked when to stop the study.
    refine : bool
        Whether to find, for each trial, the radii at which its outcome changes.
    tolerance : float
        How closely.
    seed : int
        Of failures and disturbances, where a Scenario has any; start r is trial r. A study has its own.
    threads : int, optional
        Worker threads; all cores by default.
    progress : bool
        Whether to show a progress bar, where standard error is a terminal.

    Returns
    -------
    RadiusCurve or RadiusCurves
        Probabilities, differences, slopes and, if asked for, breakpoints; of a list of players one for each, with
        bands that hold for all of them at once.

    Raises
    ------
    ScenarioError
        A radius breaks a rule of the game (σ < ζ for every defender), or the player has no such radius.
    NoEquilibriumError
        The game has no equilibrium on [0, T].
    """
    sure = Confidence.of(source, level)
    sc, rows = starts_of(source, positions)
    if refine:
        refuse_random(sc, "refine", "leave it out; the curve itself shares failures and disturbances between radii")
    players = [player] if isinstance(player, str) else _several(player)
    draws = seed_of(source, seed)
    ending = ending_of(source)
    games = [Replays(sc, rows, name, kind, threads, draws, ending) for name in players]
    if len({each.player for each in games}) < len(games):
        raise ScenarioError("player", player, "players that are named once each")
    asked = [(each.checked("radii", radii), _reference(each, reference)) for each in games]
    grid = asked[0][0]
    if grid.ndim != 1 or grid.size == 0 or np.any(grid[1:] <= grid[:-1]):
        raise ScenarioError("radii", radii, "a list of increasing radii")
    places, finest = len(games) * len(grid), as_amount("tolerance", tolerance) if refine else None
    curves = tuple(
        _curve(each, grid, own, sure, places, finest, progress=progress)
        for each, (_, own) in zip(games, asked, strict=True)
    )
    return curves[0] if isinstance(player, str) else RadiusCurves(curves)


def _several(players: object) -> list[str]:
    """The players of a list of them."""
    if not isinstance(players, list | tuple) or not players:
        raise ScenarioError("player", players, 'a player such as "d1", or a list of them')
    for player in players:
        if not isinstance(player, str):
            raise ScenarioError("player", player, 'a player such as "d1"')
    return list(players)


def _reference(games: Replays, reference: float | None) -> float:
    """The radius that differences are taken against."""
    if reference is None:
        return games.own
    if np.ndim(reference):
        raise ScenarioError("reference", reference, "one radius")
    return float(games.checked("reference", reference))


def _curve(
    games: Replays, grid: Floats, own: float, sure: Confidence, places: int, tolerance: float | None, *, progress: bool
) -> RadiusCurve:
    """The curve of one player, with a band that holds at so many places at once, its own radii among them."""
    sc, kind, trials = games.sc, games.kind, len(games.rows)
    played = [games.play(radius) for radius in bar(grid.tolist(), f"radius of {games.player}", show=progress)]
    same = np.flatnonzero(grid == own)
    base = played[same[0]] if same.size else games.play_own() if np.isnan(own) else games.play(own)

    lost = any(batch.diverged.any() for batch in (base, *played))

    def events(batch: Batch) -> NDArray[np.bool_]:
        return indicators(batch.kind, batch.defender, sc.n, batch.diverged if lost else None)

    at_reference = events(base)
    counts, against_reference, against_last = [], [], []
    last = at_reference
    for batch in played:  # one set of indicators at a time: they are the largest arrays here
        event = events(batch)
        counts.append(event.sum(axis=1))
        against_reference.append(discordant(event, at_reference))
        against_last.append(discordant(event, last))
        last = event
    count = np.array(counts).T
    low, high = sure.ends(count, trials, "wilson")
    band_low, band_high = sure.band(count, trials, places)
    difference = paired_differences(against_reference, trials, sure.level, sure.paired)
    slope = paired_differences(against_last, trials, sure.level, sure.paired)[..., 1:] / np.diff(grid)
    return RadiusCurve(
        player=games.player,
        radius=kind,
        radii=grid,
        names=outcome_names(sc.n, diverged=lost),
        estimate=count / trials,
        low=low,
        high=high,
        band_low=band_low,
        band_high=band_high,
        reference=own,
        difference=difference[0],
        difference_low=difference[1],
        difference_high=difference[2],
        slope=slope[0],
        slope_low=slope[1],
        slope_high=slope[2],
        kind=np.array([batch.kind for batch in played]),
        defender=np.array([batch.defender for batch in played]),
        diverged=np.array([batch.diverged for batch in played]),
        level=sure.level,
        breakpoints=None if tolerance is None else breakpoints(games, grid, played, tolerance),
        rule=sure.rule,
    )
