"""What a verification found: checks, measurements, and whether all of it can be relied on.

Two words are kept apart. *Converged* speaks of the numerics: the quantity was computed to the accuracy that the check
needs. *Accepted* speaks of the claim: the quantity lies within the bound. A check that has not converged is undecided,
whichever way it came out; a report fails only by a check that is decided.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, field
from typing import Any, Literal, TypeAlias

from tadcore._shared.html import as_html, line
from tadcore.errors import UNDECIDED, VerificationError

Status: TypeAlias = Literal["passed", "failed", "undecided"]
"""What can be said of a check, and of a report."""

_STATE = {"passed": "ok", "failed": "FAILED", "undecided": "NOT CONVERGED"}
_VERDICT = {"passed": "accepted", "failed": "NOT ACCEPTED", "undecided": "NOT CONVERGED"}
_NOTHING = "—"


def number(value: float, form: str = ".6g") -> str:
    """A number in a sentence; a dash where there is none."""
    return _NOTHING if math.isnan(value) else format(value, form)


@dataclass(frozen=True, slots=True)
class Check:
    """One claim with the number that decides it.

    Attributes
    ----------
    name : str
        What is checked, such as ``"fne.regret.target"``.
    value : float
        What was measured; inf where it has no bound, or could not be measured. Never nan.
    bound : float
        The largest value that is accepted.
    converged : bool
        Whether the measurement is accurate enough to decide.
    remedy : str
        What to do where the check fails.
    source : str
        Labels of the theorem and equations of the paper.
    detail : str
        Where the largest value was found, or how it was measured.
    """

    name: str
    value: float
    bound: float
    converged: bool
    remedy: str
    source: str
    detail: str = ""

    def __post_init__(self) -> None:
        if math.isnan(self.value):  # nan is no measurement: it decides nothing
            object.__setattr__(self, "value", math.inf)
            object.__setattr__(self, "converged", False)

    @property
    def accepted(self) -> bool:
        """Whether the value lies within the bound."""
        return self.value <= self.bound

    @property
    def ok(self) -> bool:
        """Converged and accepted."""
        return self.converged and self.accepted

    @property
    def status(self) -> Status:
        """``"undecided"`` unless converged; then ``"passed"`` or ``"failed"``."""
        return "undecided" if not self.converged else "passed" if self.accepted else "failed"

    @property
    def measured(self) -> bool:
        """Whether there is a value at all."""
        return self.converged or math.isfinite(self.value)

    def require(self) -> None:
        """Raise `VerificationError` unless converged and accepted."""
        if not self.ok:
            raise VerificationError(self.name, self.value, self.bound, self.remedy, self.converged)


@dataclass(frozen=True, slots=True)
class Claim:
    """What a check asserts and what to do where it does not hold; made into a `Check` by a measurement.

    Attributes
    ----------
    name, bound, remedy, source
        As in `Check`.
    """

    name: str
    bound: float
    remedy: str
    source: str

    def judge(self, value: float, detail: str = "", *, doubt: float = 0.0, converged: bool = True) -> Check:
        """The check of a value.

        Parameters
        ----------
        value : float
            What was measured; nan decides nothing.
        detail : str
            Where, or how.
        doubt : float
            How much of the value rounding alone may make up: beyond the bound the check is decided only where less
            than the doubt would still be beyond it.
        converged : bool
            Whether the measurement itself can be relied on.
        """
        decided = converged and (value <= self.bound or value - doubt > self.bound)
        return Check(self.name, float(value), self.bound, bool(decided), self.remedy, self.source, detail)


@dataclass(frozen=True, slots=True)
class Measurement:
    """A number that is reported and decides nothing."""

    name: str
    value: float
    meaning: str


@dataclass(frozen=True)
class VerificationReport:
    """What `tadcore.verify` found.

    Attributes
    ----------
    title : str
        What was verified.
    checks : tuple of Check
        Every claim, in the order in which the paper makes them.
    measurements : tuple of Measurement
        Finite numbers that decide nothing; one that is not finite becomes a note.
    notes : tuple of str
        What could not be checked or measured on this run, and why.
    """

    title: str
    checks: tuple[Check, ...]
    measurements: tuple[Measurement, ...] = ()
    notes: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        lost = [m for m in self.measurements if not math.isfinite(m.value)]
        if lost:
            kept = tuple(m for m in self.measurements if math.isfinite(m.value))
            said = tuple(f"{m.name} could not be measured ({m.meaning})" for m in lost)
            object.__setattr__(self, "measurements", kept)
            object.__setattr__(self, "notes", (*self.notes, *said))

    @property
    def status(self) -> Status:
        """``"failed"`` if a decided check fails, else ``"undecided"`` if one is not converged, else ``"passed"``."""
        return "failed" if self.failures else "undecided" if self.undecided else "passed"

    @property
    def converged(self) -> bool:
        """Whether the numerics behind every check are good enough to decide it."""
        return all(check.converged for check in self.checks)

    @property
    def accepted(self) -> bool:
        """Whether every value lies within its bound."""
        return all(check.accepted for check in self.checks)

    @property
    def ok(self) -> bool:
        """Converged and accepted, throughout."""
        return self.converged and self.accepted

    @property
    def failures(self) -> tuple[Check, ...]:
        """The checks that are decided and not accepted."""
        return tuple(check for check in self.checks if check.status == "failed")

    @property
    def undecided(self) -> tuple[Check, ...]:
        """The checks that are not converged."""
        return tuple(check for check in self.checks if check.status == "undecided")

    def require_ok(self) -> VerificationReport:
        """Return the report itself, or raise `VerificationError` for the first failure, or else what is undecided."""
        for check in (*self.failures, *self.undecided):
            check.require()
        return self

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, ready for JSON: ``"inf"`` where a value has no bound, None where it was not measured."""
        return {
            "title": self.title,
            "status": self.status,
            "ok": self.ok,
            "converged": self.converged,
            "accepted": self.accepted,
            "checks": [_plain(c) for c in self.checks],
            "measurements": [asdict(m) for m in self.measurements],
            "notes": list(self.notes),
        }

    def __getitem__(self, name: str) -> Check:
        for check in self.checks:
            if check.name == name:
                return check
        raise KeyError(name)

    def __iter__(self) -> Iterator[Check]:
        return iter(self.checks)

    def __len__(self) -> int:
        return len(self.checks)

    def lines(self) -> list[str]:
        """The report as text, one check on a line."""
        names = [c.name for c in self.checks] + [m.name for m in self.measurements]
        width = max(map(len, names), default=0)
        counted = [f"{sum(c.ok for c in self.checks)} of {len(self.checks)} checks pass"]
        if not self.ok:
            counted += [f"{len(self.failures)} failed, {len(self.undecided)} undecided"]
        lines = [f"{self.title}: {_VERDICT[self.status]}, {', '.join(counted)}"]
        for c in self.checks:
            detail = f"  [{c.detail}]" if c.detail else ""
            value = format(c.value, "9.2e") if c.measured else f"{_NOTHING:>9}"
            lines.append(f"  {c.name:<{width}}  {value} ≤ {c.bound:8.1e}  {_STATE[c.status]}  ({c.source}){detail}")
            if not c.ok:
                lines.append(f"  {'':<{width}}  → {c.remedy if c.converged else UNDECIDED}")
        lines += [f"  {m.name:<{width}}  {m.value:9.4g}  {m.meaning}" for m in self.measurements]
        return lines + [f"  note: {note}" for note in self.notes]

    def __repr__(self) -> str:
        return "\n".join(self.lines())

    def _repr_html_(self) -> str:
        rows = [
            [
                c.name,
                f"{c.value:.2e}" if c.measured else _NOTHING,
                f"≤ {c.bound:.1e}",
                _STATE[c.status],
                f"{c.source}{'' if c.ok else ' → ' + (c.remedy if c.converged else UNDECIDED)}",
            ]
            for c in self.checks
        ]
        measured = [line(f"{m.name} {m.value:.4g}: {m.meaning}") for m in self.measurements]
        notes = [line(f"note: {note}") for note in self.notes]
        return as_html(self.lines()[0], ["check", "value", "bound", "", "source"], rows, *measured, *notes)


def combine(title: str, parts: Iterable[VerificationReport]) -> VerificationReport:
    """One report of several, in their order."""
    parts = list(parts)
    return VerificationReport(
        title,
        tuple(check for part in parts for check in part.checks),
        tuple(measured for part in parts for measured in part.measurements),
        tuple(note for part in parts for note in part.notes),
    )


def unresolved(check: Check, why: str) -> Check:
    """The same check, undecided for a reason."""
    return dataclasses.replace(check, converged=False, detail="; ".join(filter(None, (check.detail, why))))


def _plain(check: Check) -> dict[str, Any]:
    record = asdict(check) | {"accepted": check.accepted, "status": check.status}
    for name in ("value", "bound"):
        if not math.isfinite(record[name]):
            record[name] = str(record[name]) if check.measured else None
    return record
