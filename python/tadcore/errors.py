"""What can go wrong, and what each error carries.

Every class also derives from the built-in that fits, so that ``except ValueError`` works for bad input and
``except ArithmeticError`` for a game that has no equilibrium. All of them can be pickled, so they come back whole
from a worker process.
"""

from __future__ import annotations

import enum
import math
import reprlib
from collections.abc import Iterable
from decimal import Decimal

__all__ = [
    "MISSING",
    "Missing",
    "NoEquilibriumError",
    "OutOfMemoryError",
    "ScenarioError",
    "StoreError",
    "TadcoreError",
    "VerificationError",
    "WorkerError",
]


class Missing(enum.Enum):
    """The value of a field that was not given at all."""

    MISSING = "nothing"

    def __repr__(self) -> str:
        return "nothing"


MISSING = Missing.MISSING
"""What `ScenarioError.value` is where nothing was given."""


class TadcoreError(Exception):
    """The base of every error of this library."""


class ScenarioError(TadcoreError, ValueError):
    """A number, a name or a file that cannot be accepted.

    Parameters
    ----------
    field : str
        Path of the field, such as ``"defenders[1].visibility_radius"`` or ``"positions[17, 2, 0]"``.
    value : object
        What was found there; `MISSING` where nothing was.
    rule : str
        What it must be; it completes the sentence "must be …".

    Attributes
    ----------
    errors : tuple of ScenarioError
        One error for each offending field; of length one unless several fields are wrong at once.
    """

    def __init__(self, field: str, value: object, rule: str) -> None:
        super().__init__(field, value, rule)
        self.field = field
        self.value = value
        self.rule = rule
        self.errors: tuple[ScenarioError, ...] = (self,)

    @classmethod
    def collect(cls, errors: Iterable[ScenarioError]) -> ScenarioError:
        """One error that lists all of ``errors``; field, value and rule are the first one's."""
        flat = tuple(single for error in errors for single in error.errors)
        if len(flat) == 1:
            return flat[0]
        first = flat[0]
        several = cls(first.field, first.value, first.rule)
        several.errors = flat
        return several

    def __str__(self) -> str:
        if len(self.errors) == 1:
            return f"{_printable(self.field)}: got {shorten(self.value)}, must be {_printable(self.rule)}"
        lines = [f"\n  {error}" for error in self.errors[:_LISTED]]
        more = len(self.errors) - len(lines)
        lines += [f"\n  … and {more:,} more"] if more else []
        return f"{len(self.errors):,} fields cannot be accepted:{''.join(lines)}"

    def __reduce__(self) -> tuple[object, ...]:
        if len(self.errors) == 1:
            return type(self), (self.field, self.value, self.rule)
        return _collect, (type(self), self.errors)


class NoEquilibriumError(TadcoreError, ArithmeticError):
    """The game has no feedback Nash equilibrium on [0, T].

    The Riccati solution, followed backward from the horizon, escapes to infinity before it reaches t = 0. That is a
    property of the game, not a numerical failure.

    Parameters
    ----------
    escape_time : float
        Backward time, measured from the horizon, at which the solution escapes. The Riccati equations do not depend
        on time, so an equilibrium exists for every horizon shorter than this and for none longer.
    horizon : float
        T.
    step : float
        δ.

    Attributes
    ----------
    escape_instant : float
        The same escape in game time, ``horizon - escape_time``.
    longest_horizon : float
        The largest multiple of δ below ``escape_time``: the longest horizon on this grid for which an equilibrium
        exists; 0.0 where not even one step has one.
    """

    def __init__(self, escape_time: float, horizon: float, step: float) -> None:
        super().__init__(escape_time, horizon, step)
        self.escape_time = float(escape_time)
        self.horizon = float(horizon)
        self.step = float(step)

    @property
    def escape_instant(self) -> float:
        """Game time at which the Riccati solution escapes."""
        return self.horizon - self.escape_time

    @property
    def longest_horizon(self) -> float:
        """The longest horizon on this grid for which an equilibrium exists; 0.0 where there is none."""
        whole = max(math.ceil(self.escape_time / self.step) - 1, 0)
        # Multiples are formed in decimal, so that 3 steps of 0.1 read 0.3; and so do 3 steps of 0.3 / 3.
        while whole > 0 and _multiple(self.step, whole) >= self.escape_time:
            whole -= 1
        return _multiple(self.step, whole)

    def __str__(self) -> str:
        advice = (
            f"the longest on the grid of step {self.step:g} is {self.longest_horizon!r}"
            if self.longest_horizon > 0.0
            else f"not even one step of {self.step:g} is short enough"
        )
        return (
            f"the game has no feedback Nash equilibrium on [0, {self.horizon:g}]: the Riccati solution is finite only "
            f"from t = {self.escape_instant:.6g} on, {self.escape_time:.6g} before the horizon. "
            f"An equilibrium exists for horizons shorter than that; {advice}"
        )

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.escape_time, self.horizon, self.step)


