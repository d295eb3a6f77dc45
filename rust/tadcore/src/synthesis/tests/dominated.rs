//! Where γ₁ dominates: Θ with heavier weights, and starts that fit GᵀRG to M.

use super::super::search::{Candidate, canonical, fits, variables};
use super::*;
use crate::cancel::CancelToken;
use crate::game::{Criterion, bank};
use crate::riccati;

/// Heavier weights are those of a problem that is made with them, bit by bit.
#[test]
fn heavier_weights_are_heavier_weights() {
    for interaction in [Interaction::I1, Interaction::I2] {
        let (sampled, p, _) = sample(interaction);
        let of = |factor: f64| {
            let mut gamma = vec![1.0, 0.0078125, 0.00390625, 0.005859375];
            gamma.truncate(interaction.terms());
            gamma[1..].iter_mut().for_each(|g| *g *= factor);
            let r = sampled.theta.double.r.clone();
            Problem::from_parts(interaction, r, gamma, &p, &CancelToken::new()).expect("memory")
        };
        let (found, expected) = (of(1.0).heavier(16.0).double, of(16.0).theta.double);
        assert_eq!(
            (&found.coupling, &found.gram, &found.closeness),
            (&expected.coupling, &expected.gram, &expected.closeness)
        );
        assert_eq!(found.quadratic, expected.quadratic);
        assert!((found.scale.value - expected.scale.value).abs() < 1e-14 * expected.scale.value);
        assert_eq!((found.scale.coupling, found.scale.closeness), (expected.scale.coupling, expected.scale.closeness));
    }
}

/// The problem of a game with five players whose sight is limited, and a candidate at its canonical start.
fn candidate(criterion: Criterion, seen: impl Fn(usize, usize) -> bool) -> (Problem, Candidate, Topology) {
    let game = bank::varied_game(Interaction::I2, 4, 0.3, 0.1).expect("a game");
    let equilibrium = riccati::solve(&game, &CancelToken::new()).expect("an equilibrium");
    let problem = Problem::new(&game, equilibrium.node(0), &CancelToken::new()).expect("memory").under(criterion);
    let topology = Topology::from_fn(problem.rows(), problem.size(), seen);
    let mut start = vec![0.0; problem.rows() * problem.size()];
    canonical(&problem, &topology, &mut start);
    let unknowns = variables(&topology, criterion).expect("memory");
    let mut candidate = Candidate::new(unknowns, start, problem.size, false).expect("memory");
    candidate.reached.value = 1e9;
    (problem, candidate, topology)
}

/// ‖GᵀRG − M‖ / ‖M‖.
fn left(problem: &Problem, g: &[f64]) -> f64 {
    let (n, of) = (problem.size(), &problem.theta.double);
    let mut x: Vec<f64> = of.target.iter().map(|m| -m).collect();
    for (row, r) in g.chunks_exact(n).zip(&of.r) {
        (0..n * n).for_each(|ab| x[ab] += r * row[ab / n] * row[ab % n]);
    }
    x.iter().map(|x| x * x).sum::<f64>().sqrt() / of.scale.target
}

/// M has as many eigenvectors as there are players: where everyone sees everyone it is fitted to twelve digits.
#[test]
fn who_sees_everyone_fits_m_exactly() {
    let (problem, mut candidate, _) = candidate(Criterion::Paper, |_, _| true);
    // Away from the equilibrium, which fits M too.
    candidate.g.fill(0.0);
    let found = fits(&problem, &candidate);
    assert!(!found.is_empty());
    for g in &found {
        assert!(left(&problem, g) < 1e-12, "{:e}", left(&problem, g));
    }
}

/// Rows use what their players see, and no single row, the others given, fits better; each with the sign of F. Some do
/// not see the attacker and know differences only; under the team criterion d1, who knows everything, plays its row of F,
/// and the others fit what that leaves.
#[test]
fn fits_are_admissible_and_cannot_be_improved_by_much_along_a_row() {
    for criterion in [Criterion::Paper, Criterion::Component] {
        let seen = |i: usize, j: usize| i == 0 || (i + 2 * j) % 3 != 2 && (i != j || i.is_multiple_of(2));
        let (problem, candidate, topology) = candidate(criterion, seen);
        let (m, n) = (problem.rows(), problem.size());
        assert!((0..m).any(|i| !topology.sees_attacker(i)) && topology.sees_all(0));
        let found = fits(&problem, &candidate);
        assert!(found.len() >= 2, "{}", found.len());
        let least = found.iter().map(|g| left(&problem, g)).fold(f64::INFINITY, f64::min);
        assert!(least < 0.9 * left(&problem, &candidate.initial), "{least}");
        let last = candidate.variables.iter().map(|v| v.own / n).max().expect("a player that chooses");
        for g in &found {
            if criterion == Criterion::Component {
                assert!(g[..n].iter().zip(problem.fne()).all(|(g, f)| (g - f).abs() <= 1e-15 * f.abs()));
            }
            for (i, row) in g.chunks_exact(n).enumerate() {
                let sum: f64 = row.iter().sum();
                assert!(topology.sees_attacker(i) || sum.abs() < 1e-12, "{i}: {sum}");
                assert!((0..n).all(|j| j == i || topology.sees(i, j) || row[j] == 0.0), "{i}");
                let along: f64 = row.iter().zip(&problem.fne()[i * n..]).map(|(g, f)| g * f).sum();
                // A row for which nothing is left but rounding has no sign.
                let nothing = row.iter().all(|g| g.abs() < 1e-7);
                assert!(along >= 0.0 || nothing, "{criterion:?} {i}: {along:e} {row:?}");
            }
            // The row fitted last is the best of all that its player may play.
            let there = left(&problem, g);
            for v in candidate.variables.iter().filter(|v| v.own / n == last) {
                for step in [1e-3, -1e-3] {
                    let mut other = g.clone();
                    other[v.entry] += step;
                    if v.relative {
                        other[v.own] -= step;
                    }
                    assert!(left(&problem, &other) >= there * (1.0 - 1e-12), "{}", v.entry);
                }
            }
        }
    }
}
