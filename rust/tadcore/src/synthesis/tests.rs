//! Derivatives against differences, the value against its terms, and lanes against one number.

use super::newton::{Layout, Objective, Variable, packed};
use super::theta::{Doubled, RealGains};
use super::*;
use crate::game::Interaction;
use crate::simd::Width;

mod descents;
mod dominated;
mod moves;
mod single;
mod starts;
mod tabled;
mod weights;

fn check(objective: &mut impl Objective<f64>, g: &[f64]) {
    let width = objective.width();
    let h = 1e-5;
    let (mut gradient, mut hessian) = (vec![0.0; width], vec![0.0; width * width]);
    objective.value(g);
    objective.gradient(g, &mut gradient);
    objective.keep(true);
    objective.prepare(g);
    // Each entry alone is a variable, and none is relative.
    restrict(objective, g, &|entry| Variable { entry, own: entry, relative: false }, 1, &mut hessian);
    for a in 0..width {
        let mut probe = |shift: f64| {
            let mut p = g.to_vec();
            p[a] += shift;
            let mut slope = vec![0.0; width];
            let value = objective.value(&p);
            objective.gradient(&p, &mut slope);
            (value, slope)
        };
        let ((above, up), (below, down)) = (probe(h), probe(-h));
        let slope = (above - below) / (2.0 * h);
        assert!((slope - gradient[a]).abs() < 1e-6 * (1.0 + slope.abs()), "gradient {a}");
        for b in 0..=a {
            let curve = (up[b] - down[b]) / (2.0 * h);
            assert!((curve - hessian[packed(a) + b]).abs() < 1e-5 * (1.0 + curve.abs()), "hessian {a} {b}");
        }
    }
    // Directions e_j − e_i, in every row but the first: the same form, by its product with them.
    let full = |a: usize, b: usize| hessian[packed(a.max(b)) + a.min(b)];
    let (rows, copies) = (3, if width > 12 { 2 } else { 1 });
    let n = width / rows / copies;
    let variable = |entry: usize| Variable { entry, own: entry / n * n + entry / n, relative: entry >= n };
    let mut restricted = vec![0.0; width * width];
    restrict(objective, g, &variable, copies, &mut restricted);
    let direction = |entry: usize| {
        let (copy, v) = (entry / (rows * n) * rows * n, variable(entry % (rows * n)));
        (entry, v.relative.then_some(copy + v.own))
    };
    for a in 0..width {
        for b in 0..=a {
            let ((a, own_a), (b, own_b)) = (direction(a), direction(b));
            let column = |a| full(a, b) - own_b.map_or(0.0, |own| full(a, own));
            let expected = column(a) - own_a.map_or(0.0, column);
            let found = restricted[packed(a) + b];
            assert!(
                (found - expected).abs() < 1e-12 * (1.0 + full(a, a).abs() + full(b, b).abs()),
                "direction {a} {b}"
            );
        }
    }
}

/// The Hessian on as many copies of the variables as the objective has.
fn restrict(
    objective: &impl Objective<f64>,
    g: &[f64],
    variable: &dyn Fn(usize) -> Variable,
    copies: usize,
    out: &mut [f64],
) {
    let width = objective.width() / copies;
    let mut layout = Layout::default();
    layout.begin(width, copies);
    layout.place(0, &(0..width).map(variable).collect::<Vec<_>>());
    layout.list();
    layout.restrict_form(objective, g, &mut vec![0.0; objective.width()], out, None);
}

