"""Costs of a run from its recorded gains alone, in decimal numbers: exact where a step is stiff, too.

Of a duel mode by mode: on a step z(t) = Σ c_i v_i exp(λ_i t) with the modes of C, so that
∫zᵀMz dt = Σ (c_i v_i)ᵀ M (c_j v_j) φ(λ_i + λ_j) with φ(a) = (exp(aδ) - 1) / a. Of any team by the Gramian of each cost,
W(h) = Σ T_j, T_0 = Mh, T_{j+1} = (CᵀT_j + T_jC) h / (j + 2), W(2h) = W(h) + exp(Ch)ᵀ W(h) exp(Ch).
"""

from decimal import MAX_EMAX, MIN_EMIN, Context, Decimal, getcontext, localcontext

import numpy as np

from oracle.decimals import product


def players(run):
    """(rows of d1…dn, target, attacker) at every instant of a run."""
    import tadcore

    rows = tadcore.solve_equilibrium(run.scenario)
    feedback = np.stack([rows.feedback[p] for p in run.scenario.players], axis=1)[: len(run.times)]
    feedback[:, : run.gains.shape[1]] = run.gains
    return feedback


def objectives(sc):
    """By group: weights of the efforts of d1…dn, target, attacker; of the states, running and terminal."""
    r = [*(d.control_weight for d in sc.defenders), sc.target.control_weight, sc.attacker.control_weight]
    team, n = sc.defenders, sc.n
    first = sc.interaction == "I1"
    evasion = sc.attacker.evasion if first else 1.0

    def attack(kind):
        own = [-evasion * getattr(d, f"evasion_{kind}_weight") for d in team]
        return [*own, getattr(sc.attacker, f"target_{kind}_weight")]

    if not first:
        return {"team": ([*(-x for x in r[:-1]), r[-1]], attack("running"), attack("terminal"))}

    def of(kind):
        mine = [*(getattr(d, f"{kind}_weight") for d in team), 0.0]
        fled = [0.0] * n + [-getattr(sc.target, f"{kind}_weight")]
        return {"defenders": mine, "target": fled, "attacker": attack(kind)}

    efforts = {"defenders": [*r[:n], 0, 0], "target": [0] * n + [r[n], 0], "attacker": [0] * n + [0, r[-1]]}
    return {p: (efforts[p], of("running")[p], of("terminal")[p]) for p in efforts}


def exact_costs(run):
    """J by group of a duel (N = 2) with real modes, to some 80 digits; None where modes are not real and distinct."""
    sc = run.scenario
    with localcontext(Context(prec=120, Emax=MAX_EMAX, Emin=MIN_EMIN)):
        D = Decimal
        delta = D(sc.horizon) / sc.steps
        total = dict.fromkeys(objectives(sc), D(0))
        for k, rows in enumerate(players(run)[:-1]):
            rows = [[D(float(x)) for x in row] for row in rows]
            C = [[rows[i][j] - rows[2][j] for j in range(2)] for i in range(2)]
            half, det = (C[0][0] + C[1][1]) / 2, C[0][0] * C[1][1] - C[0][1] * C[1][0]
            root = half * half - det
            if root <= 0:
                return None
            modes = [half - root.sqrt(), half + root.sqrt()]
            # With the projections Z_i = (C - λ_j) / (λ_i - λ_j), exp(Ct) = Σ exp(λ_i t) Z_i.
            parts = []
            for i in range(2):
                gap = modes[i] - modes[1 - i]
                parts.append([[(C[a][b] - (modes[1 - i] if a == b else 0)) / gap for b in range(2)] for a in range(2)])
            for axis in range(sc.dim):
                z = [D(float(run.position[k, p, axis])) - D(float(run.position[k, 2, axis])) for p in range(2)]
                pieces = [[sum(row[b] * z[b] for b in range(2)) for row in part] for part in parts]
                for name, (effort, q, _) in objectives(sc).items():
                    for i in range(2):
                        for j in range(2):
                            rate = modes[i] + modes[j]
                            phi = ((rate * delta).exp() - 1) / rate if rate else delta
                            u = [[sum(row[b] * pieces[e][b] for b in range(2)) for row in rows] for e in (i, j)]
                            value = sum(D(float(r)) * a * b for r, a, b in zip(effort, *u, strict=True))
                            value += sum(D(float(w)) * pieces[i][p] * pieces[j][p] for p, w in enumerate(q))
                            total[name] += value * phi / 2
        for name, (_, _, f) in objectives(sc).items():
            end = [[D(float(x)) for x in row] for row in run.position[-1]]
            for p, w in enumerate(f):
                total[name] += D(float(w)) * sum((x - y) ** 2 for x, y in zip(end[p], end[2], strict=True)) / 2
        return {name: float(value) for name, value in total.items()}