class OutOfMemoryError(TadcoreError, MemoryError):
    """Memory that the system would not give, or more than one purpose may take; refused before it is used.

    Parameters
    ----------
    what : str
        What asked for it, such as ``"the record of one run"``.
    size : int
        Bytes asked for.
    limit : int or None
        The limit that they exceed; None where the system refused.
    """

    def __init__(self, what: str, size: int, limit: int | None = None) -> None:
        super().__init__(what, size, limit)
        self.what = what
        self.size = size
        self.limit = limit

    def __str__(self) -> str:
        asked = f"{self.what}: {self.size:,} bytes ({self.size / 2**30:.1f} GiB)"
        if self.limit is None:
            return f"{asked}, which the system would not give; {_SMALLER}"
        return f"{asked}, more than the limit of {self.limit / 2**30:.1f} GiB; {_SMALLER}"

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.what, self.size, self.limit)  # Dask would call MemoryError's own __new__ otherwise


_SMALLER = "fewer defenders, steps or games need less, and so do players that see few others, or all"


class StoreError(TadcoreError, RuntimeError):
    """A store of a study that cannot be used as it is; whatever it holds is left untouched.

    Parameters
    ----------
    path : str
        The folder, or the file in it.
    found : str
        What is the matter.
    remedy : str
        What to do.
    """

    def __init__(self, path: str, found: str, remedy: str) -> None:
        super().__init__(path, found, remedy)
        self.path = path
        self.found = found
        self.remedy = remedy

    def __str__(self) -> str:
        return f"{_printable(self.path)}: {_printable(self.found)}; {self.remedy}"


class WorkerError(TadcoreError, RuntimeError):
    """A worker of an executor died before it returned its chunk.

    Parameters
    ----------
    reason : str
        What the executor says.
    done, chunks : int
        Chunks finished, and chunks asked for.
    store : str or None
        The folder that holds the finished chunks; None where the study runs without one.
    """

    def __init__(self, reason: str, done: int, chunks: int, store: str | None) -> None:
        super().__init__(reason, done, chunks, store)
        self.reason = reason
        self.done = done
        self.chunks = chunks
        self.store = store

    def __str__(self) -> str:
        kept = (
            f"they are kept in {self.store}: run the study again with this store and a fresh executor to go on"
            if self.store is not None
            else "they are lost: with store=… a study keeps them and resumes from there when it is run again"
        )
        return f"a worker died ({self.reason}) when {self.done} of {self.chunks} chunks were finished; {kept}"


UNDECIDED = "the measurement is not accurate enough to decide: a smaller step or a shorter horizon may help"
"""The remedy of a check whose numerics have not converged."""


class VerificationError(TadcoreError, AssertionError):
    """A check of `tadcore.verify` that did not pass.

    Parameters
    ----------
    check : str
        Name of the check, such as ``"fne.regret.target"``.
    value, bound : float
        What was measured, and the most that is accepted.
    remedy : str
        What to do about it.
    converged : bool
        Whether the numbers behind the check can be relied on; False says that the check is undecided.
    """

    def __init__(self, check: str, value: float, bound: float, remedy: str, converged: bool = True) -> None:
        super().__init__(check, value, bound, remedy, converged)
        self.check = check
        self.value = value
        self.bound = bound
        self.remedy = remedy
        self.converged = converged

    def __str__(self) -> str:
        state, advice = ("not accepted", self.remedy) if self.converged else ("not converged", UNDECIDED)
        found = f"measured {self.value:.3g}" if self.converged or math.isfinite(self.value) else "could not be measured"
        return f"{self.check}: {state}, {found} where at most {self.bound:.3g} passes; {advice}"


def _collect(cls: type[ScenarioError], errors: tuple[ScenarioError, ...]) -> ScenarioError:
    return cls.collect(errors)


def _multiple(step: float, count: int) -> float:
    return float(Decimal(f"{step:.15g}") * count)


_reader = reprlib.Repr()
_reader.maxstring = _reader.maxother = 60
_reader.maxlist = _reader.maxtuple = _reader.maxarray = 4
_reader.maxlong = 24


_LISTED = 50  # of several errors at once
_LONGEST = 1000  # characters of a path or a rule, in a message


def _printable(text: str) -> str:
    """A text from an untrusted source: what moves the cursor or turns the writing is escaped."""
    if len(text) > _LONGEST:
        text = f"{text[: _LONGEST // 2]}…{text[-_LONGEST // 2 :]}"
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def shorten(value: object) -> str:
    """A readable form of any value, never long and never raising."""
    tolist = getattr(value, "tolist", None)  # NumPy arrays and scalars read better as Python numbers
    try:
        return _reader.repr(tolist() if callable(tolist) else value)
    except Exception:  # an integer past Python's limit of printed digits, an object whose repr is broken
        long = f"an integer of {value.bit_length() * 0.30103:.0f} digits" if isinstance(value, int) else None
        return long or f"<{type(value).__name__}>"
