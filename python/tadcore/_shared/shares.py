"""Shares and probabilities as text: as many digits as the interval supports, and nothing uncertain printed as certain.

A number strictly between 0 and 1 never prints as 0 or as 1: 3 of 1,000,000 is no ``0.0000``, and 999,997 of them are
no ``1.0000``.
"""

from __future__ import annotations

import math

_MOST = 17  # decimals: 1 - 2⁻⁵³ has sixteen nines


def decimals(low: float, high: float, least: int = 4) -> int:
    """How many decimals show the width of an interval to two digits, and at least ``least``."""
    width = high - low
    if not 0.0 < width < math.inf:
        return least
    return min(max(1 - math.floor(math.log10(width)), least), _MOST)


def share(value: float, places: int = 4, *, sign: bool = False) -> str:
    """A share, or a difference of two, with so many decimals.

    Where these would make 0 of what is not 0, two digits and an exponent; where they would make ±1 of what is nearer to
    0, as many decimals as it takes.
    """
    if math.isnan(value):
        return "–"
    plus = "+" if sign else ""
    text = f"{value:{plus}.{places}f}"
    if value != 0.0 and float(text) == 0.0:
        return f"{value:{plus}.1e}"
    while abs(value) < 1.0 and abs(float(text)) == 1.0:
        places += 1
        text = f"{value:{plus}.{places}f}"
    return text


def estimate(value: float, low: float, high: float, *, least: int = 4, sign: bool = False) -> tuple[str, str]:
    """An estimate and ``[low, high]``, with the digits that the width of the interval supports."""
    places = decimals(low, high, least)
    while True:
        middle, *ends = (share(x, places, sign=sign) for x in (value, low, high))
        alike = any(end == middle and x != value for end, x in zip(ends, (low, high), strict=True))
        if not alike or places >= _MOST:
            return middle, f"[{ends[0]}, {ends[1]}]"
        places += 1


def percent(level: float) -> str:
    """A confidence level in percent, which is never 0 or 100."""
    for digits in range(6, 18):
        text = f"{100.0 * level:.{digits}g}"
        if 0.0 < float(text) < 100.0:
            break
    return f"{text} %"
