"""P(0) of a duel of I2 to 500 decimal digits: the linear Hamiltonian flow by a Taylor series and squaring."""

import math
from decimal import MAX_EMAX, MIN_EMIN, Context, Decimal, localcontext

import numpy as np


def exact_P(sc):
    """P(0) of a duel of I2 (N = 2) by its linear Hamiltonian flow, in decimal numbers."""
    d, a, t = sc.defenders[0], sc.attacker, sc.target
    with localcontext(Context(prec=500, Emax=MAX_EMAX, Emin=MIN_EMIN)):
        S = [[1 / Decimal(d.control_weight), Decimal(0)], [Decimal(0), 1 / Decimal(t.control_weight)]]
        S = [[S[i][j] - 1 / Decimal(a.control_weight) for j in range(2)] for i in range(2)]
        q = [-Decimal(d.evasion_running_weight), Decimal(a.target_running_weight)]
        # Backward in s = T - t: X' = -S Y, Y' = Q X.
        H = [[Decimal(0)] * 4 for _ in range(4)]
        for i in range(2):
            for j in range(2):
                H[i][2 + j] = -S[i][j]
            H[2 + i][i] = q[i]
        largest = max(abs(x) for row in H for x in row) * Decimal(sc.horizon)
        halvings = max(0, math.ceil(math.log2(largest))) + 8
        h = Decimal(sc.horizon) / 2**halvings
        term = total = [[Decimal(i == j) for j in range(4)] for i in range(4)]
        for k in range(1, 150):
            term = [[x * h / k for x in row] for row in product(term, H)]
            total = [[x + y for x, y in zip(a, b, strict=True)] for a, b in zip(total, term, strict=True)]
        for _ in range(halvings):
            total = product(total, total)
        f = [-Decimal(d.evasion_terminal_weight), Decimal(a.target_terminal_weight)]
        end = product(
            total, [[Decimal(1), Decimal(0)], [Decimal(0), Decimal(1)], [f[0], Decimal(0)], [Decimal(0), f[1]]]
        )
        (x00, x01), (x10, x11), *Y = end
        det = x00 * x11 - x01 * x10
        inverse = [[x11 / det, -x01 / det], [-x10 / det, x00 / det]]
        return np.array([[float(x) for x in row] for row in product(Y, inverse)])


def product(a, b):
    return [
        [sum((a[i][k] * b[k][j] for k in range(len(b))), Decimal(0)) for j in range(len(b[0]))] for i in range(len(a))
    ]
