"""Costs of a run from its recorded gains alone, mode by mode: exact where a step is stiff, too.

On a step z(t) = Σ c_i v_i exp(λ_i t) with the modes of C, so ∫zᵀMz dt = Σ (c_i v_i)ᵀ M (c_j v_j) φ(λ_i + λ_j) with
φ(a) = (exp(aδ) - 1) / a. For N = 2 modes and sums are decimal numbers; else doubles, as good as the modes are apart.
"""

from decimal import MAX_EMAX, MIN_EMIN, Context, Decimal, localcontext

import numpy as np


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


def modal_costs(run):
    """J by group and, by group, how far rounding may move it; for any number of defenders."""
    sc = run.scenario
    total, doubt = dict.fromkeys(objectives(sc), 0.0), dict.fromkeys(objectives(sc), 0.0)
    for k, rows in enumerate(players(run)[:-1]):
        # a game that ends at a crossing ends within its last step
        delta = min(sc.horizon / sc.steps, run.times[k + 1] - run.times[k])
        C = rows[:-1] - rows[-1]
        modes, V = np.linalg.eig(C)
        z = run.position[k, :-1] - run.position[k, -1]
        pieces = np.linalg.solve(V, z.astype(complex))[:, None, :] * V.T[:, :, None]  # (mode, row, axis)
        rate = modes[:, None] + modes
        with np.errstate(divide="ignore", invalid="ignore"):
            phi = np.where(np.abs(rate) * delta < 1e-12, delta, np.expm1(rate * delta) / rate)
        rounding = 1e-15 * np.linalg.cond(V) * (1.0 + np.abs(C).sum(axis=1).max() * delta)
        for name, (effort, q, _) in objectives(sc).items():
            M = rows.T @ np.diag(effort) @ rows + np.diag(q)
            cross = np.einsum("iax,ab,jbx->ij", pieces, M, pieces)
            total[name] += 0.5 * float((cross * phi).sum().real)
            doubt[name] += rounding * float(np.abs(cross * phi).sum())
    z = run.position[-1, :-1] - run.position[-1, -1]
    for name, (_, _, f) in objectives(sc).items():
        total[name] += 0.5 * float(np.asarray(f) @ (z * z).sum(axis=1))
        doubt[name] += 1e-15 * float(np.abs(f) @ (z * z).sum(axis=1))
    return total, doubt
