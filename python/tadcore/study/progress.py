"""A progress bar with the rate and running estimates of how the games end; silent where nothing shows it."""

from __future__ import annotations

import sys
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.shares import share
from tadcore.game.outcome import DIVERGED, OutcomeKind

_FORMAT = "{desc}|{bar}| {n_fmt}/{total_fmt} [{remaining}, {rate_fmt}{postfix}]"


class Progress:
    """A bar over trials.

    Parameters
    ----------
    total : int
        Trials of the study.
    wanted : bool or str
        Whether a bar was asked for, or what stands before it; it shows only in a terminal or a notebook.
    """

    def __init__(self, total: int, *, wanted: bool | str) -> None:
        self._counts = np.zeros(len(OutcomeKind) + 1, dtype=np.int64)
        self._bar: Any = None
        if wanted and _watched():
            from tqdm.auto import tqdm

            label = f"{wanted}: " if isinstance(wanted, str) else None
            self._bar = tqdm(total=total, desc=label, unit="", unit_scale=True, dynamic_ncols=True, bar_format=_FORMAT)

    def add(self, counts: NDArray[np.int64], *, stored: bool = False) -> None:
        """Count the outcomes of a chunk, by kind and last those that diverged; a store's do not enter the rate."""
        self._counts += counts
        if self._bar is None:
            return
        rows = int(counts.sum())
        if stored:
            self._bar.initial += rows
            self._bar.n += rows
        estimates = self._counts / max(int(self._counts.sum()), 1)
        order = (OutcomeKind.INTERCEPTED, OutcomeKind.CAPTURED, OutcomeKind.TIMEOUT)
        # "P(kind)" without its letters: the line has to fit into 80 columns, rate and all.
        shown = [f"{kind.name.lower()} {share(float(estimates[kind]), 3)}" for kind in order]
        if estimates[-1]:
            shown.append(f"{DIVERGED} {share(float(estimates[-1]), 3)}")
        self._bar.set_postfix_str(" ".join(shown), refresh=stored)
        if not stored:
            self._bar.update(rows)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.close()


def _watched() -> bool:
    """Whether standard error is a terminal, or this is a notebook."""
    if sys.stderr is not None and sys.stderr.isatty():
        return True
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return shell is not None and "IPKernelApp" in shell.config