def decimal_costs(run, digits=120):
    """J by group for any number of defenders; by group, what adds up in doubles.

    That is the sum of the parts of all steps with ‖C‖δ at most a half, each by its size; whole costs where no step is
    larger, since the terminal part then adds up in doubles, too.
    """
    sc = run.scenario
    costs = objectives(sc)
    with localcontext(Context(prec=digits, Emax=MAX_EMAX, Emin=MIN_EMIN)):
        total, added = dict.fromkeys(costs, Decimal(0)), dict.fromkeys(costs, Decimal(0))
        stiff = False
        for k, rows in enumerate(players(run)[:-1]):
            step = Decimal(sc.horizon) / sc.steps
            if run.times[k + 1] < sc.horizon * (k + 1) / sc.steps * (1 - 1e-12):  # it ends at a crossing
                step = Decimal(float(run.times[k + 1])) - Decimal(float(run.times[k]))
            size = np.abs(rows[:-1] - rows[-1]).sum(axis=1).max() * float(step)
            rows = [[Decimal(float(x)) for x in row] for row in rows]
            C = [[x - a for x, a in zip(row, rows[-1], strict=True)] for row in rows[:-1]]
            forms = [(total[name], effort, q) for name, (effort, q, _) in costs.items()]
            if size <= 0.5:
                forms += [(added[name], np.abs(effort), np.abs(q)) for name, (effort, q, _) in costs.items()]
            stiff = stiff or size > 0.5
            values = running(C, rows, forms, relative(run, k), step)
            total = dict(zip(costs, values, strict=False))
            if size <= 0.5:
                added = dict(zip(costs, values[len(costs) :], strict=True))
        z = relative(run, len(run.times) - 1)
        for name, (_, _, f) in costs.items():
            parts = [Decimal(float(w)) * sum(x * x for x in row) / 2 for w, row in zip(f, z, strict=True)]
            total[name] += sum(parts)
            if not stiff:
                added[name] += sum(map(abs, parts))
        return {p: float(x) for p, x in total.items()}, {p: float(x) for p, x in added.items()}


def relative(run, k):
    """z of row k of a run, by player and axis."""
    *team, attacker = [[Decimal(float(x)) for x in row] for row in run.position[k]]
    return [[x - a for x, a in zip(row, attacker, strict=True)] for row in team]


def running(C, rows, forms, z, step):
    """Each of the forms (sum so far, weights of efforts, weights of states) with its integral over a step added."""
    N = len(C)
    size = max(sum(map(abs, line)) for line in [*C, *zip(*C, strict=True)]) * step
    doublings = 0
    while size * 2**8 > 1:
        size, doublings = size / 2, doublings + 1
    h = step / 2**doublings
    W = []
    for _, effort, q in forms:
        M = [
            [sum(Decimal(float(r)) * u[i] * u[j] for r, u in zip(effort, rows, strict=True)) for j in range(N)]
            for i in range(N)
        ]
        for i, weight in enumerate(q):
            M[i][i] += Decimal(float(weight))
        W.append(series([[x * h for x in row] for row in M], lambda T, j: lyapunov(T, C, h / (j + 1))))
    E = series([[Decimal(i == j) for j in range(N)] for i in range(N)], lambda T, j: scaled(product(T, C), h / j))
    for _ in range(doublings):
        turned = list(zip(*E, strict=True))
        W = [plus(form, product(turned, product(form, E))) for form in W]
        E = product(E, E)
    return [
        so_far + sum(x * y for a, b in zip(z, product(form, z), strict=True) for x, y in zip(a, b, strict=True)) / 2
        for (so_far, _, _), form in zip(forms, W, strict=True)
    ]


def series(term, following):
    """The sum of a term and those that follow, to the digits in use."""
    total, j, most = term, 0, largest(term)
    while largest(term) > most * Decimal(10) ** -getcontext().prec:
        j += 1
        term = following(term, j)
        total = plus(total, term)
    return total


def largest(a):
    return max(abs(x) for row in a for x in row)


def plus(a, b):
    return [[x + y for x, y in zip(*rows, strict=True)] for rows in zip(a, b, strict=True)]


def scaled(a, factor):
    return [[x * factor for x in row] for row in a]


def lyapunov(T, C, factor):
    half = product(T, C)
    return scaled(plus(half, list(zip(*half, strict=True))), factor)
