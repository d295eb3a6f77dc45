"""Escape times of I1 by Taylor series in extended precision (needs gmpy2; only the table escapes.json is made by it).

Near an escape the three solutions grow at rates of their own, which depend on the weights, and double precision
leaves the true solution well before the growth is asymptotic: a bound on ‖P‖ with an extrapolation is then wrong in
the fourth digit, and a close pass, after which P comes back, looks like an escape. Here ‖P‖ is followed to 1e22.
"""

GROUPS = ("d", "tau", "a")
TERMS, SHARE, BITS, LARGE = 22, "0.12", 240, 1e22


def taylor_escape(game, longest):
    """Return (backward time at which ‖P‖ passes 1e22, None) or (None, reduced P of the groups at T - longest)."""
    import gmpy2

    gmpy2.get_context().precision = BITS

    def exact(X):
        import numpy as np

        return np.array([[gmpy2.mpfr(float(v)) for v in row] for row in X], dtype=object)

    _, _, S, Q, P = ({p: exact(X) for p, X in part.items() if p in GROUPS} for part in game.matrices(1))
    s, end = gmpy2.mpfr(0), gmpy2.mpfr(longest)
    while s < end:
        series = coefficients(P, S, Q)

        def size(k, series=series):
            return gmpy2.sqrt(sum((series[p][k] ** 2).sum() for p in GROUPS))

        norm = size(0)
        if norm > LARGE:
            return float(s), None
        radius = min((norm / size(k)) ** (gmpy2.mpfr(1) / k) for k in (TERMS, TERMS - 1))
        h = min(radius * gmpy2.mpfr(SHARE), end - s)
        P = {p: sum(series[p][k] * h**k for k in range(TERMS + 1)) for p in GROUPS}
        s += h
    return None, [P[p].astype(float) for p in GROUPS]


def coefficients(P, S, Q):
    """Taylor coefficients in s = T - t of dP_p/ds = Q_p + P_p S_p P_p - P_p A - A'P_p, A = Σ S_q P_q."""
    series = {p: [P[p]] for p in GROUPS}
    weighted = {p: [S[p].dot(P[p])] for p in GROUPS}
    for k in range(TERMS):
        A = [sum(weighted[p][j] for p in GROUPS) for j in range(k + 1)]
        for p in GROUPS:
            new = Q[p] if k == 0 else 0 * Q[p]
            for j in range(k + 1):
                X = series[p][j].dot(A[k - j])
                new = new + series[p][j].dot(weighted[p][k - j]) - X - X.T
            series[p].append(new / (k + 1))
        for p in GROUPS:
            weighted[p].append(S[p].dot(series[p][-1]))
    return series
