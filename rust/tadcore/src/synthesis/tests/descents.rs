//! Single descents: the damping of each step on quadratic functions, where closed forms say what it is, and how early a
//! descent ends that has an incumbent.

use super::super::newton::{Backend, Form, Incumbent, Owner, Reached, Slot, Workspace, advance, minimise};
use super::super::search::{canonical, variables};
use super::*;
use crate::game::Criterion;
use crate::simd::norm;

pub(super) const BACKEND: Backend<'static> = Backend { library: false, width: Width::Baseline, cancel: None };
pub(super) const LIMITS: Limits =
    Limits { iterations: 2_000, tolerance: 1e-12, acceptable: 1e-10, longest: f64::INFINITY };

/// ½ Σ h_i g_i² + Σ b_i g_i + a number that keeps it positive.
struct Quadratic {
    curvature: Vec<f64>,
    slope: Vec<f64>,
}

impl Form<f64> for Quadratic {
    fn row(&self, _: &[f64], v: &Slot<f64>, out: &mut [f64]) {
        out.fill(0.0);
        out[v.entry] = self.curvature[v.entry];
    }
}

impl Objective<f64> for Quadratic {
    fn width(&self) -> usize {
        self.slope.len()
    }

    fn value(&mut self, g: &[f64]) -> f64 {
        let parts = g.iter().zip(&self.curvature).zip(&self.slope).map(|((g, h), b)| (0.5 * h * g + b) * g);
        parts.sum::<f64>() + 1e6
    }

    fn gradient(&mut self, g: &[f64], out: &mut [f64]) {
        for (i, out) in out.iter_mut().enumerate() {
            *out = self.curvature[i] * g[i] + self.slope[i];
        }
    }

    fn keep(&mut self, _: bool) {}

    fn prepare(&mut self, _: &[f64]) {}

    fn gradient_scale(&self, _: &[f64]) -> f64 {
        1.0
    }

    fn value_scale(&self) -> f64 {
        1.0
    }
}

/// Where a descent from `start` along `variables` ends, and what it says of that.
pub(super) fn descend(
    objective: &mut impl Objective<f64>,
    start: &[f64],
    variables: &[Variable],
    incumbent: Option<Incumbent>,
    limits: Limits,
) -> (Vec<f64>, Reached) {
    let mut tasks = Tasks::default();
    tasks.clear(start.len(), 1);
    tasks.add(0, false, 0.0).expect("memory").copy_from_slice(start);
    let owners = [Owner { variables, incumbent }];
    minimise(objective, &mut tasks, &owners, limits, BACKEND, &mut Workspace::default()).expect("memory");
    (tasks.point(0).to_vec(), tasks.reached(0))
}

/// The first step from 0 that is no longer than `longest`.
fn first_step(curvature: &[f64], slope: &[f64], longest: f64) -> Vec<f64> {
    let mut quadratic = Quadratic { curvature: curvature.to_vec(), slope: slope.to_vec() };
    let variables: Vec<Variable> =
        (0..slope.len()).map(|entry| Variable { entry, own: entry, relative: false }).collect();
    let limits = Limits { iterations: 1, longest, ..LIMITS };
    descend(&mut quadratic, &vec![0.0; slope.len()], &variables, None, limits).0
}

/// Where all curvatures are h the step −b/(h + μ) has the length aimed at, four fifths of the longest, for one μ, and
/// the rule finds it at once. Otherwise it finds one between that and the longest.
#[test]
fn a_step_too_long_is_made_as_long_as_aimed_at() {
    let (longest, towards) = (0.7, [2.0 / 3.0, -1.0 / 3.0, 2.0 / 3.0]);
    for ratio in [1.01, 2.0, 50.0, 1e4] {
        let slope = |h: f64| towards.map(|x| -x * h * longest * ratio);
        for (s, x) in first_step(&[3.0; 3], &slope(3.0), longest).iter().zip(towards) {
            assert!((s - 0.8 * longest * x).abs() < 1e-9 * longest, "{ratio}: {s}");
        }
        let length = norm(&first_step(&[0.1, 1.0, 10.0], &slope(1.0), longest));
        assert!(0.8 * longest < length && length <= longest, "{ratio}: {length}");
    }
}