pub(super) fn sample(interaction: Interaction) -> (Problem, Vec<f64>, Vec<f64>) {
    let (size, groups) = if interaction == Interaction::I1 { (4, 3) } else { (3, 1) };
    let mut seed = 0.3f64;
    let mut next = || {
        seed = (seed * 37.77 + 0.123).fract();
        seed - 0.5
    };
    let mut p = vec![0.0; groups * size * size];
    for matrix in p.chunks_exact_mut(size * size) {
        for a in 0..size {
            for b in 0..=a {
                matrix[a * size + b] = 2.0 * next();
                matrix[b * size + a] = matrix[a * size + b];
            }
        }
    }
    let gamma = [0.4, 0.3, 0.2, 0.6][..interaction.terms()].to_vec();
    let problem =
        Problem::from_parts(interaction, vec![0.7, 1.3, 0.9], gamma, &p, &CancelToken::new()).expect("memory");
    let g = (0..2 * 3 * size).map(|_| next()).collect();
    (problem, p, g)
}

/// Past some size the Hessian's constant part is not in memory: its rows, and single entries of them, are put together as
/// they are read, bitwise the same.
#[test]
fn rows_put_together_are_those_in_memory() {
    /// Every row of the form by rows, and the entries that it gives singly.
    fn rows(objective: &mut impl Objective<f64>, g: &[f64], copies: usize) -> (Vec<f64>, Vec<f64>) {
        let width = objective.width();
        objective.value(g);
        objective.keep(true);
        objective.prepare(g);
        let (mut full, mut single, mut row) = (Vec::new(), Vec::new(), vec![0.0; width]);
        let mut layout = Layout::default();
        layout.begin(width / copies, copies);
        // Every second row knows differences only.
        let known = |entry: &usize| (entry / 4).is_multiple_of(2) || entry % 4 != entry / 4;
        let relative = |entry: usize| Variable { entry, own: entry / 4 * 5, relative: entry / 4 % 2 == 1 };
        layout.place(0, &(0..width / copies).filter(known).map(relative).collect::<Vec<_>>());
        layout.list();
        for slot in layout.listed() {
            let end = (slot.entry / 4 + 1) * 4;
            objective.row(g, slot, &mut row);
            full.extend_from_slice(&row[..end]);
            single.extend((0..end).filter_map(|at| objective.entry(g, slot, at)));
        }
        (full, single)
    }
    let (problem, _, g) = sample(Interaction::I1);
    let mut bare = problem.theta.double.clone();
    bare.quadratic = [Vec::new(), Vec::new()];
    let memory = "memory";
    let half = &g[..g.len() / 2];
    let (expected, none) = rows(&mut RealGains::<f64, 0>::new(&problem.theta.double, None).expect(memory), half, 1);
    let (full, single) = rows(&mut RealGains::<f64, 0>::new(&bare, None).expect(memory), half, 1);
    assert!(none.is_empty() && expected.len() > 80);
    assert_eq!((&full, &single), (&expected, &expected));
    for complex in [true, false] {
        let doubled = |of| {
            let mut doubled = Doubled::<f64, 0>::new(of, None).expect(memory);
            doubled.set_lane(0, complex, 1.0);
            rows(&mut doubled, &g, 2)
        };
        let (expected, none) = doubled(&problem.theta.double);
        assert!(none.is_empty() && expected.len() > 300);
        assert_eq!(doubled(&bare), (expected.clone(), expected), "{complex}");
    }
}

#[test]
fn derivatives_match_differences() {
    for interaction in [Interaction::I1, Interaction::I2] {
        let (problem, _, g) = sample(interaction);
        check(&mut RealGains::<f64, 0>::new(&problem.theta.double, None).expect("memory"), &g[..g.len() / 2]);
        for complex in [true, false] {
            let mut doubled = Doubled::<f64, 0>::new(&problem.theta.double, None).expect("memory");
            doubled.set_lane(0, complex, 1.0);
            check(&mut doubled, &g);
        }
    }
}

