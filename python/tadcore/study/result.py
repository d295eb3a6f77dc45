"""What a study returns: one table of outcomes and inputs, and the way back from a row to its game."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from tadcore._shared.arrays import as_index
from tadcore._shared.files import as_path
from tadcore.game.outcome import OutcomeKind
from tadcore.simulation.run import Run, simulate

from .vary import indexed, setups

if TYPE_CHECKING:
    import pandas
    import polars

    from tadcore.scenario.model import Scenario
    from tadcore.statistics import Comparison, Incidence, OutcomeProbabilities

    from .study import Study

__all__ = ["StudyResult", "load_study"]


@dataclass(frozen=True, eq=False, repr=False)
class StudyResult:
    """The outcomes of a study, trial by trial; made by `Study.run` and `load_study`.

    Attributes
    ----------
    study : Study
        What was asked for.
    table : pyarrow.Table
        One row for each trial: ``trial``, ``kind`` (codes of `OutcomeKind`), ``defender`` (0-based, -1 where none
        intercepted), ``time``, and a column for each varied component, such as ``attacker.position.x``.
    """

    study: Study
    table: pa.Table

    @property
    def scenario(self) -> Scenario:
        """The scenario around which the inputs vary."""
        return self.study.scenario

    @property
    def trials(self) -> int:
        """Trials in the table: as many as were asked for, or fewer where a rule stopped the study or it was cut off."""
        return int(self.table.num_rows)

    @property
    def seed(self) -> int:
        """The seed of the study."""
        return self.study.seed

    @cached_property
    def kind(self) -> NDArray[np.int8]:
        """Codes of `OutcomeKind`, shape (trials,)."""
        return self._column("kind")

    @cached_property
    def defender(self) -> NDArray[np.int32]:
        """The intercepting defender, 0-based, -1 where none intercepted; shape (trials,)."""
        return self._column("defender")

    @cached_property
    def time(self) -> NDArray[np.float64]:
        """The instant of the end, shape (trials,)."""
        return self._column("time")

    @cached_property
    def inputs(self) -> dict[str, NDArray[np.float64]]:
        """What was drawn: an array of shape (trials,) for each varied component, by the name of its column."""
        return {name: self._column(name) for name in self.study.columns}

    def counts(self) -> dict[str, int]:
        """How many games ended in each way."""
        many = np.bincount(self.kind, minlength=len(OutcomeKind))
        return {kind.name.lower(): int(many[kind]) for kind in OutcomeKind}

    def setup(self, trial: int) -> Scenario:
        """The scenario that one trial played: its positions and radii in place of the common ones.

        Parameters
        ----------
        trial : int
            Number of the trial, from 0.

        Raises
        ------
        ScenarioError
            There is no such trial.
        """
        row = as_index("trial", trial, self.trials - 1)
        drawn = np.array([[self.table[name][row].as_py() for name in self.study.columns]])
        arrays = dict(
            zip(
                ("position", "visibility_radius", "capture_radius"),
                setups(self.scenario, self.study.quantities, drawn),
                strict=True,
            )
        )
        changes: dict[str, Any] = {}
        for quantity in self.study.quantities:
            value = arrays[quantity.field][0, quantity.row]
            changes[indexed(quantity.owner)] = value.tolist() if value.ndim else float(value)
        return self.scenario.replace(changes)

    def replay(self, trial: int) -> Run:
        """One trial again, everything recorded; its outcome is the one in the table, to the bit.

        Parameters
        ----------
        trial : int
            Number of the trial, from 0.

        Raises
        ------
        ScenarioError
            There is no such trial.
        """
        return simulate(self.setup(trial))

    def probabilities(
        self, *, level: float = 0.95, method: Literal["wilson", "exact"] = "wilson"
    ) -> OutcomeProbabilities:
        """How often each outcome came, with intervals: see `tadcore.statistics.probabilities`.

        Parameters
        ----------
        level : float, optional
            Confidence level of each interval.
        method : {"wilson", "exact"}, optional
            Wilson's score interval or Clopper and Pearson's exact one.
        """
        from tadcore.statistics import probabilities

        return probabilities(self.kind, self.defender, self.scenario.n, level=level, method=method)

    def incidence(self, *, level: float = 0.95, jointly: bool = False) -> Incidence:
        """When each outcome came, as cumulative curves with bands: see `tadcore.statistics.incidence`.

        Parameters
        ----------
        level : float, optional
            Confidence level of each band over all instants.
        jointly : bool, optional
            Whether the bands hold for all curves at once.
        """
        from tadcore.statistics import incidence

        sc = self.scenario
        return incidence(
            self.kind,
            self.defender,
            self.time,
            horizon=sc.horizon,
            step=sc.step,
            n=sc.n,
            level=level,
            jointly=jointly,
        )

    def compare(self, other: StudyResult, *, level: float = 0.95) -> Comparison:
        """Set this study beside another on the same draws, trial by trial: see `tadcore.statistics.compare`.

        Parameters
        ----------
        other : StudyResult
            A study of the same seed and trials over a game that differs.
        level : float, optional
            Confidence level of each interval.
        """
        from tadcore.statistics import compare

        return compare(self, other, level=level)

    def to_pandas(self) -> pandas.DataFrame:
        """The table as a pandas data frame."""
        return self.table.to_pandas()

    def to_polars(self) -> polars.DataFrame:
        """The table as a Polars data frame; Polars must be installed."""
        import polars

        frame = polars.from_arrow(self.table)
        assert isinstance(frame, polars.DataFrame)  # a table never becomes a series
        return frame

    @classmethod
    def load(cls, folder: str | os.PathLike[str]) -> StudyResult:
        """`load_study`."""
        return load_study(folder)

    def _column(self, name: str) -> NDArray[Any]:
        array: NDArray[Any] = self.table[name].combine_chunks().to_numpy()
        return array

    def __len__(self) -> int:
        return self.trials

    def __repr__(self) -> str:
        asked = f" of {self.study.trials:,}" if self.trials < self.study.trials else ""
        ends = ", ".join(f"{count:,} {name}" for name, count in self.counts().items())
        return f"StudyResult({self.trials:,}{asked} trials: {ends})"


def load_study(folder: str | os.PathLike[str]) -> StudyResult:
    """Read a study back from its store alone.

    Every part is verified. Of a study that was cut off, the trials before the first missing chunk are returned: chunks
    that happened to be finished beyond it are left for `Study.run` to build on. The study of the result can be run
    again to go on, unless it varies by a callable or another object that a store knows by its name only.

    Parameters
    ----------
    folder : path
        The store.

    Returns
    -------
    StudyResult
        The outcomes that are there.

    Raises
    ------
    ScenarioError
        What was given is no path.
    StoreError
        The folder is no store, or one of its files is truncated, foreign or damaged.
    """
    from tadcore.sampling.adapters import from_table
    from tadcore.scenario.model import Scenario

    from .manifest import Manifest
    from .store import Store
    from .study import Study
    from .table import schema_of

    manifest = Manifest.read(as_path("folder", folder))
    vary = {path: from_table(f'vary["{path}"]', table, stored=True) for path, table in manifest.vary.items()}
    study = Study(
        Scenario.from_toml_string(manifest.scenario, name=os.fspath(folder)),
        vary,
        trials=manifest.trials,
        seed=manifest.seed,
        design=manifest.design,  # type: ignore[arg-type]  # the constructor checks it
    )
    schema = schema_of(manifest.columns)
    store = Store.reading(folder, schema)
    wanted = manifest.trials if manifest.stopped is None else manifest.stopped
    tables = [schema.empty_table()]
    chunk = 0
    while wanted > 0 and chunk in store.rows:
        tables.append(store.read(chunk).slice(0, wanted))
        wanted -= len(tables[-1])
        if len(tables[-1]) < manifest.chunk:
            break
        chunk += 1
    return StudyResult(study, pa.concat_tables(tables).combine_chunks())
