"""Progress with the rate, the time left and running estimates of how the games end.

In a terminal and in a notebook that is a bar; in a log file, a pipe or a batch job a line, once a minute. Rate and time
left are those of the last minute: a study begins slowly, while its gain table is filled.
"""

from __future__ import annotations

import sys
import time
from collections import deque
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.shares import share
from tadcore.game.outcome import DIVERGED, NO_EQUILIBRIUM, OutcomeKind

_FORMAT = "{{desc}}|{{bar}}| {{n_fmt}}/{{total_fmt}} [{left}, {rate}/s, {shown}]"
_MINUTE = 60.0  # seconds over which the rate is measured, and between two lines of a log


class Progress:
    """A bar over trials.

    Parameters
    ----------
    total : int
        Trials of the study.
    wanted : bool or str
        Whether progress was asked for, or what stands before it.
    """

    def __init__(self, total: int, *, wanted: bool | str) -> None:
        self._counts = np.zeros(len(OutcomeKind) + 2, dtype=np.int64)
        self._total, self._done = total, 0
        self._label = f"{wanted}: " if isinstance(wanted, str) else ""
        self._wanted = bool(wanted)
        self._bar: Any = None
        now = time.monotonic()
        self._past = deque([(now, 0)])
        self._told = now
        if wanted and _watched():
            from tqdm.auto import tqdm

            self._bar = tqdm(total=total, desc=self._label or None, unit="", unit_scale=True, dynamic_ncols=True)

    def add(self, counts: NDArray[np.int64], *, stored: bool = False) -> None:
        """Count the outcomes of a chunk, as `Tally.kinds` has them; a store's do not enter the rate."""
        if not self._wanted:
            return
        self._counts += counts
        self._done += int(counts.sum())
        now = time.monotonic()
        if stored:
            self._past = deque([(now, self._done)])
        else:
            self._past.append((now, self._done))
            while len(self._past) > 2 and self._past[1][0] < now - _MINUTE:
                self._past.popleft()
        if self._bar is not None:
            self._bar.bar_format = _FORMAT.format(**self._words())
            self._bar.update(self._done - self._bar.n)
            if stored:
                self._bar.refresh()
        elif now - self._told > _MINUTE and sys.stderr is not None:
            self._told = now
            words = "{left} left, {rate}/s, {shown}".format(**self._words())
            print(f"{self._label}{self._done:,} of {self._total:,} trials, {words}", file=sys.stderr, flush=True)

    def _words(self) -> dict[str, str]:
        """The time left, the rate, and the shares of the outcomes so far."""
        from tqdm.std import tqdm

        (then, before), (now, done) = self._past[0], self._past[-1]
        rate = (done - before) / (now - then) if done > before and now > then else 0.0
        left = tqdm.format_interval((self._total - done) / rate) if rate else "?"
        estimates = self._counts / max(int(self._counts.sum()), 1)
        order = (OutcomeKind.INTERCEPTED, OutcomeKind.CAPTURED, OutcomeKind.TIMEOUT)
        # "P(kind)" without its letters: the line has to fit into 80 columns, rate and all.
        shown = [f"{kind.name.lower()} {share(float(estimates[kind]), 3)}" for kind in order]
        for estimate, name in zip(estimates[len(OutcomeKind) :], (DIVERGED, NO_EQUILIBRIUM), strict=True):
            if estimate:
                shown.append(f"{name} {share(float(estimate), 3)}")
        return {"left": left, "rate": tqdm.format_sizeof(rate) if rate else "?", "shown": " ".join(shown)}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.refresh()
            self._bar.close()


def _watched() -> bool:
    """Whether standard error is a terminal, or this is a notebook."""
    if sys.stderr is not None and sys.stderr.isatty():
        return True
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return shell is not None and "IPKernelApp" in shell.config