/// Every width, alone and with neighbours, on networks from empty to complete: the same bits.
#[test]
fn neighbours_and_width_change_nothing() {
    for interaction in [Interaction::I1, Interaction::I2] {
        let (problem, _, _) = sample(interaction);
        let (m, n) = (problem.rows(), problem.size());
        let topologies: Vec<Topology> = (0..1u64 << (m * n))
            .step_by(if m * n > 9 { 29 } else { 3 })
            .map(|bits| Topology::from_words(m, n, &[bits]))
            .collect();
        let solve = |width, topologies: &[Topology]| {
            let mut solver = Synthesizer { dispatcher: Dispatcher::of(width), ..Synthesizer::default() };
            let mut all = Vec::new();
            let each = |_, gains| {
                all.push(gains);
                Ok(())
            };
            solver.solve_all(&problem, topologies, Options::default(), each).expect("memory");
            all
        };
        let alone: Vec<Gains> =
            topologies.iter().flat_map(|topology| solve(Width::Baseline, std::slice::from_ref(topology))).collect();
        assert!(alone.iter().any(|gains| !gains.certified), "no network needs a restart");
        for width in Width::all() {
            assert_eq!(solve(width, &topologies), alone, "{width:?}");
            for (topology, gains) in topologies.iter().zip(&alone) {
                assert_eq!(&solve(width, std::slice::from_ref(topology))[0], gains, "{width:?}");
            }
        }
    }
}

#[test]
fn the_value_is_the_weighted_sum_of_the_terms() {
    for interaction in [Interaction::I1, Interaction::I2] {
        let (problem, p, g) = sample(interaction);
        let g = &g[..g.len() / 2];
        let value = RealGains::<f64, 0>::new(&problem.theta.double, None).expect("memory").value(g);
        let sum = problem.weigh(&problem.terms(&p, g, &CancelToken::new()).expect("memory"));
        assert!((sum - problem.in_scale_of_gamma(value)).abs() < 1e-12 * sum);
    }
}

#[test]
fn who_sees_no_one_has_no_gain_and_who_sees_all_plays_the_equilibrium() {
    for interaction in [Interaction::I1, Interaction::I2] {
        let (problem, _, _) = sample(interaction);
        let (m, n) = (problem.rows(), problem.size());
        let mut solver = Synthesizer::new();
        let blind = solver.solve(&problem, &Topology::empty(m, n), Options::default()).expect("memory");
        assert!(blind.rows.iter().all(|&g| g == 0.0) && blind.certified);
        let full = solver.solve(&problem, &Topology::complete(m, n), Options::default()).expect("memory");
        assert!(full.theta < 1e-24 && full.certified);
        for (g, f) in full.rows.iter().zip(problem.fne()) {
            assert!((g - f).abs() < 1e-12);
        }
    }
}

/// Θ over doubled gains by its definition: complex arithmetic, or a stack whose second part is compared with nothing.
fn by_definition(problem: &Problem, g: &[f64], complex: bool) -> f64 {
    type C = (f64, f64);
    let (n, m) = (problem.size, problem.rows);
    let (a, b) = g.split_at(m * n);
    let square = |(x, y): C| x * x + y * y;
    let product = |(x, y): C, (u, v): C| (x * u - y * v, x * v + y * u);
    let mut sum = 0.0;
    for p in 0..n {
        for q in 0..n {
            let mut x = (-problem.theta.double.target[p * n + q], 0.0);
            for i in 0..m {
                let (gp, gq) = ((a[i * n + p], b[i * n + p]), (a[i * n + q], b[i * n + q]));
                let term = product((gp.0, -gp.1), gq);
                x = (
                    x.0 + problem.theta.double.r[i] * term.0,
                    x.1 + problem.theta.double.r[i] * if complex { term.1 } else { 0.0 },
                );
            }
            sum += problem.theta.double.first * square(x);
        }
    }
    let delta = |i: usize, q: usize| (a[i * n + q] - problem.theta.double.fne[i * n + q], b[i * n + q]);
    for w in &problem.theta.double.coupling {
        for p in 0..n {
            for q in 0..n {
                let (mut e, mut turned) = ((0.0, 0.0), (0.0, 0.0));
                for i in 0..m {
                    let (d, t) = (delta(i, q), delta(i, p));
                    e = (e.0 + w[i * n + p] * d.0, e.1 + w[i * n + p] * d.1);
                    turned = (turned.0 + w[i * n + q] * t.0, turned.1 + w[i * n + q] * t.1);
                }
                let sign = if complex { -1.0 } else { 1.0 };
                sum += square((e.0 + turned.0, e.1 + sign * turned.1));
            }
        }
    }
    for i in 0..m {
        for q in 0..n {
            sum += problem.theta.double.closeness[i] * square(delta(i, q));
        }
    }
    sum
}

