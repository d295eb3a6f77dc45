"""A store, read back: the study that it holds, its trials, and whether all of them are as they were written."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

from tadcore._shared.progress import bar
from tadcore._shared.threads import cores, in_order
from tadcore.errors import StoreError
from tadcore.sampling.adapters import from_table
from tadcore.scenario.model import Scenario
from tadcore.statistics.stopping import Stopping, from_kept

from .definition import Definition
from .keepers import checks_of, rows_there
from .manifest import MANIFEST, Manifest
from .place import Place
from .rows import Rows
from .store import Store
from .where import as_place


def opened(place: Place) -> tuple[Store, dict[str, Any]]:
    """The store of a place, and the arguments of the study that it holds."""
    manifest = Manifest.read(place)
    arguments: dict[str, Any] = {
        "sc": Scenario.from_toml_string(manifest.scenario, name=str(place)),
        "vary": {path: from_table(f'vary["{path}"]', table, stored=True) for path, table in manifest.vary.items()},
        "trials": manifest.trials,
        "seed": manifest.seed,
        "design": manifest.design,
        "termination": manifest.termination,
        "passes": manifest.passes,
        "keep": manifest.keep,
    }
    return Store.reading(place, manifest, Definition(**arguments).plan), arguments


def rows_and_rule(store: Store) -> tuple[Rows, Stopping | None]:
    """The trials that are there, and the rule that was asked when to stop."""
    manifest = store.manifest
    try:
        stopping = from_kept(manifest.rule, held=manifest.stopped is not None, chunk=manifest.chunk)
    except ValueError as error:
        raise StoreError(
            store.place.at(MANIFEST), f"it is no manifest of a study ({error})", "put back a copy of this file"
        ) from None
    return rows_there(store, manifest.trials if manifest.stopped is None else manifest.stopped), stopping


def verify_store(
    folder: str | os.PathLike[str], *, progress: bool = False, storage_options: Mapping[str, Any] | None = None
) -> int:
    """Read everything that a store holds, however large it is.

    Parameters
    ----------
    folder : path or URL
        The store.
    progress : bool
        Show a bar in a terminal or a notebook.
    storage_options : mapping, optional
        Options of fsspec for a store at a URL, as in `tadcore.Study.run`.

    Returns
    -------
    int
        How many trials there are, each of which can be how a game ended.

    Raises
    ------
    StoreError
        A file is truncated, foreign or damaged, or its counts are not those of its rows.
    """
    store = opened(as_place("folder", folder, storage_options))[0]
    checks = checks_of(store)
    counted = in_order(lambda check: check(), checks, max(cores(), store.place.threads))
    return sum(bar(counted, "verifying", total=len(checks), show=progress))
