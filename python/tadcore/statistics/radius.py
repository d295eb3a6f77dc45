"""What the outcomes of the same trials at many radii say: curves with intervals, bands, differences and slopes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import Floats, Integers
from tadcore._shared.html import as_html, line, thinned
from tadcore._shared.shares import estimate, percent
from tadcore.errors import ScenarioError

from .differences import difference_interval
from .outcomes import excluding
from .single_radii import Breakpoints, SmallestRadius

if TYPE_CHECKING:
    import xarray

RadiusKind: TypeAlias = Literal["visibility", "capture"]


@dataclass(frozen=True, eq=False, repr=False)
class RadiusCurve:
    """Outcome probabilities against one radius; made by `radius_curve`.

    Attributes
    ----------
    player : str
        Whose radius; ``"d*"`` for one that all defenders share.
    radius : {"visibility", "capture"}
        Which one: ζ or σ.
    radii : ndarray, shape (R,)
        Where it was evaluated.
    names : tuple of str
        ``"timeout"``, ``"captured"``, ``"intercepted"``, then ``"d1"`` … ``"dn"``; last ``"diverged"``, where some
        trials did at some radius: the shapes below then begin with 4 + n.
    estimate, low, high : ndarray, shape (3 + n, R)
        Probabilities with pointwise intervals: Wilson's, or a confidence sequence's where a rule was asked when to
        stop.
    band_low, band_high : ndarray, shape (3 + n, R)
        The band of one outcome that holds at all R radii at once: Clopper and Pearson's intervals, or the confidence
        sequence's, each with 1 / R of 1 - level.
    reference : float
        The radius that differences are taken against; the scenario's own unless another was given. NaN where that is
        of a team whose defenders have several there: differences are then against these.
    difference, difference_low, difference_high : ndarray, shape (3 + n, R)
        P(r) - P(reference), paired, each interval by itself.
    slope, slope_low, slope_high : ndarray, shape (3 + n, R - 1)
        The gain per unit of radius between neighbouring radii, paired, each interval by itself; 0 up to inf.
    kind, defender : ndarray of int8 and int32, shape (R, M)
        Every outcome, as in `tadcore.Batch`.
    diverged : ndarray of bool, shape (R, M)
        Which games diverged.
    level : float
        Confidence level.
    breakpoints : Breakpoints or None
        The radii at which single trials change, where asked for.
    rule : str
        The rule that was asked when to stop the study; empty where the number of trials was fixed beforehand.
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
    diverged: NDArray[np.bool_]
    level: float
    breakpoints: Breakpoints | None
    rule: str = ""

    @property
    def trials(self) -> int:
        """M."""
        return int(self.kind.shape[1])

    def smallest(self, at_least: float, outcome: str = "intercepted") -> SmallestRadius:
        """The smallest of the radii played at which an outcome has at least this probability, at the band's level.

        That is: the lower end of the band, which holds at all radii at once, reaches it. P need not grow with a radius,
        so a larger radius may fall short again; and a smaller one, between those played, may do.

        Parameters
        ----------
        at_least : float
            A probability in (0, 1).
        outcome : str
            One of `names`.

        Returns
        -------
        SmallestRadius
            The radius, or that none of them does and which is the best.

        Raises
        ------
        ScenarioError
            No such probability or outcome.
        """
        if not (isinstance(at_least, int | float | np.floating) and 0.0 < at_least < 1.0):
            raise ScenarioError("at_least", at_least, "a probability in (0, 1)")
        if outcome not in self.names:
            raise ScenarioError("outcome", outcome, f"one of {', '.join(self.names)}")
        row = self.names.index(outcome)
        reached = np.flatnonzero(self.band_low[row] >= at_least)
        best = int(self.estimate[row].argmax())
        r = int(reached[0]) if reached.size else best
        return SmallestRadius(
            outcome=outcome,
            at_least=float(at_least),
            radius=float(self.radii[r]) if reached.size else None,
            best=float(self.radii[best]),
            estimate=float(self.estimate[row, r]),
            low=float(self.band_low[row, r]),
            high=float(self.band_high[row, r]),
            level=self.level,
        )

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
                **({"rule": self.rule} if self.rule else {}),
            },
        )

    def __repr__(self) -> str:
        i = self.names.index("intercepted")
        ends = [int(np.argmin(self.estimate[i])), int(np.argmax(self.estimate[i]))]
        least, most = (" ".join(estimate(self.estimate[i, r], self.low[i, r], self.high[i, r])) for r in ends)
        lost = f"; {int(self.diverged.sum()):,} of {self.diverged.size:,} games diverged" if self.diverged.any() else ""
        by = f"{lost}; {self.rule}" if self.rule else lost
        return (
            f"RadiusCurve({self.radius} of {self.player} at {len(self.radii)} radii in [{self.radii[0]:g}, "
            f"{self.radii[-1]:g}], {self.trials:,} trials: P(intercepted) from {least} to {most}, "
            f"{percent(self.level)}{by})"
        )

    def _repr_html_(self) -> str:
        by = f", {self.rule}" if self.rule else ""
        title = f"{self.radius} radius of {self.player}, {self.trials:,} trials at each{by}"
        head, rows = _rows(self)
        return as_html(title, head, thinned(rows), line(f"{percent(self.level)}, at all radii at once"))


def _rows(curve: RadiusCurve) -> tuple[list[str], list[list[str]]]:
    """Every radius with the probabilities of what excludes one another, and their bands."""
    shown = excluding(curve.names)
    parts = (curve.estimate, curve.band_low, curve.band_high)
    rows = [
        [f"{radius:g}", *(" ".join(estimate(*(float(part[i, r]) for part in parts), least=3)) for i in shown), ""]
        for r, radius in enumerate(curve.radii)
    ]
    return ["radius", *(f"P({curve.names[i]})" for i in shown), ""], rows


def paired_differences(
    pairs: list[tuple[Integers, Integers]], trials: int, level: float, method: Literal["score", "sequence"]
) -> Floats:
    """Difference, low and high, shape (3, outcomes, R), from what is discordant at each of R radii."""
    counts = np.array(pairs)  # (R, 2, outcomes)
    first, second = counts[:, 0].T, counts[:, 1].T
    return np.array(
        [(first - second) / trials, *difference_interval(first, second, trials, level=level, method=method)]
    )