#[test]
fn doubled_gains_are_complex_or_stacked() {
    for interaction in [Interaction::I1, Interaction::I2] {
        let (problem, _, g) = sample(interaction);
        for complex in [true, false] {
            let mut doubled = Doubled::<f64, 0>::new(&problem.theta.double, None).expect("memory");
            doubled.set_lane(0, complex, 1.0);
            let (value, expected) = (doubled.value(&g), by_definition(&problem, &g, complex));
            assert!((value - expected).abs() < 1e-12 * expected, "{interaction:?} {complex}: {value} {expected}");
            let mut flat = g.clone();
            flat[g.len() / 2..].fill(0.0);
            let real =
                RealGains::<f64, 0>::new(&problem.theta.double, None).expect("memory").value(&flat[..g.len() / 2]);
            assert!((doubled.value(&flat) - real).abs() < 1e-12 * real, "{interaction:?} {complex}");
        }
    }
}

/// What cancels in ∇Θ and in Θ is no larger than the sizes that their rounding is measured by, one term at a time.
#[test]
fn sizes_bound_the_parts_that_cancel() {
    for interaction in [Interaction::I1, Interaction::I2] {
        let (sampled, p, points) = sample(interaction);
        let (n, m) = (sampled.size(), sampled.rows());
        for term in 0..interaction.terms() {
            let mut gamma = vec![0.0; interaction.terms()];
            gamma[term] = 0.7;
            let problem =
                Problem::from_parts(interaction, sampled.theta.double.r.clone(), gamma, &p, &CancelToken::new())
                    .expect("memory");
            let mut objective = RealGains::<f64, 0>::new(&problem.theta.double, None).expect("memory");
            let zero = objective.value(&vec![0.0; m * n]);
            assert!(zero <= problem.theta.double.scale.value * (1.0 + 1e-14), "{interaction:?} {term}");
            for size in [1e-3, 1.0, 1e3] {
                let g: Vec<f64> = points[..m * n].iter().map(|x| size * x).collect();
                objective.value(&g);
                let scale = objective.gradient_scale(&g);
                // 4γ₁RGM, then what is linear in Δ = G − F, at G and at F: the gradient is affine without the first term.
                let rgm: f64 = (0..m * n)
                    .map(|e| {
                        let (i, b) = (e / n, e % n);
                        let row: f64 = (0..n).map(|a| g[i * n + a] * problem.theta.double.target[a * n + b]).sum();
                        (4.0 * problem.theta.double.first * problem.theta.double.r[i] * row).powi(2)
                    })
                    .sum();
                assert!(rgm.sqrt() <= scale, "{interaction:?} {term} {size}");
                if term > 0 {
                    let mut slope = |g: &[f64]| {
                        let mut slope = vec![0.0; m * n];
                        objective.value(g);
                        objective.gradient(g, &mut slope);
                        slope
                    };
                    let (at, of_f) = (slope(&g), slope(&vec![0.0; m * n]));
                    let of_g: f64 = at.iter().zip(&of_f).map(|(a, f)| (a - f).powi(2)).sum();
                    let of_f: f64 = of_f.iter().map(|f| f * f).sum();
                    assert!(of_g.sqrt() + of_f.sqrt() <= scale, "{interaction:?} {term} {size}");
                }
            }
        }
    }
}
