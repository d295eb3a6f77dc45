"""The outcomes of a swept study: the cells of the grid, and all of them as one labelled dataset."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tadcore._shared.arrays import Floats
from tadcore._shared.html import as_html, line, thinned
from tadcore._shared.shares import estimate, percent
from tadcore.game.outcome import DIVERGED, NO_EQUILIBRIUM, UNPLAYED, OutcomeKind
from tadcore.scenario.paths import short
from tadcore.statistics.intervals import band, ends
from tadcore.statistics.outcomes import KINDS
from tadcore.study.study import Study, StudyResult

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

_ENDS = (*KINDS, DIVERGED, NO_EQUILIBRIUM)  # as `Tally.kinds` counts them
_LEVEL = 0.95


@dataclass(frozen=True, eq=False)
class Cell:
    """One point of the grid.

    Attributes
    ----------
    values : dict of str to object
        What each swept path is here.
    study : Study
        The study of this cell.
    result : StudyResult or None
        Its outcomes; None where the game has no equilibrium.
    escape_time : float
        Backward time at which the Riccati solution escapes; NaN where there is an equilibrium.
    """

    values: dict[str, Any]
    study: Study
    result: StudyResult | None
    escape_time: float

    @property
    def status(self) -> str:
        """``"done"`` or ``"no equilibrium"``."""
        return "no equilibrium" if self.result is None else "done"


@dataclass(frozen=True, eq=False, repr=False)
class SweepResult:
    """The cells of a sweep, the last path running fastest; made by `tadcore.sweep`.

    Attributes
    ----------
    study : Study
        What was repeated.
    grid : dict of str to tuple
        The swept paths and their values.
    cells : tuple of Cell
        One for each point of the grid.
    """

    study: Study
    grid: dict[str, tuple[Any, ...]]
    cells: tuple[Cell, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        """Lengths of the grid."""
        return tuple(map(len, self.grid.values()))

    def to_xarray(self) -> xarray.Dataset:
        """Outcomes over the grid, as a labelled dataset.

        Returns
        -------
        xarray.Dataset
            Its dimensions are the swept paths, in normal form, and ``outcome``; a defender's path is there in its
            short form too, as in ``sel({"d1.visibility_radius": 2.0})``, and every path as a keyword, as in
            ``sel(attacker_control_weight=0.8)``. Variables: ``count``, ``probability`` (the
            share of the trials) with the ends ``low`` and ``high`` of its 95 % interval (as `StudyResult.probabilities`
            has it, in each cell by itself), ``band_low`` and ``band_high`` of intervals that hold in all cells at once,
            for one outcome (Clopper and Pearson's, or the confidence sequence's, each with 1 / cells of 1 - level), and
            ``mean_time`` of every outcome (with ``"diverged"`` where games did in
            some cell), ``trials``, ``mean_end`` (the mean time of all games) and ``escape_time``; ``status`` is a
            coordinate. Where a cell has no equilibrium, counts are 0 and shares and times NaN; ``escape_time`` is NaN
            everywhere else.
        """
        import xarray as xr

        from tadcore.scenario.provenance import provenance

        played = [cell.result.tally.kinds() for cell in self.cells if cell.result is not None]
        there = np.sum(played, axis=0) if played else np.zeros(len(_ENDS), dtype=np.int64)
        shown = [i for i in range(len(_ENDS)) if i < len(OutcomeKind) or there[i]]
        names = [_ENDS[i] for i in shown]
        rows = [_summary(cell.result, shown, len(self.cells)) for cell in self.cells]

        def over(values: Sequence[Any]) -> Any:
            array = np.array(values)
            return array.reshape(self.shape + array.shape[1:])

        dims = tuple(self.grid)
        by_outcome = (*dims, "outcome")
        made = xr.Dataset(
            {
                "count": (by_outcome, over([row[0] for row in rows])),
                "probability": (by_outcome, over([row[1][0] for row in rows])),
                "low": (by_outcome, over([row[1][1] for row in rows])),
                "high": (by_outcome, over([row[1][2] for row in rows])),
                "band_low": (by_outcome, over([row[1][3] for row in rows])),
                "band_high": (by_outcome, over([row[1][4] for row in rows])),
                "mean_time": (by_outcome, over([row[2] for row in rows])),
                "trials": (dims, over([int(row[0].sum()) for row in rows])),
                "mean_end": (dims, over([row[3] for row in rows])),
                "escape_time": (dims, over([cell.escape_time for cell in self.cells])),
            },
            coords={
                **{path: _labels(values) for path, values in self.grid.items()},
                "outcome": names,
                "status": (dims, over([cell.status for cell in self.cells])),
            },
            attrs={**provenance(self.study.scenario), "seed": str(self.study.seed), "design": self.study.design},
        )
        # The same values under the name that people write, and under one that Python takes for a keyword.
        again: dict[str, str] = {}
        for path in self.grid:
            for name in (short(path), re.sub(r"\W+", "_", short(path))):
                if name not in made.coords and name not in again:
                    again[name] = path
        made = made.assign_coords({name: (path, made[path].values) for name, path in again.items()})
        for name in again:
            made = made.set_xindex(name)
        return made

    def plot(self, ax: Axes | None = None, **options: Any) -> Axes:
        """Draw probabilities over the grid, of one or two paths; see `tadcore.plotting.sweep`."""
        from tadcore.plotting import sweep as draw

        return draw(self, ax, **options)

    def _repr_html_(self) -> str:
        made = self.to_xarray()
        names = made["outcome"].values.tolist()
        parts = [made[name].values.reshape(-1, len(names)) for name in ("probability", "low", "high")]
        rows = []
        for i, cell in enumerate(self.cells):
            found = [""] * len(names) if cell.result is None else [
                " ".join(estimate(*(float(part[i, k]) for part in parts), least=3)) for k in range(len(names))
            ]  # fmt: skip
            note = f"no equilibrium: escapes {cell.escape_time:.4g} before T" if cell.result is None else ""
            rows.append([*map(_word, cell.values.values()), *found, note])
        head = [*map(short, self.grid), *(f"P({name})" for name in names), ""]
        return as_html(repr(self), head, thinned(rows), line(f"{percent(_LEVEL)} intervals, each by itself"))

    def __repr__(self) -> str:
        size = " × ".join(f"{path} ({len(values)})" for path, values in self.grid.items())
        without = sum(cell.result is None for cell in self.cells)
        lost = sum(int(cell.result.tally.kinds()[len(OutcomeKind)]) for cell in self.cells if cell.result is not None)
        said = [f"; {without} without equilibrium"] if without else []
        return f"SweepResult({size}{''.join(said)}{f'; {lost:,} games diverged' if lost else ''})"


def _summary(result: StudyResult | None, shown: list[int], cells: int) -> tuple[Any, Any, Any, float]:
    """Counts, shares with intervals and bands, and mean times by outcome, as `_ENDS` has them; the mean time of all."""
    if result is None:
        nothing = np.full(len(shown), np.nan)
        return np.zeros(len(shown), dtype=np.int64), (nothing,) * 5, nothing, float("nan")
    counts = result.tally.kinds()[shown]
    total = _times(result)[shown]
    means = np.divide(total, counts, out=np.full(len(shown), np.nan), where=counts > 0)
    method = result.probabilities(level=_LEVEL).method
    error = (1.0 - _LEVEL) / (len(OutcomeKind) if method == "sequence" else 1)
    together = band(counts, result.trials, error, cells, "sequence" if method == "sequence" else "exact")
    shares = [counts / result.trials, *ends(counts, result.trials, error, method), *together]
    return (
        counts,
        shares,
        means,
        float(result.time.mean() if result.rows.names else _times(result).sum() / result.trials),
    )


def _times(result: StudyResult) -> Floats:
    """The sum of the times of the games that ended in each way; where only counts are kept, of the steps counted."""
    kind: Any
    times: Any
    if result.rows.names:
        kind, diverged, times = result.kind, result.diverged, result.time
    else:
        tally, sc = result.tally, result.scenario
        kind, diverged, times = tally.kind, tally.diverged, tally.count * tally.step * (sc.horizon / sc.steps)
    code = np.where(diverged, _ENDS.index(DIVERGED), np.where(kind == UNPLAYED, _ENDS.index(NO_EQUILIBRIUM), kind))
    return np.bincount(code, weights=times, minlength=len(_ENDS)).astype(np.float64)


def _labels(values: Sequence[Any]) -> list[Any]:
    """The values as coordinates: numbers as they are, anything else as words."""
    plain = all(isinstance(v, int | float) and not isinstance(v, bool) for v in values)
    return list(values) if plain else [str(v) for v in values]


def _word(value: Any) -> str:
    """A swept value for people: numbers without the noise of their last bits."""
    return f"{value:.10g}" if isinstance(value, float) else str(value)