/// A pivot of −½ lacks ½; with μ = ½ it is zero and refused, and μ = 2, four times as much, will do.
#[test]
fn an_indefinite_matrix_is_damped_by_what_its_pivot_lacks() {
    let (curvature, slope) = ([1.0, -0.5, 0.25], [0.3, 0.1, -0.2]);
    for (s, (h, b)) in first_step(&curvature, &slope, f64::INFINITY).iter().zip(curvature.iter().zip(slope)) {
        assert!((s + b / (h + 2.0)).abs() < 1e-14, "{s}");
    }
}

/// Networks at both interactions' samples: all that a descent of one of them needs.
pub(super) fn each(mut visit: impl FnMut(&Problem, &[Variable], &[f64])) {
    for interaction in [Interaction::I1, Interaction::I2] {
        let (problem, _, _) = sample(interaction);
        let (m, n) = (problem.rows(), problem.size());
        for key in (1..1u64 << (m * n)).step_by(if m * n > 9 { 61 } else { 7 }) {
            let topology = Topology::from_key(m, n, key);
            let mut g = vec![0.0; m * n];
            canonical(&problem, &topology, &mut g);
            visit(&problem, &variables(&topology, Criterion::Paper).expect("memory"), &g);
        }
    }
}

/// No Θ is negative, so nothing gets below an incumbent of −1; a descent is to notice that before it has converged.
/// Below one that is higher than the end, by however little, it is to get.
#[test]
fn a_descent_ends_early_only_where_it_cannot_win() {
    let (mut steps, mut saved, mut descents) = (0, 0, 0);
    each(|problem, variables, g| {
        let mut real = RealGains::<f64, 0>::new(&problem.theta.double, None).expect("memory");
        let (end, alone) = descend(&mut real, g, variables, None, LIMITS);
        let far: Vec<f64> = end.iter().map(|x| 3.0 * x + 1.0).collect();
        let mut beside = |value| {
            let incumbent = Incumbent { g: &far, value, near: 1e-3 };
            descend(&mut real, g, variables, Some(incumbent), LIMITS)
        };
        let (_, lost) = beside(-1.0);
        assert!(lost.iterations <= alone.iterations && lost.value >= alone.value * (1.0 - 1e-12));
        (steps, saved) = (steps + alone.iterations, saved + alone.iterations - lost.iterations);
        descents += usize::from(alone.iterations > 3);
        for higher in [1e-6, 1e-3, 0.1] {
            let (won, reached) = beside(alone.value * (1.0 + higher));
            assert_eq!(
                (won, reached.value, reached.iterations),
                (end.clone(), alone.value, alone.iterations),
                "{higher}"
            );
        }
    });
    assert!(saved >= descents, "{saved} of {steps} steps in {descents} descents");
}

/// Near an incumbent that is no higher a descent has come back to it, and ends there before it has converged; as far
/// from it as its reflection is, with the same Θ, it has not.
#[test]
fn a_descent_ends_where_it_is_back() {
    let (mut steps, mut saved, mut descents) = (0, 0, 0);
    each(|problem, variables, g| {
        let mut real = RealGains::<f64, 0>::new(&problem.theta.double, None).expect("memory");
        let (best, found) = descend(&mut real, g, variables, None, LIMITS);
        let near = 1e-3 * norm(&best);
        let mut off = best.clone();
        let by: Vec<f64> = (0..variables.len()).map(|v| 0.05 * (1.0 + v as f64).sin() * norm(&best)).collect();
        advance(&mut off, variables, &by);
        let (end, alone) = descend(&mut real, &off, variables, None, LIMITS);
        if near == 0.0 || norm(&difference(&end, &best)) > 1e-6 * norm(&best) {
            return;
        }
        let incumbent = Incumbent { g: &best, value: found.value * (1.0 - 1e-9), near };
        let (back, early) = descend(&mut real, &off, variables, Some(incumbent), LIMITS);
        assert!(norm(&difference(&back, &best)) <= near && early.iterations <= alone.iterations);
        (steps, saved) = (steps + alone.iterations, saved + alone.iterations - early.iterations);
        descents += 1;
        let reflected: Vec<f64> = best.iter().map(|x| -x).collect();
        let incumbent = Incumbent { g: &reflected, ..incumbent };
        let (far, late) = descend(&mut real, &off, variables, Some(incumbent), LIMITS);
        assert!(late.iterations >= early.iterations && norm(&difference(&far, &best)) <= near);
    });
    assert!(descents > 50 && saved >= descents, "{saved} of {steps} steps in {descents} descents");
}

fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}
