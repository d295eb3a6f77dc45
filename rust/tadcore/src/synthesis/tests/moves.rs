//! Restarts from the best point: what they use, and the Θ that decides whether they are made.

use super::super::search::{Candidate, Moves, canonical, variables};
use super::*;
use crate::cancel::CancelToken;
use crate::game::{Criterion, bank};
use crate::riccati;

/// Θ of changed rows by its terms, and no start that uses what its player does not see.
#[test]
fn starts_are_admissible_and_their_theta_is_that_of_its_terms() {
    for interaction in [Interaction::I1, Interaction::I2] {
        let game = bank::varied_game(interaction, 4, 0.3, 0.1).expect("a game");
        let (equilibrium, cancel) =
            (riccati::solve(&game, &CancelToken::new()).expect("an equilibrium"), CancelToken::new());
        let p = equilibrium.node(0);
        let problem = Problem::new(&game, p, &cancel).expect("memory");
        let (m, n) = (problem.rows(), problem.size());
        let topology = Topology::from_fn(m, n, |i, j| (3 * i + 2 * j + i * j) % 4 != 1);
        let mut start = vec![0.0; m * n];
        canonical(&problem, &topology, &mut start);
        let mut candidate =
            Candidate::new(variables(&topology, Criterion::Paper).expect("memory"), start, problem.size, false)
                .expect("memory");
        let theta = |g: &[f64]| problem.weigh(&problem.terms(p, g, &cancel).expect("memory"));
        candidate.reached.value = 1e9;
        let moves = Moves::new(&problem, &candidate);
        let mut count = 0;
        moves
            .list(|g| {
                count += 1;
                for (i, row) in g.chunks_exact(n).enumerate() {
                    let sum: f64 = row.iter().sum();
                    assert!(topology.sees_attacker(i) || sum.abs() < 1e-13, "{i}: {sum}");
                    for (j, &x) in row.iter().enumerate() {
                        assert!(j == i || topology.sees(i, j) || x == 0.0, "{i} {j}");
                    }
                }
                Ok(())
            })
            .expect("memory");
        assert!(count > 40, "{count}");
        let row: Vec<f64> = (0..n).map(|a| (1.0 + a as f64).sin()).collect();
        let change = [(0, &row[..], -0.5), (2, moves.row(1), 1.0)];
        let mut g = candidate.g.clone();
        for (i, row, factor) in change {
            (0..n).for_each(|a| g[i * n + a] = factor * row[a] / moves.root[i]);
        }
        let found = problem.in_scale_of_gamma(moves.theta(&change, f64::INFINITY, &mut Vec::new()));
        assert!((found - theta(&g)).abs() < 1e-12 * theta(&g), "{found} {}", theta(&g));
    }
}
