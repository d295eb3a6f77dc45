"""What a verification found: checks, measurements, and whether all of it can be relied on.

Two words are kept apart. *Converged* speaks of the numerics: the quantity was computed to the accuracy that the check
needs. *Accepted* speaks of the claim: the quantity lies within the bound. A check that has not converged decides
nothing, whichever way it came out.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, field
from typing import Any

from tadcore.errors import UNDECIDED, VerificationError


@dataclass(frozen=True, slots=True)
class Check:
    """One claim with the number that decides it.

    Attributes
    ----------
    name : str
        What is checked, such as ``"fne.regret.target"``.
    value : float
        What was measured; inf or nan where it could not be.
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

    @property
    def accepted(self) -> bool:
        """Whether the value lies within the bound; never for nan."""
        return self.value <= self.bound

    @property
    def ok(self) -> bool:
        """Converged and accepted."""
        return self.converged and self.accepted

    def require(self) -> None:
        """Raise `VerificationError` unless converged and accepted."""
        if not self.ok:
            raise VerificationError(self.name, self.value, self.bound, self.remedy, self.converged)


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
        Numbers that decide nothing.
    notes : tuple of str
        What could not be checked on this run, and why.
    """

    title: str
    checks: tuple[Check, ...]
    measurements: tuple[Measurement, ...] = ()
    notes: tuple[str, ...] = field(default=())

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
        """The checks that are not converged or not accepted."""
        return tuple(check for check in self.checks if not check.ok)

    def require_ok(self) -> VerificationReport:
        """Return the report itself, or raise `VerificationError` for the first check that fails."""
        for check in self.checks:
            check.require()
        return self

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, ready for JSON; a number that is not finite becomes its name."""
        return {
            "title": self.title,
            "ok": self.ok,
            "converged": self.converged,
            "accepted": self.accepted,
            "checks": [_plain({**asdict(c), "accepted": c.accepted}) for c in self.checks],
            "measurements": [_plain(asdict(m)) for m in self.measurements],
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
        verdict = "accepted" if self.ok else "NOT ACCEPTED" if self.converged else "NOT CONVERGED"
        names = [c.name for c in self.checks] + [m.name for m in self.measurements]
        width = max(map(len, names), default=0)
        lines = [f"{self.title}: {verdict}, {sum(c.ok for c in self.checks)} of {len(self.checks)} checks pass"]
        for c in self.checks:
            state = "ok" if c.ok else "FAILED" if c.converged else "NOT CONVERGED"
            detail = f"  [{c.detail}]" if c.detail else ""
            lines.append(f"  {c.name:<{width}}  {c.value:9.2e} ≤ {c.bound:8.1e}  {state}  ({c.source}){detail}")
            if not c.ok:
                lines.append(f"  {'':<{width}}  → {c.remedy if c.converged else UNDECIDED}")
        lines += [f"  {m.name:<{width}}  {m.value:9.4g}  {m.meaning}" for m in self.measurements]
        return lines + [f"  note: {note}" for note in self.notes]

    def __repr__(self) -> str:
        return "\n".join(self.lines())


def combine(title: str, parts: Iterable[VerificationReport]) -> VerificationReport:
    """One report of several, in their order."""
    parts = list(parts)
    return VerificationReport(
        title,
        tuple(check for part in parts for check in part.checks),
        tuple(measured for part in parts for measured in part.measurements),
        tuple(note for part in parts for note in part.notes),
    )


def _plain(record: dict[str, Any]) -> dict[str, Any]:
    return {k: str(v) if isinstance(v, float) and not math.isfinite(v) else v for k, v in record.items()}
