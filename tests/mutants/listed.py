"""The mutants: by file (formula, source text with the mutated part in guillemets, what stands there instead).

The text must occur once in its file. The part is an expression, or a statement ending with a semicolon.
"""


def _flipped(name, at):
    """A row of the tableau with the sign of one coefficient reversed."""
    return f"t::{name}.map(|(j, w)| (j, if j == {at} {{ -w }} else {{ w }}))"


_STAGES = zip(
    ["A2", "A3", "A4", "A5", "A6", "A7", "A8", "A9", "A10", "A11", "A12", "B", "A14", "A15"],
    [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13],
    strict=True,
)
_TABLEAU = [
    (f"tableau: {name}", f"{i} => «step(out, y, k, &t::{name}, h)»", f"step(out, y, k, &{_flipped(name, at)}, h)")
    for i, (name, at) in enumerate(_STAGES, start=1)
]
_TABLEAU += [
    (f"tableau: {name}", f"«sum({k}, &t::{name}, {at})»", f"sum({k}, &{_flipped(name, 8)}, {at})")
    for name, k, at in [
        ("E5", "&k5", "at"),
        ("E3", "&k3", "at"),
        ("D4", "&k4", "i"),
        ("D5", "&k5", "i"),
        ("D6", "&k6", "i"),
        ("D7", "&k7", "i"),
    ]
]

