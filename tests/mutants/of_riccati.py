"""The mutants of the Riccati equations; `listed.py` says how to read a row."""


def _flipped(name, at):
    """A row of the tableau with the sign of one coefficient reversed."""
    return f"t::{name}.map(|(j, w)| (j, if j == {at} {{ -w }} else {{ w }}))"


_STAGES = zip(
    ["A2", "A3", "A4", "A5", "A6", "A7", "A8", "A9", "A10", "A11", "A12", "B", "A14", "A15"],
    [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13],
    strict=True,
)
_TABLEAU = [
    (
        f"tableau: {name}",
        f"{i} => «step::<V, _>(out, y, k, &t::{name}, h)»",
        f"step::<V, _>(out, y, k, &{_flipped(name, at)}, h)",
    )
    for i, (name, at) in enumerate(_STAGES, start=1)
]
_TABLEAU += [
    (f"tableau: {name}", f"«sum::<V, _>({k}, &t::{name}, i)»", f"sum::<V, _>({k}, &{_flipped(name, 8)}, i)")
    for name, k in [("E5", "&k5"), ("E3", "&k3")]
]

MUTANTS = {
    "riccati/condition.rs": [
        ("a solution that rounding decides", "if «change <= MOST» { found }", "change.is_nan() || true"),
        ("a change relative to the matrix", "«(x - y) / size»", "(x + y) / size"),
    ],
    "riccati/coupled.rs": [
        ("I1: S_τ P_τ", "p[1][defenders].map(|x| «x * self.minus_inv_rtau»)", "-x * self.minus_inv_rtau"),
        ("I1: S_a P_a", "row_sums(&p[2][..N]).map(|x| «x * self.minus_inv_ra»)", "-x * self.minus_inv_ra"),
        ("I1: S_d P_d", ".map(|x| «x * self.minus_inv_rd[k]»)", "-x * self.minus_inv_rd[k]"),
        ("I1: P_p S_p P_p", "if p == own { «0.5» } else { 1.0 }", "1.5"),
        ("I1: P_p (S_d P_d), its terms", "«left[r].mul_add(m[c], sum[r][c])»", "(-left[r]).mul_add(m[c], sum[r][c])"),
        ("I1: P_p (S_d P_d)", "half_d.mul_add(«sum[r][c]», u", "-sum[r][c]"),
        ("I1: rank-one terms", "u.mul_add(t[c], «v * a[c]»)", "-v * a[c]"),
        (
            "I1: G + Gᵀ",
            "= «g[(bi * B + r) * stride + bj][c] + g[(bj * B + c) * stride + bi][r]»",
            "g[(bi * B + r) * stride + bj][c] - g[(bj * B + c) * stride + bi][r]",
        ),
        ("I1: G + Gᵀ above the diagonal", "std::array::from_fn(|c| «sum[c][r]»)", "sum[r][c]"),
        ("I1: Q", "«out[i * L + i] += q;»", "out[i * L + i] -= q;"),
        ("I1: P_p 1", "«sum[c] + row[c]»", "row[c]"),
        ("I1: P(T) = F", "y[diagonal(i)] = «v»;", "-v"),
    ],
    "riccati/large.rs": [
        ("I1, large: μ = −P / r", ".map(|r| «-1.0 / r»)", "1.0 / r"),
        ("I1, large: μ_N by v_a", "chain([&target[n - 1], «&attacker[n]»])", "&attacker[n - 1]"),
        ("I1, large: own term of τ", "[None, «Some(n - 1)», Some(n)][p]", "Some(n)"),
        ("I1, large: own term of a", "[None, Some(n - 1), «Some(n)»][p]", "Some(n - 1)"),
        ("I1, large: own terms of d", "if own.is_none() { «n - 1» } else { 0 }", "n"),
        ("I1, large: half of an own term", "self.scale(own, «0.5»)", "1.0"),
        ("I1, large: doubled back", "self.scale(own, «2.0»)", "1.0"),
        ("I1, large: Q", "«out[triangle::entry(i, i)] += q;»", "out[triangle::entry(i, i)] -= q;"),
        ("I1, large: P_p 1", "(sum[0] + sum[1]) + («sum[2] + sum[3]»)", "sum[2] - sum[3]"),
        (
            "I1, large: P_p 1, its terms",
            "sum[r] = «sum[r] + V::Eight::load(&four[r])»;",
            "V::Eight::load(&four[r])",
        ),
        ("I1, large: pᵀ μ, once", "sum = add(«left(p)», right(m), sum);", "left(m)"),
        ("I1, large: pᵀ μ", "sum = add(«left(pi)», right(mj), sum);", "left(mi)"),
        ("I1, large: μᵀ p", "sum = add(left(mi), «right(pj)», sum);", "right(mj)"),
        (
            "I1, large: pᵀ μ, once, diagonal",
            ".take(self.once) {\n            (top, bottom) = (add(low(p), low(m), top), add(high(p), «m», bottom));",
            "p",
        ),
        (
            "I1, large: pᵀ μ, diagonal",
            ".skip(self.once) {\n            (top, bottom) = (add(«low(p)», low(m), top), add(high(p), m, bottom));",
            "low(m)",
        ),
        ("I1, large: μᵀ p, diagonal", "(add(low(m), «low(p)», top), add(high(m), p, bottom))", "low(m)"),
        ("I1, large: μᵀ p, below the diagonal", "(add(low(m), low(p), top), add(«high(m)», p, bottom))", "high(p)"),
        ("I1, large: leftᵀ right", "«P::splat(left[r])»", "P::splat(-left[r])"),
        ("I1, large: tile and transpose", "«tile[r] + transpose[r]»", "tile[r] - transpose[r]"),
        ("I1, large: two tiles of a row", "put::<V>(right, i, «2 * j + 1», out)", "2 * j"),
    ],
    "riccati/triangle.rs": [
        ("triangle: number of a tile", "«i * (i + 1) / 2 + j»", "i * (i + 1) / 2 - j"),
        ("triangle: place of an entry", "«i % TILE * TILE + j % TILE»", "i % TILE + j % TILE * TILE"),
        ("triangle: tile below the diagonal", "panels[«j / 2 * height + i»]", "i / 2 * height + j"),
        ("triangle: half of the tile below", "height + i], «j % 2»)", "i % 2"),
        ("triangle: tile above the diagonal", "panels[«i / 2 * height + j»]", "j / 2 * height + i"),
        ("triangle: half of the tile above", "height + j], «i % 2»)", "j % 2"),
        ("triangle: transpose", "put::<V>(«V::transpose(rows)», ", "rows"),
        ("triangle: row of a panel", "rows[«2 * r + half»]", "r + half"),
        ("triangle: panel of a row", "out[«s * PANEL»..]", "s * TILE"),
    ],
    "riccati/weight.rs": [
        ("weights: size of an entry", "if «x.abs() > m» {", "x > m"),
        ("weights: floor", "let floor = «FLOOR» * sizes", "FLOOR.recip()"),
        ("weights: 1 / m", "*m = «1.0 / (*m).max(floor).sqrt()»;", "(*m).max(floor).sqrt()"),
        ("weights: m_i m_j", "*w = «m * other»;", "m / other"),
        ("weights, triangle: rows", "largest[r][c] = «larger(largest[r][c], tile[r][c])»;", "largest[r][c]"),
        ("weights, triangle: columns", "sizes[c] = «larger(sizes[c], tile[r][c])»;", "sizes[c]"),
        ("weights, triangle: twice", "if j < i { «std::f64::consts::SQRT_2» }", "1.0"),
        ("weights, triangle: m_i m_j", "|column| «row * column»", "row / column"),
    ],
    "riccati/dop853.rs": [
        ("first stage of the next step", "copy_within(«12 * w.len..13 * w.len», 0)", "11 * w.len..12 * w.len"),
        ("error estimate, 5 and 3", "«five + 0.01 * three»", "five - 0.01 * three"),
        ("error estimate, h", "worst.max(«h * five»", "five / h"),
        ("error against tolerance", "err.is_nan() || «err > 1.0»", "err < 1.0"),
        ("step control", "let factor = «SAFETY / err.sqrt().sqrt().sqrt()»;", "SAFETY * err.sqrt().sqrt().sqrt()"),
        ("θ of a node", "((«node(next + i) - s») - low) / h", "node(next + i) + s"),
        ("nodes of one step", "take_while(|&j| «node(j) <= reached»)", "node(j) >= reached"),
        ("s of the next step", "two_sum(s, «low + h»)", "low - h"),
        ("two_sum", "(sum, «b - (sum - a)»)", "b + (sum - a)"),
        ("growth over the blocks", ".map(|(p, dp)| «escape::growth(p, dp)»)", "-escape::growth(p, dp)"),
    ],
    "riccati/stages.rs": [
        *_TABLEAU,
        (
            "tableau: A16",
            "_ => «step::<V, _>(out, y, k, &t::A16, h)»",
            f"step::<V, _>(out, y, k, &{_flipped('A16', 14)}, h)",
        ),
        ("tableau: D4", "t::D[j].1[q]), «k»);", "if q == 0 && j == 4 { V::Eight::splat(0.0) - k } else { k }"),
        ("tableau: D5", "splat(«t::D[j].1[q]»)", "if q == 1 && j == 4 { -t::D[j].1[q] } else { t::D[j].1[q] }"),
        (
            "tableau: D6",
            "sum[q] = «sum[q]».plus(",
            "if q == 2 && j == 4 { V::Eight::splat(0.0) - sum[q] } else { sum[q] }",
        ),
        ("tableau: D7", "(h * «sum[q]»)", "if q == 3 { V::Eight::splat(0.0) - sum[q] } else { sum[q] }"),
        (
            "dense output, coefficient 1",
            "let dy = «V::Eight::load(&y_new[i]) - V::Eight::load(&y[i])»",
            "V::Eight::load(&y_new[i]) + V::Eight::load(&y[i])",
        ),
        ("dense output, coefficient 2", "«h * first - dy»", "h * first + dy"),
        ("dense output, coefficient 3", "«first + last»", "first - last"),
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
        ("I2: Q h sinhc", "«self.q[ij / n] * *v * h»", "-self.q[ij / n] * *v * h"),
        ("I2: h sinhc S", "for_each(|v| «*v *= h»)", "*v *= -h"),
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
    "riccati/increment.rs": [
        ("I2: Z, its C", "z_row[j] = «c[j * n + i]»;", "-c[j * n + i]"),
        ("I2: Z, its E P", "«z_row[j] += left * e[k * n + j];»", "z_row[j] -= left * e[k * n + j];"),
        ("I2: increment, P C", "«g_row[j] += left * c[k * n + j];»", "g_row[j] -= left * c[k * n + j];"),
        ("I2: increment, Zᵀ P", "«g_row[j] -= left * p[k * n + j];»", "g_row[j] += left * p[k * n + j];"),
        ("I2: elimination", "«r[j] -= factor * row[j];»", "r[j] += factor * row[j];"),
        ("I2: elimination, right side", "«g_r[j] -= factor * g_row[j];»", "g_r[j] += factor * g_row[j];"),
        ("I2: substitution", "«row[j] -= factor * solved[j];»", "row[j] += factor * solved[j];"),
    ],
    "riccati/classes.rs": [
        ("classes: weights of the others", "«(members - 1) as f64 * of[first]»", "(members - 1) as f64 / of[first]"),
        ("classes: P within a class", "«p[row + 1] * share[row]»", "p[row + 1]"),
        ("classes: P of a member itself", "_ if «i == j» => p[row]", "i == j + 1"),
        ("classes: share of a member", "«1.0 / (members - 1) as f64» } else", "1.0 / members as f64"),
    ],
    "riccati/escape.rs": [
        ("relative growth", "«cross / square * (b / a)»", "-(cross / square * (b / a))"),
        ("escape inside the horizon", "«rate * s * resolved >= 1.0»", "rate * s * resolved <= 1.0"),
        ("escape at the horizon", "(«s >= horizon» && rate", "s < horizon"),
        ("s* = s + 1 / growth", "let escape_time = «s + rate.recip()»;", "s - rate.recip()"),
    ],
    "riccati/printed.rs": [
        ("residual of I1", "«q[i] - pa[i] - ap[i] + psp[i]»", "q[i] - pa[i] - ap[i] - psp[i]"),
        ("residual of I2", "«q[i] - psp[i]»", "q[i] + psp[i]"),
        ("residual: S of I2", "«*a - d - tau»", "*a - d + tau"),
    ],
    "riccati/residual.rs": [
        ("residual: differences", "«*x += factor * p;»", "*x -= factor * p;"),
        ("residual: fresh integration", ".zip(fresh).map(|(a, b)| «a - b»)", "a + b"),
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
}
