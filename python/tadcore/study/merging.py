"""The parts of a study, each run by a job of its own, as one store."""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from tadcore.errors import StoreError

from .counted import Counted, content_of, ranges_in, read_counts
from .keepers import rows_there
from .manifest import MANIFEST, Manifest
from .reading import opened
from .store import Store
from .where import as_place
from .writing import Writer

_PART = re.compile(r"_part-(\d{5})-of-(\d{5})")


@dataclass(frozen=True)
class Merged:
    """What a merged store holds.

    Attributes
    ----------
    parts : int
        How many parts were merged just now.
    trials : int
        The trials before the first that is missing.
    wanted : int
        The trials of the study.
    """

    parts: int
    trials: int
    wanted: int


def merge_store(folder: str | os.PathLike[str], *, storage_options: Mapping[str, Any] | None = None) -> Merged:
    """Make one store of the parts that jobs with ``part=(i, n)`` have left in a folder.

    Parts that are not there, or not finished, leave trials out; `tadcore.Study.run` with the same store plays these,
    and parts that come later can be merged later. Rows are moved, not copied; at a URL a move is a copy by the service.

    Parameters
    ----------
    folder : path or URL
        The store that all parts were given.
    storage_options : mapping, optional
        Options of fsspec for a store at a URL, as in `tadcore.Study.run`.

    Returns
    -------
    Merged
        How many trials are there.

    Raises
    ------
    StoreError
        There are no parts, one is of another study or still being written, or a file is damaged.
    """
    place = as_place("folder", folder, storage_options)
    names = [name for name in place.names() if _PART.fullmatch(name)]
    found = [place.inside(name) for name in names]
    if not found:
        raise StoreError(str(place), "it holds no parts of a study", "run them with part=(i, n) and this store")
    manifests = [Manifest.read(part) for part in found]
    first = manifests[0]
    for manifest, part in zip(manifests, found, strict=True):
        manifest.same(first, part)
        if manifest.trials != first.trials:
            asked = f"it is of a study of {manifest.trials:,} trials, and {names[0]} of one of {first.trials:,}"
            raise StoreError(str(part), asked, "run all parts with as many trials")
    plan = opened(found[0])[0].plan
    with contextlib.ExitStack() as until_the_end:
        until_the_end.enter_context(Store.writing(place, first, plan))
        for part in found:
            until_the_end.enter_context(part.alone())
        for part in found:
            for name in part.names():
                if name.endswith(".parquet") and not name.startswith(("_", ".")):
                    place.take(name, part)
    for part in found:
        part.remove(MANIFEST)
        part.discard()
    with Store.writing(place, first, plan) as store:
        if store.keep == "counts":
            _add_up(store)
        else:
            Writer(store, ()).close()
        return Merged(len(found), rows_there(store, first.trials).trials, first.trials)


def _add_up(store: Store) -> None:
    """One file of counts for the files that follow one another."""
    counted: Counted | None = None
    merged: list[str] = []
    for first, end, name in ranges_in(store.place):
        if counted is not None and end <= counted.end:
            merged.append(name)  # among those that are counted already
        elif first == (0 if counted is None else counted.end):
            more = read_counts(store.place, first, end, store.plan, store.manifest.study)
            counted = more if counted is None else Counted(0, end, counted.tally + more.tally)
            merged.append(name)
    if counted is None or len(merged) == 1:
        return
    store.place.write(counted.name, content_of(counted, store.plan, store.manifest.study))
    for name in merged:
        if name != counted.name:
            store.place.remove(name)