MUTANTS = {
    "riccati/coupled.rs": [
        ("I1: S_τ P_τ", "p.map(|x| «x * self.minus_inv_rtau»)", "-x * self.minus_inv_rtau"),
        ("I1: S_a P_a", "a.map(|x| «x * self.minus_inv_ra»)", "-x * self.minus_inv_ra"),
        ("I1: S_d P_d", ".map(|x| «x * self.minus_inv_rd[k]»)", "-x * self.minus_inv_rd[k]"),
        ("I1: P_p S_p P_p", "if p == own { «0.5» } else { 1.0 }", "1.5"),
        ("I1: rank-one terms", "«u * t[c] + v * a[c]»", "u * t[c] - v * a[c]"),
        (
            "I1: G + Gᵀ",
            "= «g[(bi * B + r) * stride + bj][c] + g[(bj * B + c) * stride + bi][r]»",
            "g[(bi * B + r) * stride + bj][c] - g[(bj * B + c) * stride + bi][r]",
        ),
        ("I1: Q", "«out[i * l + i] += q;»", "out[i * l + i] -= q;"),
        ("I1: P_p 1", "«o[c] += x[c];»", "o[c] -= x[c];"),
        ("I1: P(T) = F", "y[p * self.block + i * self.l + i] = «v»;", "-v"),
    ],
    "riccati/dop853.rs": [
        ("first stage of the next step", "copy_within(«12 * w.len..13 * w.len», 0)", "11 * w.len..12 * w.len"),
        ("error estimate, 5 and 3", "«five + 0.01 * three»", "five - 0.01 * three"),
        ("error against tolerance", "err.is_nan() || «err > 1.0»", "err < 1.0"),
        ("step control", "let factor = «SAFETY / err.sqrt().sqrt().sqrt()»;", "SAFETY * err.sqrt().sqrt().sqrt()"),
        ("weighted norm", "*w = «m * other»;", "m / other"),
        ("θ of a node", "«(node(next) - s) - low»", "(node(next) + s) - low"),
        ("two_sum", "(sum, «b - (sum - a)»)", "b + (sum - a)"),
        ("growth over the blocks", ".map(|(p, dp)| «escape::growth(p, dp)»)", "-escape::growth(p, dp)"),
    ],
    "riccati/lanes.rs": [
        *_TABLEAU,
        ("tableau: A16", "_ => «step(out, y, k, &t::A16, h)»", f"step(out, y, k, &{_flipped('A16', 14)}, h)"),
        ("dense output, coefficient 2", "o1[i] = «h * first[i] - dy»", "h * first[i] + dy"),
        ("dense output, coefficient 3", "«first[i] + last[i]»", "first[i] - last[i]"),
        ("dense output, 1 − θ", "{ theta } else { «1.0 - theta» }", "1.0 + theta"),
    ],
    "riccati/hamiltonian.rs": [
        ("I2: S_dτ", "«-(r / d) / d»", "(r / d) / d"),
        ("I2: balance of F", "«f * flow.balance[i] * flow.balance[i]»", "f * flow.balance[i] / flow.balance[i]"),
        (
            "I2: balance undone",
            "«p[i * n + j] / flow.balance[i] / flow.balance[j]»",
            "p[i * n + j] / flow.balance[i] * flow.balance[j]",
        ),
        ("I2: cosh", "«level.c[ij] += power[ij];»", "level.c[ij] -= power[ij];"),
        (
            "I2: sinhc",
            "«sinhc[ij] += power[ij] / f64::from(2 * k + 1);»",
            "sinhc[ij] -= power[ij] / f64::from(2 * k + 1);",
        ),
        ("I2: Q h sinhc", "«self.q[ij / n] * sinhc[ij] * h»", "-self.q[ij / n] * sinhc[ij] * h"),
        ("I2: h sinhc S", ".map(|v| «v * h»)", "-v * h"),
        ("I2: Z, its C", "z[i * n + j] = «c[j * n + i]»;", "-c[j * n + i]"),
        ("I2: Z, its E P", "«z[i * n + j] += left * e[k * n + j];»", "z[i * n + j] -= left * e[k * n + j];"),
        ("I2: increment, P C", "«g[i * n + j] += left * c[k * n + j];»", "g[i * n + j] -= left * c[k * n + j];"),
        ("I2: increment, Zᵀ P", "«g[i * n + j] -= left * p[k * n + j];»", "g[i * n + j] += left * p[k * n + j];"),
        ("I2: elimination", "«r[j] -= factor * row[j];»", "r[j] += factor * row[j];"),
        ("I2: elimination, right side", "«g_r[j] -= factor * g_row[j];»", "g_r[j] += factor * g_row[j];"),
        ("I2: substitution", "«row[j] -= factor * solved[j];»", "row[j] += factor * solved[j];"),
        (
            "I2: bound that no pole is jumped over",
            "«level.bound.0 + norm * level.bound.1»",
            "level.bound.0 - norm * level.bound.1",
        ),
        (
            "I2: ‖S P‖",
            "«self.w[i] * dot + self.s_diagonal[i] * row[i]»",
            "self.w[i] * dot - self.s_diagonal[i] * row[i]",
        ),
        ("I2: P S P near a pole", "«-(sum + v[i] * v[j])»", "sum + v[i] * v[j]"),
    ],
    "riccati/escape.rs": [
        ("relative growth", "«cross / square * (b / a)»", "-(cross / square * (b / a))"),
        ("escape inside the horizon", "«rate * s * resolved >= 1.0»", "rate * s * resolved <= 1.0"),
        ("escape at the horizon", "(«s >= horizon» && rate", "s < horizon"),
        ("s* = s + 1 / growth", "let escape_time = «s + rate.recip()»;", "s - rate.recip()"),
    ],
    "riccati/residual.rs": [
        ("residual of I1", "«q[i] - pa[i] - ap[i] + psp[i]»", "q[i] - pa[i] - ap[i] - psp[i]"),
        ("residual of I2", "«q[i] - psp[i]»", "q[i] + psp[i]"),
        ("residual: S of I2", "«s_a[i] - s_d[i] - s_tau[i]»", "s_a[i] - s_d[i] + s_tau[i]"),
        ("residual: differences", "«*x += factor * p;»", "*x -= factor * p;"),
        ("residual: fresh integration", ".zip(&fresh[g * book.block..]).map(|(a, b)| «a - b»)", "a + b"),
    ],
    "riccati/mod.rs": [
        ("feedback: sign of the team", "*g = «sign * p / r»;", "-sign * p / r"),
        ("feedback: target by P_τ", "Interaction::I1 => «(-1.0, 1, 2)»", "(-1.0, 2, 2)"),
        (
            "feedback: attacker",
            "*g = «p_a.chunks_exact(n).map(|row| row[j]).sum::<f64>() / w.r_a»;",
            "-p_a.chunks_exact(n).map(|row| row[j]).sum::<f64>() / w.r_a",
        ),
    ],
    "synthesis/problem.rs": [
        ("F of I1 and I2", "let sign = if interaction == Interaction::I1 { «-1.0» } else { 1.0 };", "1.0"),
        ("M", "«target[a * size + b] += r[i] * f[a] * f[b];»", "target[a * size + b] -= r[i] * f[a] * f[b];"),
        ("W_p: which P", "«scale * matrix[e]»", "scale * p[e]"),
        ("W_p: sign", "let scale = «gamma[group].sqrt()»;", "-gamma[group].sqrt()"),
        ("W_pᵀW_p", "«w[i * size + a] * w[j * size + a]»", "-w[i * size + a] * w[j * size + a]"),
        ("c_i = γ r_i²", "«gamma[term] * r[i] * r[i]»", "gamma[term] * r[i] / r[i]"),
        ("c_i of the target in I2", "1 + usize::from(«i + 1 == rows»)", "i + 1 != rows"),
        ("term ‖ΔQ‖²", "(«gain - self.target[a * n + b]»)", "gain + self.target[a * n + b]"),
        ("terms ‖ΔQ_τ‖², ‖ΔQ_a‖²", "«product(a, b) + product(b, a)»", "product(a, b) - product(b, a)"),
        ("terms: order of ΔQ_τ, ΔQ_a", "vec![quadratic, «coupled(1)», coupled(2)", "coupled(2)"),
        ("term ‖S‖²", "map(|(g, f)| «g - f»)", "g + f"),
        ("constant part, diagonal", "let diagonal = «4.0 * gram[i * m + j] + own»;", "4.0 * gram[i * m + j] - own"),
        ("constant part, w_jᵀw_i", "let factor = «4.0 * sign * w[j * n + a]»;", "-4.0 * sign * w[j * n + a]"),
    ],
    "synthesis/objective.rs": [
        ("Θ: GᵀRG", "«*x += factor * gb;»", "*x -= factor * gb;"),
        ("Θ: Δ", "{ «gi[a] - fne[i * n + a]» }", "gi[a] + fne[i * n + a]"),
        ("Θ: E_p", "let sum = «e[a * n + b] + e[b * n + a]»;", "e[a * n + b] - e[b * n + a]"),
        ("Θ: sum of its terms", "«p.gamma[0] * quartic + rest»", "p.gamma[0] * quartic - rest"),
        ("∇Θ: cΔ", "let c = «2.0 * closeness[i]»;", "-2.0 * closeness[i]"),
        ("∇Θ: R G X", "let factor = «own * g[i * n + a]»;", "-own * g[i * n + a]"),
        ("∇Θ: WᵀE", "let factor = «4.0 * w[i * n + a]»;", "-4.0 * w[i * n + a]"),
        ("∇²Θ: g_jᵀg_i", "«h[b] = q[b] + scale * gi[b];»", "h[b] = q[b] - scale * gi[b];"),
        ("∇²Θ: GGᵀ", "«h[a] += factor * dot;»", "h[a] -= factor * dot;"),
        ("∇²Θ: R X", "«*h += own * x;»", "*h -= own * x;"),
        ("∇²Θ between stacked copies", "«h[b] = scale * gi[b];»", "h[b] = -scale * gi[b];"),
        (
            "certificate: R X",
            "let factor = «4.0 * self.problem.gamma[0] * self.problem.r[i]»;",
            "-4.0 * self.problem.gamma[0] * self.problem.r[i]",
        ),
    ],
    "synthesis/start.rs": [
        ("canonical start: projection", "if used(j) { «row[j] - mean» }", "row[j] + mean"),
        ("canonical start: mean", "if relative { «sum / count» }", "sum * count"),
        ("direction e_j − e_i", "«g[v.own] -= x;»", "g[v.own] += x;"),
        (
            "gradient on the variables",
            "«full[v.entry] - if v.relative { full[v.own] } else { 0.0 }»",
            "full[v.entry] + if v.relative { full[v.own] } else { 0.0 }",
        ),
        (
            "form on the variables, left",
            "«x -= full[va.own * width + vb.entry];»",
            "x += full[va.own * width + vb.entry];",
        ),
        (
            "form on the variables, right",
            "«x -= full[va.entry * width + vb.own];»",
            "x += full[va.entry * width + vb.own];",
        ),
        ("form on the variables, both", "«x += full[va.own * width + vb.own];»", "x -= full[va.own * width + vb.own];"),
        ("the paper's variables", "relative: «j != i»", "j == i"),
    ],
    "synthesis/complex.rs": [
        ("complex: X_i", "add_outer(&mut self.imaginary, n, «-p.r[i]», b, a)", "p.r[i]"),
        ("complex: E_i", "«ei[a * n + b] - ei[b * n + a]»", "ei[a * n + b] + ei[b * n + a]"),
        ("complex: ∇_A", "add_product(ga, n, «-factor», b, &self.imaginary)", "factor"),
        ("complex: ∇_B", "add_product(gb, n, «factor», b, &self.real)", "-factor"),
        ("complex: Hessian AA", "«sa * ai[b] - sb * bi[b]»", "sa * ai[b] + sb * bi[b]"),
        ("complex: Hessian BB", "«sb * bi[b] - sa * ai[b]»", "sb * bi[b] + sa * ai[b]"),
        ("complex: Hessian BA", "«sa * bi[b] + sb * ai[b]»", "sa * bi[b] - sb * ai[b]"),
        ("complex: Hessian BA, **I**", "cross += «bi[a] * aj[a] - ai[a] * bj[a]»", "bi[a] * aj[a] + ai[a] * bj[a]"),
        (
            "complex: Hessian BA, X_i",
            "«lower[row + column + b] -= imaginary;»",
            "lower[row + column + b] += imaginary;",
        ),
    ],
    "synthesis/dense.rs": [
        ("Cholesky", "«*x -= factor * c;»", "*x += factor * c;"),
        ("forward substitution", "«x[i] -= l[i * d + j] * value;»", "x[i] += l[i * d + j] * value;"),
        ("backward substitution", "«*b -= a * value;»", "*b += a * value;"),
    ],
    "synthesis/newton.rs": [
        ("Newton step", "*s = «-g»;", "*g"),
        ("actual decrease", "let actual = «value - next»;", "next - value"),
        ("predicted decrease", "«inner - damping * length2»", "inner + damping * length2"),
        ("back at the best point", "&& «value >= rival.value»", "value < rival.value"),
        (
            "what a descent can still gain",
            "&& «value - REST * predicted > rival.value»",
            "value + REST * predicted > rival.value",
        ),
    ],
    "synthesis/descent.rs": [
        ("the paper's descent: direction", ".map(|x| «-length * x»)", "length * x"),
        (
            "the paper's descent: Armijo",
            "«reference - 1e-4 * length * slope * slope»",
            "reference + 1e-4 * length * slope * slope",
        ),
        ("the paper's descent: step length", "map(|(s, (n, o))| «s * (n - o)»)", "s * (n + o)"),
    ],
    "synthesis/looks.rs": [
        (
            "a look must win",
            "«best.reached.value - TIE * best.reached.value.abs()»",
            "best.reached.value + TIE * best.reached.value.abs()",
        ),
        ("reversed rows", "scale_rows(problem.size, &from, &[i, j], «-1.0», &mut s.trial)", "1.0"),
        ("back from two parts", "«a + sign * b»", "a + sign + b"),
    ],
    "synthesis/mod.rs": [
        (
            "certified only when converged",
            "«certified && reached.status == Status::Converged»",
            "certified || reached.status == Status::Converged",
        ),
        ("K_i of the attacker", "if topology.sees_attacker(i) { «row.iter().sum()» } else", "-row.iter().sum::<f64>()"),
    ],
    "policy/closed_loop.rs": [
        (
            "u_a",
            "«(0..n).map(|i| own[i * n + j]).sum::<f64>() / w.r_a»",
            "-(0..n).map(|i| own[i * n + j]).sum::<f64>() / w.r_a",
        ),
        ("u_a by P_a", "Interaction::I1 => «&p[2 * n * n..3 * n * n]»", "&p[n * n..2 * n * n]"),
        ("u_τ", "«-x / w.r_tau»", "x / w.r_tau"),
        ("C = u_i − u_a", "«*x -= a;»", "*x += a;"),
    ],
    "policy/exponential.rs": [
        ("expm", "«term * x / k as f64»", "term * x / -(k as f64)"),
        ("expm: integral", "«integral += term / (k + 1) as f64;»", "integral -= term / (k + 1) as f64;"),
        ("expm: doubling", "«sum *= sum;»", "sum += sum;"),
        ("expm: doubling of the row", "«moved += moved * sum;»", "moved -= moved * sum;"),
        ("expm, large", "«*s += *t;»", "*s -= *t;"),
        ("expm, large: integral", "«*i += *t / (k + 1) as f64;»", "*i -= *t / (k + 1) as f64;"),
        ("expm, large: doubling of the row", "for_each(|(a, m)| «*a += m»)", "*a -= m"),
    ],
    "network/visibility.rs": [
        ("‖z_i − z_j‖", "«(x - y) * (x - y)»", "(x + y) * (x + y)"),
        ("closed ball: ≤", "if «d2 <= limit»", "d2 < limit"),
        ("own row sees the attacker", "let d2 = if «j == i»", "j != i"),
        ("rounded root, down", "while «square.sqrt() > radius»", "square.sqrt() >= radius"),
        ("rounded root, up", "while «square.next_up().sqrt() <= radius»", "square.next_up().sqrt() < radius"),
    ],
    "network/memory.rs": [
        ("hysteresis", "squared_reach(«zeta + rule.hysteresis»)", "zeta - rule.hysteresis"),
        ("hysteresis: which radius", "in «reach.iter().zip(&self.keep)».enumerate()", "self.keep.iter().zip(reach)"),
        ("hysteresis: ≤", "«d2 <= if was { keep } else { form }»", "d2 < if was { keep } else { form }"),
        ("dwell", "if «k < *rest»", "k <= *rest"),
        ("dwell: rounding", "«rule.dwell / step - WHOLE»", "rule.dwell / step + WHOLE"),
    ],
    "simulation/outcome.rs": [
        ("interception: ≤", "if «d2 <= reach» &&", "d2 < reach"),
        ("interception: the nearest, the first", "&& «d2 < nearest.0»", "d2 <= nearest.0"),
        ("capture: ≤", "(«squared_norm(target) <= self.attacker»)", "squared_norm(target) < self.attacker"),
        (
            "interception before capture",
            "if let Some(i) = «nearest.1» {",
            "nearest.1.filter(|_| squared_norm(&z[self.defenders.len() * dim..]) > self.attacker)",
        ),
        ("z = X − X_a", ".map(|(x, a)| «x - a»)", "x + a"),
    ],
    "simulation/record.rs": [
        ("attacker by its own row", "for_each(|(x, d)| «*x += d»)", "*x -= d"),
        ("X = z + X_a", ".map(|(x, a)| «x + a»)", "x - a"),
        ("row times z", "«*o += g * x;»", "*o -= g * x;"),
        ("timeout only at T", "(«k == last»).then_some", "k + 1 == last"),
        ("the network at the start", "if «end.is_none() || k == 0»", "end.is_none()"),
        (
            "rows that did not converge",
            "«step.gains.status != Status::Converged»",
            "step.gains.status == Status::Converged",
        ),
    ],
    "cost/mod.rs": [
        ("J: quadrature", "«*j += 0.5 * h * weight * value;»", "*j -= 0.5 * h * weight * value;"),
        ("J: terminal weight", "«*j += 0.5 * weighted(&f, &z, dim);»", "*j -= 0.5 * weighted(&f, &z, dim);"),
        ("J of I1: own effort", "«weighted(q, z, dim) + own»", "weighted(q, z, dim) - own"),
        ("J of I2: efforts", "«attacker - team - target»", "attacker - team + target"),
        ("J: expansion of z", "«*x *= h / j as f64»", "*x *= -h / j as f64"),
        ("J: Horner", "«*v = *v * s + t»", "*v = *v * s - t"),
    ],
    "ensemble/strip.rs": [
        ("batches, any size: who sees whom", "u64::from(«d2[l] <= sight[row][l]»)", "d2[l] < sight[row][l]"),
        ("batches, any size: who is caught", "u32::from(«d2[l] <= capture[i][l]»)", "d2[l] < capture[i][l]"),
    ],
}

# Mutants that no test can tell from the program: (file, formula): why.
EQUIVALENT = {
    ("synthesis/problem.rs", "W_p: sign"): "Θ, its derivatives and the certificate hold W_p twice in every product",
    ("cost/mod.rs", "J: Horner"): "it reverses z from one end of a step to the other, and costs are quadratic in z",
    ("network/visibility.rs", "rounded root, down"): "the next loop climbs back to the same number",
}
