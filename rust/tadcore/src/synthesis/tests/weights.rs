//! The scale of γ, and γ without weight on S.

use super::*;

/// Networks of every density.
fn networks(problem: &Problem) -> Vec<Topology> {
    let (m, n) = (problem.rows(), problem.size());
    (0..1u64 << (m * n)).step_by(if m * n > 9 { 97 } else { 11 }).map(|key| Topology::from_key(m, n, key)).collect()
}

fn solved(problem: &Problem) -> Vec<Gains> {
    let mut all = Vec::new();
    Synthesizer::new()
        .solve_all(problem, &networks(problem), Options::default(), |_, gains| {
            all.push(gains);
            Ok(())
        })
        .expect("memory");
    all
}

fn with(interaction: Interaction, gamma: &[f64]) -> (Problem, Vec<f64>) {
    let (sampled, p, _) = sample(interaction);
    let problem = Problem::from_parts(interaction, sampled.theta.double.r, gamma.to_vec(), &p, &CancelToken::new());
    (problem.expect("memory"), p)
}

/// A power of two in γ is nowhere in the gains, down to where γ itself is subnormal.
#[test]
fn the_scale_of_gamma_changes_theta_alone() {
    for interaction in [Interaction::I1, Interaction::I2] {
        let gamma = [0.75, 0.25, 0.5, 0.375];
        let gamma = &gamma[..interaction.terms()];
        let expected = solved(&with(interaction, gamma).0);
        for exponent in [1, -1, -3, -52, -600, -1022, -1070] {
            let factor = 2f64.powi(exponent / 2) * 2f64.powi(exponent - exponent / 2);
            let scaled: Vec<f64> = gamma.iter().map(|g| g * factor).collect();
            for (found, of_one) in solved(&with(interaction, &scaled).0).into_iter().zip(&expected) {
                let theta = of_one.theta * factor;
                assert_eq!(found, Gains { theta, ..of_one.clone() }, "{interaction:?} 2^{exponent}");
            }
        }
    }
}

/// Weights on everything but S, or but a part of it.
fn without() -> Vec<(Interaction, Vec<f64>, Vec<usize>)> {
    let all = |m: usize| (0..m).collect::<Vec<_>>();
    vec![
        (Interaction::I1, vec![1.0, 0.0, 0.0, 0.0], all(3)),
        (Interaction::I1, vec![0.5, 0.25, 0.5, 0.0], Vec::new()),
        (Interaction::I2, vec![0.5, 0.0, 0.25], vec![0, 1]),
        (Interaction::I2, vec![0.5, 0.25, 0.0], vec![2]),
        (Interaction::I2, vec![1.0, 0.0, 0.0], all(3)),
    ]
}

/// Theorem consistency, also where Θ alone would leave a choice.
#[test]
fn everyone_seen_is_the_equilibrium_without_weight_on_s() {
    for (interaction, gamma, _) in without() {
        let (problem, _) = with(interaction, &gamma);
        let complete = Topology::complete(problem.rows(), problem.size());
        let found = Synthesizer::new().solve(&problem, &complete, Options::default()).expect("memory");
        assert!(found.certified && found.theta < 1e-24, "{gamma:?}");
        for (g, f) in found.rows.iter().zip(problem.fne()) {
            assert!((g - f).abs() < 1e-12, "{gamma:?}");
        }
    }
}

/// Of the minima that differ by signs, the nearest to the equilibrium; stationary for γ as given; and where a small
/// weight leads, for half that weight half as far away.
#[test]
fn without_weight_on_s_the_gains_are_the_limit_of_a_small_weight() {
    for (interaction, gamma, even) in without() {
        let (problem, p) = with(interaction, &gamma);
        let n = problem.size();
        let gains = solved(&problem);
        let at = |small: f64| {
            let last = if interaction == Interaction::I1 { 3 } else { 1 };
            let gamma: Vec<f64> =
                gamma.iter().enumerate().map(|(i, &g)| if i >= last && g == 0.0 { small } else { g }).collect();
            solved(&with(interaction, &gamma).0)
        };
        let (one, half) = (at(2f64.powi(-12)), at(2f64.powi(-13)));
        let (mut near, mut all) = (0, 0);
        for (k, found) in gains.iter().enumerate() {
            assert_eq!(found.status, Status::Converged, "{gamma:?} {k}");
            let theta = problem.weigh(&problem.terms(&p, &found.rows, &CancelToken::new()).expect("memory"));
            assert!((theta - found.theta).abs() <= 1e-12 * problem.in_scale_of_gamma(problem.theta.double.scale.value));
            for &i in &even {
                let rows = i * n..(i + 1) * n;
                let along: f64 = found.rows[rows.clone()].iter().zip(&problem.fne()[rows]).map(|(g, f)| g * f).sum();
                assert!(along >= -1e-12, "{gamma:?} {k} {i}: {along}");
            }
            let distance = |other: &Gains| -> f64 {
                found.rows.iter().zip(&other.rows).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
            };
            let (far, closer) = (distance(&one[k]), distance(&half[k]));
            all += 1;
            near += usize::from(far < 1e-9 || (closer < 0.1 && closer < 0.6 * far));
        }
        // A finite weight may prefer another basin, or lie in a valley whose floor it moves far.
        assert!(near * 100 >= 95 * all, "{gamma:?}: {near} of {all}");
    }
}
