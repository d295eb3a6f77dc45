"""What a path that leads nowhere may have meant: a field of the player that it names, never of another one."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable

from .paths import normal, short

_LONGEST = 200  # letters of a path that anything is looked up for
# d1, D1, d01, defender1: counted from 1. defenders.0, defender[0], defenders.-1: counted from 0, or from the end.
_DEFENDER = re.compile(r"(?:d|defenders?)(?:(\d{1,9}|\*)|[._\[](-?\d{1,9}|\*)\]?)(?:[._ ](.*)|$)", re.IGNORECASE)


def hint(path: str, names: Iterable[str]) -> str:
    """``did you mean d1.position?``, or what the player has that the path names; empty where it names nothing known.

    Parameters
    ----------
    path : str
        What was given.
    names : iterable of str
        What it could have been, in normal form.
    """
    if not 0 < len(path) <= _LONGEST:
        return ""
    known = [short(name) for name in names]
    owner, field = _split(short(path).strip(), known)
    if owner is None:
        return _without_owner(field, known)
    fields = list(dict.fromkeys(n.partition(".")[2] for n in known if "." in n and owner in ("*", n.partition(".")[0])))
    if not fields or field in fields:
        return f"did you mean {owner}.{field}?" if fields else ""
    stem, dot, axis = field.rpartition(".")
    axes = [name.rpartition(".")[2] for name in fields if dot and name.startswith(f"{stem}.")]
    if axes and len(axis) <= 1 and len(axes[0]) == 1:
        return f"the coordinates of {owner}.{stem} are {', '.join(axes)}"
    close = difflib.get_close_matches(field, fields, n=1, cutoff=0.7)
    return (
        f"did you mean {owner}.{close[0]}?"
        if close
        else f"{'some player' if owner == '*' else owner} has {', '.join(fields)}"
    )


def _split(path: str, known: list[str]) -> tuple[str | None, str]:
    """The player that a path names, however it is written, and the rest; no player where it names none."""
    owners = list(dict.fromkeys(name.partition(".")[0] for name in known if "." in name))
    team = [owner for owner in owners if owner[0] == "d" and owner[1:].isdecimal()]
    found = _DEFENDER.fullmatch(path)
    if found:
        one, zero, field = found[1], found[2], found[3] or ""
        if "*" in (one, zero):
            return "d*", field
        place = int(one) - 1 if one else int(zero) if int(zero) >= 0 else len(team) + int(zero)
        return f"d{place + 1}", field
    first, dot, field = path.partition(".")
    if first in owners or first == "*":
        return first, field
    tables = [owner for owner in owners if owner not in team and owner != "d*"]
    close = difflib.get_close_matches(first.lower(), tables, n=1, cutoff=0.75)
    return (close[0], field) if close and dot else (None, path)


def _without_owner(field: str, known: list[str]) -> str:
    """For a field alone: those that have it, or the field of the game that is nearest."""
    last = field.rpartition(".")[2]
    holders = [name.partition(".")[0] for name in known if name.partition(".")[2] == last]
    if holders:
        team = all(re.fullmatch(r"d(\d+|\*)", holder) for holder in holders)
        return f"did you mean {'d*' if team else holders[0] if len(holders) == 1 else '*'}.{last}?"
    close = difflib.get_close_matches(field, [name for name in known if "." not in name], n=1, cutoff=0.6)
    return f"did you mean {close[0]}?" if close else ""


def wildcards(names: Iterable[str]) -> list[str]:
    """The names, and for every field of a defender the path of all of them."""
    every = list(names)
    of_defenders = [name.split(".", 2)[2] for name in every if name.startswith("defenders.")]
    return list(dict.fromkeys([*every, *(normal(f"d*.{field}") for field in of_defenders)]))
