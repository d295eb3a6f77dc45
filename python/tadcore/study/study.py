"""A study: many games around one scenario, drawn, played in chunks, kept and counted.

The trials of a study are numbered. What trial i plays and how it ends depend on the scenario, on what varies, on the
seed and on i alone: not on the number of threads, the executor, the length of the study, or its interruptions.

Any executor of `concurrent.futures` computes the chunks, here and elsewhere:

.. code-block:: python

    with concurrent.futures.ProcessPoolExecutor() as pool:                   # the cores of this machine
        study.run(executor=pool, store="out")

    with distributed.Client("tcp://scheduler:8786") as client:               # a Dask cluster
        study.run(executor=client.get_executor(), store="out")

    with mpi4py.futures.MPIPoolExecutor() as pool:                           # mpiexec -n 64 python -m mpi4py.futures
        study.run(executor=pool, store="out")

Every worker process has its own table of gains, which it reads from the file that ``table`` names. Workers that reach
the store, a folder that they share or a URL, write their rows there; the process that calls `Study.run` counts, and
writes the rest.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from concurrent.futures import Executor
from functools import cached_property
from typing import Any, overload

import numpy as np

from tadcore._shared.arrays import Floats, as_index
from tadcore._shared.calls import public
from tadcore._shared.files import as_path
from tadcore._shared.html import block, line
from tadcore.errors import OutOfMemoryError
from tadcore.scenario.model import Scenario
from tadcore.scenario.paths import ByPath, short
from tadcore.scenario.quantities import with_values
from tadcore.simulation.play import simulate
from tadcore.simulation.run import Run
from tadcore.statistics.stopping import Stopping

from .collect import StoppingRule
from .definition import Definition
from .keeping import Keep
from .part import StudyPart
from .reading import opened, rows_and_rule
from .rows import MOST_BYTES, Rows
from .running import Options, gathered
from .trials import Trials
from .where import as_place


class Study(Definition):
    """Many games around one scenario.

    Parameters
    ----------
    sc : Scenario, path or name
        The game; what does not vary is as it says.
    vary : mapping of str to sampler
        Paths of positions, radii, weights, the horizon and the step, such as ``"attacker.position"``,
        ``"d1.visibility_radius"``, ``"d*.capture_radius"``, ``"*.position"`` or ``"attacker.control_weight"``, and how
        to draw them: a sampler of `tadcore.sampling`, a frozen distribution of `scipy.stats`, a sequence, or a callable
        ``f(rng, size)``. With a wildcard every player draws for itself. It may be empty where the scenario itself is
        random, by failures or disturbances: then every trial begins at the scenario's start.
    trials : int
        How many games.
    seed : int
        Any whole number in [0, 2⁶⁴); adjacent seeds share nothing.
    design : {"random", "sobol", "latin"}
        Independent draws, a scrambled Sobol' sequence, or Latin hypercubes (one for every chunk of 8,192 trials).

    termination : {"sampled", "continuous"}
        When a game ends: at an instant of the grid, or at the crossing of a capture radius itself; see
        `tadcore.simulate`. A store of one is not taken for a store of the other.
    passes : bool
        Whether to look for games that enter a capture radius between two instants: a column ``passed``, as in
        `tadcore.Batch`. A store with it is not taken for one without.
    keep : {"all", "outcomes", "counts"}
        What `run` keeps of every trial, unless it is told.

    Raises
    ------
    ScenarioError
        A path leads nowhere, a sampler does not fit, there are no trials.

    Notes
    -----
    Positions and radii are no part of a game, so where these alone vary all trials share one equilibrium and one table
    of gains. Where a weight, λ, γ, the horizon or the step varies every trial is a game of its own: its Riccati
    equations are solved and its gains synthesised as it meets networks, some 10⁴ times the work. A game without an
    equilibrium is the outcome ``"no_equilibrium"``. Outcomes are counted at the steps of the scenario's own grid, each
    at the first at or after its end, and what ends later at the last. `games` says which way a study takes.

    Failures and disturbances of trial i are drawn from (seed, i) alone, apart from the inputs: two studies with one
    seed that differ in a radius, a weight or a mean time have them in common.

    The draws of the random design come from ``numpy.random.Philox``, keyed by (seed, chunk) and with the varied
    quantity in the counter; with one seed, two studies that vary the same position draw the same positions, whatever
    else they vary. A callable must be a function of its arguments alone. A store knows it by its qualified name and
    digests of its source and of a few of its draws. Disks, annuli and quantiles round as the mathematical library of
    the machine does: on another kind of machine the last bit of a draw may differ.

    Examples
    --------
    >>> import tadcore
    >>> from tadcore.sampling import Disk
    >>> sc = tadcore.scenarios.load("paper-i1")
    >>> result = tadcore.Study(sc, {"attacker.position": Disk([-2, 2], 0.5)}, trials=50, seed=7).run()
    >>> result.trials, sum(result.counts().values())
    (50, 50)
    >>> result.replay(3).outcome.time == result.time[3]
    np.True_
    """

    def replace(self, **changes: Any) -> Study:
        """Another study with some of the arguments changed; ``scenario``, as the attribute is called, is ``sc``."""
        if "scenario" in changes and "sc" not in changes:
            changes["sc"] = changes.pop("scenario")
        given: dict[str, Any] = {"vary": dict(self.vary), "trials": self.trials, "seed": self.seed}
        given |= {"design": self.design, "termination": self.termination, "passes": self.passes}
        given["keep"] = self.keep
        return Study(**{"sc": self.scenario, **given, **changes})

    @classmethod
    def from_toml(cls, path: str | os.PathLike[str]) -> Study:
        """Read a study file; raises `ScenarioError` for a file, a key or a value that cannot be accepted."""
        from .toml import read_study

        return cls(**read_study(path))

    @classmethod
    def from_toml_string(cls, text: str, *, name: str = "study", folder: str | os.PathLike[str] = ".") -> Study:
        """Read a study from a TOML text.

        Errors of syntax are reported under ``name``; the file of a scenario is looked for in ``folder``.
        """
        from .toml import parse_study

        return cls(**parse_study(text, name, as_path("folder", folder)))

    @overload
    def run(
        self,
        *,
        progress: bool | str = False,
        store: str | os.PathLike[str] | None = None,
        threads: int | None = None,
        executor: Executor | None = None,
        until: StoppingRule | None = None,
        table: str | os.PathLike[str] | None = None,
        keep: Keep | None = None,
        part: None = None,
        storage_options: Mapping[str, Any] | None = None,
    ) -> StudyResult: ...
    @overload
    def run(
        self,
        *,
        progress: bool | str = False,
        store: str | os.PathLike[str],
        threads: int | None = None,
        executor: Executor | None = None,
        table: str | os.PathLike[str] | None = None,
        keep: Keep | None = None,
        part: tuple[int, int],
        storage_options: Mapping[str, Any] | None = None,
    ) -> StudyPart: ...
    @public
    def run(
        self,
        *,
        progress: bool | str = False,
        store: str | os.PathLike[str] | None = None,
        threads: int | None = None,
        executor: Executor | None = None,
        until: StoppingRule | None = None,
        table: str | os.PathLike[str] | None = None,
        keep: Keep | None = None,
        part: tuple[int, int] | None = None,
        storage_options: Mapping[str, Any] | None = None,
    ) -> StudyResult | StudyPart:
        """Play the trials.

        Parameters
        ----------
        progress : bool or str
            Show a bar with the rate and running estimates, in a terminal or a notebook; a string stands before it.
        store : path or URL, optional
            A folder that keeps what is finished, or a place such as ``"s3://bucket/prefix"`` (see
            :doc:`/howto/cluster`). If it holds this study already, the run resumes from there; a larger ``trials``
            extends it.
        threads : int, optional
            Threads that play; all cores by default, or 1 in each worker of an executor.
        executor : concurrent.futures.Executor, optional
            Who computes the chunks: a process pool, Dask's ``client.get_executor()``, ``MPIPoolExecutor``. By default
            threads of this process do. Workers that reach the store write their rows themselves; others send them.
        until : StoppingRule, optional
            Stop after the first chunk, in their order, at which its ``satisfied(counts, trials)`` holds. Statistics of
            the result then use confidence sequences, which hold whatever the rule looked at.
        table : path, optional
            A file that keeps the game's table of transitions from study to study: read before, written after. With it
            a study of the same game reuses the saved gain table; the outcomes are the same. Workers of an
            executor read it, where they reach it, and do not write it. A file that is no such table is refused.
        keep : {"all", "outcomes", "counts"}, optional
            What is kept of every trial: its outcome and what was drawn; its outcome, what was drawn being drawn again
            when it is asked for; or nothing, only how many ended in each way at each step, from which probabilities,
            incidence and stopping rules follow as exactly. By default the study's own `keep`.
        part : tuple of int, optional
            (i, n): play part i, from 1, of n, each as many trials, into a folder of its own in ``store``. So n jobs, on
            any machines that share the folder, play a study; `tadcore.study.merge_store` makes one store of them.
        storage_options : mapping, optional
            Options of fsspec for a store at a URL, as pandas takes them. Without them Arrow's own file systems serve
            S3, Google Cloud Storage and Azure, with the credentials of the environment.

        Returns
        -------
        StudyResult, or StudyPart where a part was asked for
            Bitwise reproducible for any number of threads, any executor and any interruptions.

        Raises
        ------
        ScenarioError
            A draw is no game: the path, the trial and the value are named. Every trial is checked before anything runs,
            at about a million in 0.1 s, unless the samplers' supports prove them right.
        NoEquilibriumError
            The game has no equilibrium on [0, T].
        StoreError
            The store is another study's, in use, damaged, or cannot be written.
        WorkerError
            A worker of the executor died; what was finished is in the store.
        KeyboardInterrupt
            Ctrl-C; what was finished is in the store.
        """
        found = gathered(self, Options(progress, store, threads, executor, until, table, keep, part, storage_options))
        return found if isinstance(found, StudyPart) else StudyResult(self, *found)


class StudyResult(Trials):
    """The outcomes of a study, trial by trial; made by `Study.run` and `load_study`.

    Attributes
    ----------
    study : Study
        What was asked for.
    table : pyarrow.Table
        One row for each trial: ``trial``, ``outcome`` (categorical: ``"timeout"``, ``"captured"``, ``"d1"``, …, or
        ``"diverged"``), ``kind`` (codes of `OutcomeKind`), ``defender`` (0-based, -1 where none intercepted), ``time``,
        ``diverged`` (whether the game diverged, see `tadcore.game.Divergence`), ``passed`` where the study looks for
        passes, and, where the study keeps all, a column for each varied component, such as ``attacker.position.x``. The
        metadata of the schema explains each.
    tally : Tally
        How many trials ended in each way at each step, whatever is kept.
    scenario : Scenario
        The scenario around which the inputs vary.
    seed : int
        The seed of the study.
    stopping : Stopping or None
        The rule that was asked when to stop, whether it held or not; None where the number of trials was fixed.
    """

    def __init__(self, study: Study, rows: Rows, stopping: Stopping | None = None) -> None:
        super().__init__(study.scenario, study.seed, rows, stopping, study.termination)
        object.__setattr__(self, "study", study)

    study: Study

    @cached_property
    def inputs(self) -> dict[str, Floats]:
        """What was drawn: an array of shape (trials,) for each varied component, by the name of its column.

        Any spelling of a path finds it: ``inputs["d1.visibility_radius"]``. What the study did not keep is drawn again,
        bitwise as it was.

        Raises
        ------
        ScenarioError
            It was not kept, and a sampler is known by its name only.
        OutOfMemoryError
            It takes more than 4 GiB.
        """
        if self._has_inputs:
            return super().inputs
        size = 8 * self.trials * len(self.study.columns)
        if size > MOST_BYTES:
            raise OutOfMemoryError(f"the inputs of {self.trials:,} trials", size, MOST_BYTES)
        return ByPath(self.study.inputs(self.trials))

    @property
    def _has_inputs(self) -> bool:
        return set(self.study.columns) <= set(self.rows.names)

    def head(self, trials: int) -> StudyResult:
        """The first trials as a result of their own.

        Parameters
        ----------
        trials : int
            How many; all where there are fewer.

        Raises
        ------
        ScenarioError
            Only counts are kept.
        """
        return StudyResult(self.study, self.rows.head(as_index("trials", trials, 2**32, least=1)), self.stopping)

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
        if self._has_inputs:
            kept = self.rows.at(row)
            drawn = np.array([[kept[name][0].as_py() for name in self.study.columns]])
        else:
            drawn = self.study.draw(row)
        return with_values(self.scenario, self.study.quantities, drawn)

    def replay(self, trial: int) -> Run:
        """One trial again, everything recorded; its outcome is bitwise the one in the table.

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
        return simulate(self.setup(row), termination=self.termination, seed=self.seed, trial=row)

    @classmethod
    def load(cls, folder: str | os.PathLike[str], *, storage_options: Mapping[str, Any] | None = None) -> StudyResult:
        """`load_study`."""
        return load_study(folder, storage_options=storage_options)

    def __repr__(self) -> str:
        asked = f" of {self.study.trials:,}" if self.trials < self.study.trials else ""
        ends = ", ".join(f"{count:,} {name}" for name, count in self.counts().items())
        by = f"; {self.stopping}" if self.stopping is not None else ""
        return f"StudyResult({self.trials:,}{asked} trials: {ends}{by})"

    def _repr_html_(self) -> str:
        if not self.trials:
            return block(repr(self))
        varied = ", ".join(map(short, self.study.vary))
        return block(
            repr(self.scenario), line(f"varies {varied}; seed {self.seed}"), self.probabilities()._repr_html_()
        )


def load_study(folder: str | os.PathLike[str], *, storage_options: Mapping[str, Any] | None = None) -> StudyResult:
    """Read a study back from its store alone.

    Up to four million trials are read, and verified; of a longer study a part is read, and verified, when its rows are
    asked for, and its counts come from the ends of its files. Of a study that was cut off, the trials before the first
    missing chunk are returned: chunks that happened to be finished beyond it are left for `Study.run` to build on. The
    study of the result can be run again to go on, unless it varies by a callable or another object that a store knows
    by its name only.

    Parameters
    ----------
    folder : path or URL
        The store.
    storage_options : mapping, optional
        Options of fsspec for a store at a URL, as in `Study.run`.

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
    store, arguments = opened(as_place("folder", folder, storage_options))
    return StudyResult(Study(**arguments), *rows_and_rule(store))
