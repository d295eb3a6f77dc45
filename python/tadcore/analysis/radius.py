r"""The value of a radius: outcome probabilities against how far one player sees, or reaches.

A radius is no part of the game's weights, so every radius is played with the same gains and, here, from the same M
starts: common random numbers. The differences between radii are then differences between pairs of trials, and far
better known than the probabilities themselves (`tadcore.statistics.compare`).

For one start the outcome is *piecewise constant* in ζ_i: a trajectory changes only where ζ_i passes a distance from
player i to another at some instant of the grid, and between two such distances the whole game is the same. It is *not
monotone* in general: a defender that sees further plays another game from that moment on, and may lose what it would
have won; so P(intercepted) may fall where ζ_i grows, and no monotone band or bisection over the whole range is used.

- **Pointwise** intervals are Wilson's; **bands** hold at all R radii at once, for one outcome: Wilson's at
  1 - (1 - level) / R (Bonferroni).
- **Differences** against a reference radius and **slopes** between neighbouring radii, the value of a unit of radius,
  :math:`(P(r_{k+1}) - P(r_k)) / (r_{k+1} - r_k)`, carry paired score intervals.
- **Breakpoints**, on request: for each trial and each pair of neighbouring radii with different outcomes, bisection
  finds a radius at which the outcome changes, and goes on until the changes found lead from the one outcome to the
  other. A pair of neighbours with the same outcome is taken to hold none; a finer grid sees more.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tadcore.cli.terminal import bar
from tadcore.errors import ScenarioError
from tadcore.statistics import difference_interval, outcome_names, proportion_interval
from tadcore.statistics.comparison import discordant
from tadcore.statistics.outcomes import Floats, Integers, as_level, indicators

from .breakpoints import Breakpoints, breakpoints
from .replays import RadiusKind, Replays, starts_of

if TYPE_CHECKING:
    import xarray

    from tadcore.scenario.model import Scenario
    from tadcore.statistics import TrialOutcomes

__all__ = ["Breakpoints", "RadiusCurve", "radius_curve"]


@dataclass(frozen=True, eq=False, repr=False)
class RadiusCurve:
    """Outcome probabilities against one radius; made by `radius_curve`.

    Attributes
    ----------
    player : str
        Whose radius.
    radius : {"visibility", "capture"}
        Which one: ζ or σ.
    radii : ndarray, shape (R,)
        Where it was evaluated.
    names : tuple of str
        ``"timeout"``, ``"captured"``, ``"intercepted"``, then ``"d1"`` … ``"dn"``.
    estimate, low, high : ndarray, shape (3 + n, R)
        Probabilities with pointwise intervals.
    band_low, band_high : ndarray, shape (3 + n, R)
        The band that holds at all radii at once.
    reference : float
        The radius that differences are taken against; the scenario's own unless another was given.
    difference, difference_low, difference_high : ndarray, shape (3 + n, R)
        P(r) - P(reference), paired.
    slope, slope_low, slope_high : ndarray, shape (3 + n, R - 1)
        The gain per unit of radius between neighbouring radii, paired.
    kind, defender : ndarray of int8 and int32, shape (R, M)
        Every outcome, as in `tadcore.Batch`.
    level : float
        Confidence level.
    breakpoints : Breakpoints or None
        The radii at which single trials change, where asked for.
    """

    player: str
    radius: RadiusKind
    radii: Floats
    names: tuple[str, ...]
    estimate: Floats
    low: Floats
    high: Floats
    band_low: Floats
    band_high: Floats
    reference: float
    difference: Floats
    difference_low: Floats
    difference_high: Floats
    slope: Floats
    slope_low: Floats
    slope_high: Floats
    kind: NDArray[np.int8]
    defender: NDArray[np.int32]
    level: float
    breakpoints: Breakpoints | None

    @property
    def trials(self) -> int:
        """M."""
        return int(self.kind.shape[1])

    def to_xarray(self) -> xarray.Dataset:
        """The curves over (outcome, radius), the slopes over (outcome, interval)."""
        import xarray as xr

        curves = ["estimate", "low", "high", "band_low", "band_high"]
        curves += ["difference", "difference_low", "difference_high"]
        slopes = ["slope", "slope_low", "slope_high"]
        return xr.Dataset(
            {name: (("outcome", "radius"), getattr(self, name)) for name in curves}
            | {name: (("outcome", "interval"), getattr(self, name)) for name in slopes},
            coords={
                "outcome": list(self.names),
                "radius": self.radii,
                "interval": (self.radii[1:] + self.radii[:-1]) / 2.0,
            },
            attrs={
                "player": self.player,
                "kind": self.radius,
                "reference": self.reference,
                "trials": self.trials,
                "level": self.level,
            },
        )

    def __repr__(self) -> str:
        i = self.names.index("intercepted")
        low, high = self.estimate[i].min(), self.estimate[i].max()
        return (
            f"RadiusCurve({self.radius} of {self.player} at {len(self.radii)} radii in [{self.radii[0]:g}, "
            f"{self.radii[-1]:g}], {self.trials:,} trials: P(intercepted) from {low:.4f} to {high:.4f})"
        )


def radius_curve(
    source: Scenario | TrialOutcomes,
    positions: ArrayLike | None = None,
    *,
    player: str = "d1",
    radii: ArrayLike,
    kind: RadiusKind = "visibility",
    reference: float | None = None,
    level: float = 0.95,
    refine: bool = False,
    tolerance: float = 1e-9,
    threads: int | None = None,
    progress: bool = False,
) -> RadiusCurve:
    """Play the same starts at every radius of one player.

    Parameters
    ----------
    source : Scenario or StudyResult
        The game, or a finished study whose trials are played again; what the study varies stays varied, but for the
        radius in question.
    positions : array_like, shape (M, n + 2, dim), optional
        M independent starts; required with a Scenario, and not taken with a study.
    player : str
        ``"d1"`` … ``"dn"`` (or ``"defenders[0]"`` …); in I2 ``"target"`` for its visibility, and ``"attacker"`` for its
        capture radius.
    radii : array_like, shape (R,)
        Radii to play, increasing. Visibility may end in inf.
    kind : {"visibility", "capture"}
        ζ or σ.
    reference : float, optional
        The radius to take differences against; the scenario's own by default.
    level : float
        Confidence level of intervals and bands.
    refine : bool
        Whether to find, for each trial, the radii at which its outcome changes.
    tolerance : float
        How closely.
    threads : int, optional
        Worker threads; all cores by default.
    progress : bool
        Whether to show a progress bar, where standard error is a terminal.

    Returns
    -------
    RadiusCurve
        Probabilities, differences, slopes and, if asked for, breakpoints.

    Raises
    ------
    ScenarioError
        A radius breaks a rule of the game (σ < ζ for every defender), or the player has no such radius.
    NoEquilibriumError
        The game has no equilibrium on [0, T].
    """
    confidence = as_level(level)
    sc, rows = starts_of(source, positions)
    games = Replays(sc, rows, player, kind, threads)
    grid = games.checked("radii", radii)
    if grid.ndim != 1 or grid.size == 0 or np.any(np.diff(grid) <= 0.0):
        raise ScenarioError("radii", radii, "a list of increasing radii")
    own = games.own if reference is None else float(games.checked("reference", reference))
    played = [games.play(radius) for radius in bar(grid.tolist(), f"radius of {games.player}", show=progress)]
    same = np.flatnonzero(grid == own)
    base = played[same[0]] if same.size else games.play(own)

    at_reference = indicators(base.kind, base.defender, sc.n)
    counts, against_reference, against_last = [], [], []
    last = at_reference
    for batch in played:  # one set of indicators at a time: they are the largest arrays here
        event = indicators(batch.kind, batch.defender, sc.n)
        counts.append(event.sum(axis=1))
        against_reference.append(discordant(event, at_reference))
        against_last.append(discordant(event, last))
        last = event
    count = np.array(counts).T
    low, high = proportion_interval(count, len(rows), level=confidence)
    together = 1.0 - (1.0 - confidence) / len(grid)
    band_low, band_high = proportion_interval(count, len(rows), level=together)
    difference = _differences(against_reference, len(rows), confidence)
    slope = _differences(against_last, len(rows), confidence)[..., 1:] / np.diff(grid)
    return RadiusCurve(
        player=games.player,
        radius=kind,
        radii=grid,
        names=outcome_names(sc.n),
        estimate=count / len(rows),
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
        level=confidence,
        breakpoints=breakpoints(games, grid, played, tolerance) if refine else None,
    )


def _differences(pairs: list[tuple[Integers, Integers]], trials: int, level: float) -> Floats:
    """Difference, low and high, shape (3, outcomes, R), from what is discordant at each of R radii."""
    counts = np.array(pairs)  # (R, 2, outcomes)
    first, second = counts[:, 0].T, counts[:, 1].T
    return np.array([(first - second) / trials, *difference_interval(first, second, trials, level=level)])
