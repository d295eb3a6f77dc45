//! Screening in single precision: what it prunes must be nothing, and what it cannot decide is decided in double.

use super::super::newton::{Incumbent, Owner, Workspace, balance, minimise};
use super::super::search::variables;
use super::descents::{BACKEND, LIMITS, descend, each};
use super::*;
use crate::game::Criterion;
use crate::simd::norm;

/// Whether single precision prunes a descent from `start` beside an incumbent, and in how many steps it ends.
fn screen(
    problem: &Problem,
    variables: &[Variable],
    start: &[f64],
    incumbent: Incumbent,
    iterations: usize,
) -> (bool, usize) {
    let coefficients = problem.theta.single().expect("a problem in range");
    let mut tasks = Tasks::default();
    tasks.clear(start.len(), 1);
    tasks.add(0, false, 0.0).expect("memory").copy_from_slice(start);
    let owners = [Owner { variables, incumbent: Some(incumbent) }];
    let limits = Limits { iterations, tolerance: 1e-6, ..LIMITS };
    minimise(
        &mut RealGains::<f32, 0>::new(coefficients, None).expect("memory"),
        &mut tasks,
        &owners,
        limits,
        BACKEND,
        &mut Workspace::default(),
    )
    .expect("memory");
    (tasks.pruned(0), tasks.reached(0).iterations)
}

/// Of a descent that ends below its incumbent, by however little, nothing is pruned; nor of one that comes back to it,
/// which ends there early, since rounding hides which is lower. Far above its incumbent every one is pruned, and many
/// are a little above it.
#[test]
fn only_what_cannot_win_is_pruned() {
    let (mut count, mut saved, mut little) = (0, 0, 0);
    each(|problem, variables, g| {
        let (end, reached) = descend(
            &mut RealGains::<f64, 0>::new(&problem.theta.double, None).expect("memory"),
            g,
            variables,
            None,
            LIMITS,
        );
        let far: Vec<f64> = end.iter().map(|x| 3.0 * x + 1.0).collect();
        let beside = |lower: f64| {
            let incumbent = Incumbent { g: &far, value: reached.value * (1.0 - lower), near: 1e-3 };
            screen(problem, variables, g, incumbent, 2_000)
        };
        for higher in [1e-9, 1e-6, 1e-3, 0.1] {
            assert!(!beside(-higher).0, "{higher}");
        }
        let below = Incumbent { g: &far, value: -1.0, near: 1e-3 };
        assert!(screen(problem, variables, g, below, 2_000).0);
        // Nothing is known of a descent that only its limit stopped.
        assert!(reached.iterations < 4 || !screen(problem, variables, g, below, 1).0);
        let incumbent = Incumbent { g: &end, value: reached.value * (1.0 - 1e-9), near: 1e-3 * norm(&end) };
        let (pruned, steps) = screen(problem, variables, g, incumbent, 2_000);
        assert!(!pruned);
        saved += beside(-0.1).1.saturating_sub(steps);
        little += usize::from(beside(3e-3).0);
        count += usize::from(reached.iterations > 3);
    });
    assert!(count > 100 && saved > count / 2 && little > count / 3, "{count} {saved} {little}");
}

/// All weights s times as large leave the gains as they are and make Θ s² times as large. Where Θ leaves the range of
/// single precision everything is done in double: the same minima.
#[test]
fn out_of_range_everything_is_done_in_double() {
    for interaction in [Interaction::I1, Interaction::I2] {
        let (problem, p, _) = sample(interaction);
        assert!(problem.theta.single().is_some());
        let (m, n) = (problem.rows(), problem.size());
        let topologies: Vec<Topology> = (0..1u64 << (m * n))
            .step_by(if m * n > 9 { 29 } else { 3 })
            .map(|key| Topology::from_key(m, n, key))
            .collect();
        let solve = |problem: &Problem| {
            let mut all = Vec::new();
            let each = |_, gains| {
                all.push(gains);
                Ok(())
            };
            Synthesizer::new().solve_all(problem, &topologies, Options::default(), each).expect("memory");
            all
        };
        let within = solve(&problem);
        // Powers of two, so that no bit but those of the exponents changes.
        for scale in [2.0_f64.powi(40), 2.0_f64.powi(-40)] {
            let r = problem.theta.double.r.iter().map(|r| r * scale).collect();
            let p: Vec<f64> = p.iter().map(|p| p * scale).collect();
            let scaled =
                Problem::from_parts(interaction, r, problem.gamma.clone(), &p, &CancelToken::new()).expect("memory");
            assert!(scaled.theta.single().is_none());
            for ((gains, expected), topology) in solve(&scaled).iter().zip(&within).zip(&topologies) {
                let theta = gains.theta / (scale * scale);
                assert!((theta - expected.theta).abs() <= 1e-12 * (1.0 + expected.theta), "{topology:?}");
                assert_eq!(gains.certified, expected.certified, "{topology:?}");
            }
        }
    }
}

/// Rows that know differences only sum to zero, those that see the attacker are left alone.
#[test]
fn rows_are_balanced() {
    let topology = Topology::from_words(2, 3, &[0b010_110]);
    let mut g = vec![9.0, 2.0, 3.0, 4.0, 5.0, 6.0];
    balance(&mut g, &variables(&topology, Criterion::Paper).expect("memory"));
    assert_eq!(g, [-5.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
}
