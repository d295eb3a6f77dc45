"""Outcome probabilities against the radii of several players, with bands that hold for all of them at once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tadcore._shared.html import as_html, line
from tadcore._shared.shares import estimate, percent
from tadcore.errors import ScenarioError
from tadcore.scenario.paths import label

from .radius import RadiusCurve
from .single_radii import SmallestRadius

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True, eq=False, repr=False)
class RadiusCurves:
    """One curve for each of several players, over the same radii and starts; made by `radius_curve`.

    ``curves["d1"]`` is one of them, and iteration gives them in the order in which the players were named.

    Attributes
    ----------
    curves : tuple of RadiusCurve
        In each only that player's radius changes. The bands hold at all radii of all players at once, for one outcome.
    """

    curves: tuple[RadiusCurve, ...]

    @property
    def players(self) -> tuple[str, ...]:
        """Whose radii."""
        return tuple(curve.player for curve in self.curves)

    def __len__(self) -> int:
        return len(self.curves)

    def __iter__(self) -> Iterator[RadiusCurve]:
        return iter(self.curves)

    def __getitem__(self, player: str) -> RadiusCurve:
        """The curve of one player.

        Raises
        ------
        ScenarioError
            It has none.
        """
        name = label(player) if isinstance(player, str) else player
        if name not in self.players:
            raise ScenarioError("player", player, f"one of {', '.join(self.players)}")
        return self.curves[self.players.index(name)]

    def smallest(self, at_least: float, outcome: str = "intercepted") -> dict[str, SmallestRadius]:
        """For each player the smallest radius at which an outcome has at least this probability.

        As `RadiusCurve.smallest`, at the level of the bands: all answers hold at once.

        Parameters
        ----------
        at_least : float
            A probability in (0, 1).
        outcome : str
            ``"timeout"``, ``"captured"``, ``"intercepted"``, or ``"d1"`` … ``"dn"``.

        Returns
        -------
        dict of str to SmallestRadius
            By player.

        Raises
        ------
        ScenarioError
            No such probability or outcome.
        """
        return {curve.player: curve.smallest(at_least, outcome) for curve in self.curves}

    def to_xarray(self) -> xarray.Dataset:
        """The curves over (player, outcome, radius), as `RadiusCurve.to_xarray` has each.

        Returns
        -------
        xarray.Dataset
            ``reference`` is a variable over the players. Where games of some players diverged, the others have NaN for
            that outcome.
        """
        import xarray as xr

        each = [curve.to_xarray() for curve in self.curves]
        made = xr.concat(
            [part.drop_attrs().assign(reference=part.attrs["reference"]) for part in each],
            dim=xr.Variable("player", list(self.players)),
            join="outer",
        )
        kept = {name: value for name, value in each[0].attrs.items() if name not in ("player", "reference")}
        return made.assign_attrs(kept)

    def __repr__(self) -> str:
        first = self.curves[0]
        by = f"; {first.rule}" if first.rule else ""
        head = (
            f"RadiusCurves({first.radius} at {len(first.radii)} radii in [{first.radii[0]:g}, {first.radii[-1]:g}], "
            f"{first.trials:,} trials, {percent(first.level)} for all at once{by})"
        )
        return "\n".join([head, *(f"  {player:9} {best} of P(intercepted)" for player, best in self._best())])

    def _best(self) -> list[tuple[str, str]]:
        """The radius of each player where interceptions came most often."""
        found = []
        for curve in self.curves:
            i = curve.names.index("intercepted")
            r = int(curve.estimate[i].argmax())
            share = " ".join(estimate(curve.estimate[i, r], curve.band_low[i, r], curve.band_high[i, r]))
            found.append((curve.player, f"best at {curve.radii[r]:g}: {share}"))
        return found

    def _repr_html_(self) -> str:
        head, *_ = repr(self).splitlines()
        first = self.curves[0]
        return as_html(
            head,
            ["player", "P(intercepted)"],
            [[player, best] for player, best in self._best()],
            line(f"{percent(first.level)}, at all radii of all players at once"),
        )
