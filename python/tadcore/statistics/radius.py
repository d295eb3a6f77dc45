"""What the outcomes of the same trials at many radii say: curves with intervals, bands, differences and slopes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import Floats, Integers

from .comparison import difference_interval

if TYPE_CHECKING:
    import xarray

RadiusKind: TypeAlias = Literal["visibility", "capture"]


@dataclass(frozen=True, eq=False, repr=False)
class Breakpoints:
    """Radii at which the outcome of a trial changes, ordered by trial, then by radius.

    Attributes
    ----------
    trial : ndarray of int, shape (B,)
        Which trial.
    radius : ndarray, shape (B,)
        The least radius at which the new outcome holds, to within ``tolerance`` from above.
    kind_before, kind_after : ndarray of int8, shape (B,)
        Codes of `OutcomeKind` below and at ``radius``.
    defender_before, defender_after : ndarray of int32, shape (B,)
        The intercepting defender, 0-based; -1 where none intercepts.
    tolerance : float
        How far above the true breakpoint ``radius`` may lie.
    """

    trial: Integers
    radius: Floats
    kind_before: NDArray[np.int8]
    kind_after: NDArray[np.int8]
    defender_before: NDArray[np.int32]
    defender_after: NDArray[np.int32]
    tolerance: float

    def __len__(self) -> int:
        return len(self.trial)

    def __repr__(self) -> str:
        return f"Breakpoints({len(self):,} in {len(np.unique(self.trial)):,} trials)"


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


def paired_differences(pairs: list[tuple[Integers, Integers]], trials: int, level: float) -> Floats:
    """Difference, low and high, shape (3, outcomes, R), from what is discordant at each of R radii."""
    counts = np.array(pairs)  # (R, 2, outcomes)
    first, second = counts[:, 0].T, counts[:, 1].T
    return np.array([(first - second) / trials, *difference_interval(first, second, trials, level=level)])
