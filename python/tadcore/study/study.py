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

Every worker process builds its own table of gains. The store is written by the process that calls `Study.run`.
"""

from __future__ import annotations

import contextlib
import os
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from tadcore._shared.arrays import as_index
from tadcore._shared.calls import public
from tadcore._shared.files import as_path
from tadcore.errors import ScenarioError, StoreError
from tadcore.game.compiled import game_of
from tadcore.sampling.adapters import from_table
from tadcore.scenario.model import Scenario
from tadcore.scenario.quantities import setups
from tadcore.simulation.run import Run, simulate
from tadcore.statistics.stopping import Stopping, from_kept

from .collect import Collection, StoppingRule
from .definition import Definition
from .manifest import MANIFEST, Manifest
from .progress import Progress
from .store import Store
from .trials import Trials
from .warm_start import warm


class Study(Definition):
    """Many games around one scenario.

    Parameters
    ----------
    sc : Scenario, path or name
        The game; what does not vary is as it says.
    vary : mapping of str to sampler
        Paths of positions, visibility radii and capture radii, such as ``"attacker.position"``,
        ``"d1.visibility_radius"``, ``"d*.capture_radius"`` or ``"*.position"``, and how to draw
        them: a sampler of `tadcore.sampling`, a frozen distribution of `scipy.stats`, a sequence, or a callable
        ``f(rng, size)``. With a wildcard every player draws for itself.
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

    Raises
    ------
    ScenarioError
        A path leads nowhere or to a weight, a sampler does not fit, there are no trials.

    Notes
    -----
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
        """Another study with some of the arguments changed."""
        given: dict[str, Any] = {"vary": dict(self.vary), "trials": self.trials, "seed": self.seed}
        given |= {"design": self.design, "termination": self.termination, "passes": self.passes}
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
    ) -> StudyResult:
        """Play the trials.

        Parameters
        ----------
        progress : bool or str
            Show a bar with the rate and running estimates, in a terminal or a notebook; a string stands before it.
        store : path, optional
            A folder that keeps every finished chunk. If it holds this study already, the run resumes from there; a
            larger ``trials`` extends it.
        threads : int, optional
            Threads for each chunk; all cores by default, or 1 in the workers of an executor.
        executor : concurrent.futures.Executor, optional
            Who computes the chunks: a process pool, Dask's ``client.get_executor()``, ``MPIPoolExecutor``. By default
            this process does, one chunk after another.
        until : StoppingRule, optional
            Stop after the first chunk, in their order, at which its ``satisfied(counts, trials)`` holds. Statistics of
            the result then use confidence sequences, which hold whatever the rule looked at.
        table : path, optional
            A file that keeps the game's table of transitions from study to study: read before, written after. With it
            a study of the same game reuses the saved gain table; the outcomes are the same. Not used by the workers
            of an executor. A file that is no such table is refused.

        Returns
        -------
        StudyResult
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
        workers = None if threads is None else as_index("threads", threads, 2**16, least=1)
        if executor is not None and not isinstance(executor, Executor):
            hint = ": client.get_executor()" if hasattr(executor, "get_executor") else ""
            raise ScenarioError("executor", executor, f"a concurrent.futures.Executor{hint}")
        if until is not None and not isinstance(until, StoppingRule):
            raise ScenarioError("until", until, "a stopping rule such as tadcore.statistics.HalfWidth(0.002)")
        if until is not None and self.design != "random":
            rule = "left out: its interval needs independent draws, which only design='random' gives"
            raise ScenarioError("until", f"a rule for design={self.design!r}", rule)
        folder = None if store is None else as_path("store", store)
        kept_table = None if table is None else as_path("table", table)
        self.check(progress=bool(progress))
        game_of(self.scenario).equilibrium()
        opened = contextlib.nullcontext() if folder is None else Store.writing(folder, self.manifest(), self._plan)
        with warm(self.scenario, kept_table), opened as kept, Progress(self.trials, wanted=progress) as bar:
            chunks = Collection(self._plan, self.trials, kept, bar, until)
            played = chunks.gather(executor, workers)
            return StudyResult(self, played, chunks.stopping)


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
        passes, and a column for each varied component, such as ``attacker.position.x``. The metadata of the schema
        explains each.
    scenario : Scenario
        The scenario around which the inputs vary.
    seed : int
        The seed of the study.
    stopping : Stopping or None
        The rule that was asked when to stop, whether it held or not; None where the number of trials was fixed.
    """

    def __init__(self, study: Study, table: pa.Table, stopping: Stopping | None = None) -> None:
        super().__init__(study.scenario, study.seed, table, stopping, study.termination)
        object.__setattr__(self, "study", study)

    study: Study

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
            changes[quantity.owner] = value.tolist() if value.ndim else float(value)
        return self.scenario.replace(changes)

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
        return simulate(self.setup(trial), termination=self.termination)

    @classmethod
    def load(cls, folder: str | os.PathLike[str]) -> StudyResult:
        """`load_study`."""
        return load_study(folder)

    def __repr__(self) -> str:
        asked = f" of {self.study.trials:,}" if self.trials < self.study.trials else ""
        ends = ", ".join(f"{count:,} {name}" for name, count in self.counts().items())
        by = f"; {self.stopping}" if self.stopping is not None else ""
        return f"StudyResult({self.trials:,}{asked} trials: {ends}{by})"


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
    from tadcore.scenario.model import Scenario

    manifest = Manifest.read(as_path("folder", folder))
    vary = {path: from_table(f'vary["{path}"]', table, stored=True) for path, table in manifest.vary.items()}
    study = Study(
        Scenario.from_toml_string(manifest.scenario, name=os.fspath(folder)),
        vary,
        trials=manifest.trials,
        seed=manifest.seed,
        design=manifest.design,  # type: ignore[arg-type]  # the constructor checks it
        termination=manifest.termination,
        passes=manifest.passes,
    )
    store = Store.reading(folder, manifest, study._plan)
    wanted = manifest.trials if manifest.stopped is None else manifest.stopped
    tables = [store.schema.empty_table()]
    chunk = 0
    while wanted > 0 and chunk in store.rows:
        tables.append(store.read(chunk).slice(0, wanted))
        wanted -= len(tables[-1])
        if len(tables[-1]) < manifest.chunk:
            break
        chunk += 1
    try:
        stopping = from_kept(manifest.rule, held=manifest.stopped is not None, chunk=manifest.chunk)
    except ValueError as error:
        place = str(Path(folder, MANIFEST))
        raise StoreError(place, f"it is no manifest of a study ({error})", "put back a copy of this file") from None
    return StudyResult(study, pa.concat_tables(tables).combine_chunks(), stopping)
