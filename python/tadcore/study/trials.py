"""The outcomes of a study, trial by trial, and what follows from them alone."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from tadcore._shared.arrays import Floats
from tadcore.scenario.model import Scenario
from tadcore.scenario.paths import ByPath
from tadcore.simulation.termination import Termination
from tadcore.statistics import Comparison, Incidence, OutcomeProbabilities, TrialOutcomes
from tadcore.statistics.stopping import Stopping
from tadcore.statistics.tally import Tally

from .part import named
from .rows import Rows
from .table import FIXED, PASSED

if TYPE_CHECKING:
    import pandas
    import polars


@dataclass(frozen=True, eq=False, repr=False)
class Trials:
    """Outcomes and inputs, one row for each trial; `StudyResult` is one that knows its study."""

    scenario: Scenario
    seed: int
    rows: Rows
    stopping: Stopping | None = None
    termination: Termination = "sampled"

    @property
    def trials(self) -> int:
        """Trials in the table: as many as were asked for, or fewer where a rule stopped the study or it was cut off."""
        return self.rows.trials

    @cached_property
    def table(self) -> pa.Table:
        """One row for each trial, all in memory; `pieces` reads them part by part.

        Raises
        ------
        ScenarioError
            The study keeps counts alone.
        OutOfMemoryError
            The rows take more than 4 GiB.
        """
        return self.rows.table()

    def pieces(self) -> Iterator[pa.Table]:
        """The rows in their order, as tables of at most half a million: what a store holds is read part by part."""
        return self.rows.pieces()

    @property
    def tally(self) -> Tally:
        """How many trials ended in each way at each step, whatever is kept of them."""
        return self.rows.tally

    @cached_property
    def kind(self) -> NDArray[np.int8]:
        """Codes of `OutcomeKind`, shape (trials,)."""
        return self._column("kind")

    @cached_property
    def defender(self) -> NDArray[np.int32]:
        """The intercepting defender, 0-based, -1 where none intercepted; shape (trials,)."""
        return self._column("defender")

    @cached_property
    def time(self) -> Floats:
        """The instant of the end, shape (trials,)."""
        return self._column("time")

    @cached_property
    def diverged(self) -> NDArray[np.bool_]:
        """Whether the game diverged before its end or at it, shape (trials,); see `tadcore.game.Divergence`."""
        return self._column("diverged")

    @cached_property
    def passed(self) -> NDArray[np.bool_] | None:
        """Whether a capture radius was entered between two instants, shape (trials,); see `tadcore.Batch`.

        None where the study did not look for that: ``Study(…, passes=True)``.
        """
        return self._column("passed") if "passed" in self.rows.names else None

    @cached_property
    def inputs(self) -> dict[str, Floats]:
        """What was drawn: an array of shape (trials,) for each varied component, by the name of its column.

        Any spelling of a path finds it: ``inputs["d1.visibility_radius"]``.
        """
        own = FIXED | PASSED
        return ByPath({name: self._column(name) for name in self.rows.names if name not in own})

    def counts(self) -> dict[str, int]:
        """How many games ended in each way; those that diverged, if any, are counted as ``"diverged"`` alone."""
        return named(self.tally)

    def probabilities(
        self, *, level: float | None = None, method: Literal["wilson", "exact", "sequence"] | None = None
    ) -> OutcomeProbabilities:
        """How often each outcome came, with intervals: see `tadcore.statistics.probabilities`.

        Parameters
        ----------
        level : float, optional
            Confidence level; 0.95, or that of the rule that was asked when to stop.
        method : {"wilson", "exact", "sequence"}, optional
            Wilson's score interval, Clopper and Pearson's exact one, or a confidence sequence. Where a rule was asked
            when to stop, the sequence is the default, with `HalfWidth` the rule's own intervals, and the other two are
            refused: they hold for a number of trials that was fixed beforehand.

        Raises
        ------
        ScenarioError
            An option breaks a rule.
        """
        from tadcore.statistics import probabilities_of

        return probabilities_of(self, level=level, method=method)

    def incidence(self, *, level: float | None = None, jointly: bool = False) -> Incidence:
        """When each outcome came, as cumulative curves with bands: see `tadcore.statistics.incidence`.

        Parameters
        ----------
        level : float, optional
            Confidence level of each band over all instants; 0.95, or that of the rule that was asked when to stop.
        jointly : bool, optional
            Whether the bands hold for all curves at once.
        """
        from tadcore.statistics import incidence_of

        return incidence_of(self, level=level, jointly=jointly)

    def compare(self, other: TrialOutcomes, *, level: float | None = None) -> Comparison:
        """Set this study beside another on the same draws, trial by trial: see `tadcore.statistics.compare`.

        Parameters
        ----------
        other : StudyResult
            A study of the same seed and trials over a game that differs.
        level : float, optional
            Confidence level of each interval; 0.95, or that of the rule that was asked when to stop.
        """
        from tadcore.statistics import compare

        return compare(self, other, level=level)

    def to_pandas(self) -> pandas.DataFrame:
        """The table as a pandas data frame; ``outcome`` is a categorical."""
        return self.table.to_pandas()

    def to_polars(self) -> polars.DataFrame:
        """The table as a Polars data frame, ``outcome`` as a categorical; Polars must be installed."""
        import polars

        frame = polars.from_arrow(self.table)
        assert isinstance(frame, polars.DataFrame)  # a table never becomes a series
        return frame

    def _column(self, name: str) -> NDArray[Any]:
        return self.rows.column(name)

    def __len__(self) -> int:
        return self.trials
