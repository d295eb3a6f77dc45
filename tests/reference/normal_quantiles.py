"""Quantiles of the normal law to 25 digits, by mpmath: what the core's inversion is compared with.

    pip install mpmath && python tests/reference/normal_quantiles.py

The probabilities are doubles, of the form (2w + 1) / 2^53, in both tails and around the bounds of the fractions.
"""

import json
from pathlib import Path

from mpmath import erfinv, mp, mpf, sqrt

mp.dps = 60


def quantile(u):
    """Φ⁻¹(u) of a double, which is exact."""
    return sqrt(mpf(2)) * erfinv(2 * mpf(u) - 1)


def main():
    """Writes the table beside this script."""
    smallest = 2.0**-53
    lower = [smallest * (2 * w + 1) for w in (0, 1, 2, 7, 100, 62_500, 62_600, 10**6, 10**9, 10**12)]
    lower += [1e-5, 1e-3, 0.01, 0.05, 0.0749999, 0.0750001, 0.1, 0.2, 0.3, 0.4, 0.45, 0.499, 0.4999999, 0.5 - smallest]
    table = []
    for u in lower:
        u = (2 * round(u / smallest / 2 - 0.5) + 1) * smallest
        for value in (u, 1 - u):
            table.append([repr(value), mp.nstr(quantile(value), 25)])
    path = Path(__file__).with_suffix(".json")
    rows = ",\n".join(json.dumps(row) for row in table)
    path.write_text(f"[\n{rows}\n]\n", encoding="utf-8")


if __name__ == "__main__":
    main()
