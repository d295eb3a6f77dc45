"""P of I1 in decimal numbers: the coupled equations as printed, by Taylor series of high order; slow, and sure."""

from decimal import MAX_EMAX, MIN_EMIN, Context, Decimal, localcontext

import numpy as np

ORDER = 16
TOLERANCE = Decimal(10) ** -16
"""What the last two terms of a step may be, relative to the largest entry of their matrix."""


def coefficients(sc):
    """S, Q and F of defenders, target and attacker, as matrices of decimal numbers."""
    n = sc.n

    def diagonal(values):
        m = np.full((n + 1, n + 1), Decimal(0))
        for i, x in enumerate(values):
            m[i, i] = Decimal(float(x))
        return m

    inverse = [1 / Decimal(d.control_weight) for d in sc.defenders]
    S = [diagonal([0] * (n + 1)), diagonal([0] * (n + 1))]
    for i, x in enumerate(inverse):
        S[0][i, i] = x
    S[1][n, n] = 1 / Decimal(sc.target.control_weight)
    S.append(np.full((n + 1, n + 1), 1 / Decimal(sc.attacker.control_weight)))

    def weights(kind):
        own = [getattr(d, f"{kind}_weight") for d in sc.defenders]
        fled = [-sc.attacker.evasion * getattr(d, f"evasion_{kind}_weight") for d in sc.defenders]
        return [
            diagonal([*own, 0]),
            diagonal([0] * n + [-getattr(sc.target, f"{kind}_weight")]),
            diagonal([*fled, getattr(sc.attacker, f"target_{kind}_weight")]),
        ]

    return S, weights("running"), weights("terminal")


def taylor_P(sc, times):
    """Solve backward from the horizon; P of the three groups at each time before it, increasing."""
    with localcontext(Context(prec=45, Emax=MAX_EMAX, Emin=MIN_EMIN)):
        S, Q, P = coefficients(sc)
        s, found = Decimal(0), []
        times = [Decimal(float(t)) for t in times]
        while len(found) < len(times):
            terms = [[p] for p in P]
            SP = [[S[p] @ P[p]] for p in range(3)]
            A = [SP[0][0] + SP[1][0] + SP[2][0]]
            for m in range(ORDER):
                for p in range(3):
                    slope = Q[p] * (m == 0)
                    for j in range(m + 1):
                        PA = terms[p][j] @ A[m - j]
                        slope = slope - PA - PA.T + terms[p][j] @ SP[p][m - j]
                    terms[p].append(slope / (m + 1))
                for p in range(3):
                    SP[p].append(S[p] @ terms[p][-1])
                A.append(SP[0][-1] + SP[1][-1] + SP[2][-1])
            h = times[-1] - s
            for of in terms:
                size = abs(of[0]).max()
                for m in (ORDER - 1, ORDER):
                    if largest := abs(of[m]).max():
                        h = min(h, (TOLERANCE * size / largest) ** (Decimal(1) / m))

            def at(step, terms=terms):
                return [sum(term * step**m for m, term in enumerate(of)) for of in terms]

            while len(found) < len(times) and times[len(found)] <= s + h:
                found.append([p.astype(float) for p in at(times[len(found)] - s)])
            P, s = at(h), s + h
        return found
