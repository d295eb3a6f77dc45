//! Reference games shared by tests, benches and examples, each with its source.

use super::{Game, Grid, Interaction, Weights};
use crate::error::GameError;

/// Where the players of a reference game start, and how far they see and reach.
#[derive(Debug, Clone, PartialEq)]
pub struct Setup {
    /// Positions, d₁…d_n, target, attacker, one row of axes each.
    pub positions: Vec<Vec<f64>>,
    /// ζ of the constrained players.
    pub visibility: Vec<f64>,
    /// σ_{d_1}…σ_{d_n}, σ_a.
    pub capture: Vec<f64>,
}

/// Unit weights everywhere but the control weights: the paper's choice (section VI), for any number of defenders.
///
/// # Errors
/// [`GameError`] for a grid or a weight that breaks its rule.
pub fn unit_game(
    interaction: Interaction,
    r_d: Vec<f64>,
    r_tau: f64,
    r_a: f64,
    lambda: f64,
    horizon: f64,
    step: f64,
) -> Result<Game, GameError> {
    let n = r_d.len();
    let own = if interaction == Interaction::I1 { vec![1.0; n] } else { Vec::new() };
    let terms = interaction.terms();
    Game::new(
        interaction,
        Weights {
            r_d,
            r_tau,
            r_a,
            q_da: own.clone(),
            f_da: own,
            q_ad: vec![1.0; n],
            f_ad: vec![1.0; n],
            q_atau: 1.0,
            f_atau: 1.0,
            q_taua: 1.0,
            f_taua: 1.0,
            lambda,
            gamma: vec![1.0 / terms as f64; terms],
        },
        Grid::new(horizon, step)?,
    )
}

/// The game of the paper's section VI (both interactions): n = 3, r = (1, 1, 1 | 1.2 | 0.8), T = 6, δ = 0.005.
///
/// # Errors
/// Never for λ in [0, 1].
pub fn paper_game(interaction: Interaction, lambda: f64) -> Result<Game, GameError> {
    unit_game(interaction, vec![1.0; 3], 1.2, 0.8, lambda, 6.0, 0.005)
}

/// Where the players of the paper's I1 runs start, with ζ = (5, 2.25, 1.25) and σ = 0.1.
#[must_use]
pub fn paper_i1_limited() -> Setup {
    Setup {
        positions: vec![vec![0.0, 0.0], vec![1.0, 1.5], vec![-1.0, 0.0], vec![0.0, 1.0], vec![-2.0, 2.0]],
        visibility: vec![5.0, 2.25, 1.25],
        capture: vec![0.1; 4],
    }
}

/// Where the players of the paper's I2 runs start, with ζ = (5, 3, 0.3), ζ_τ = 2.5 and σ = 0.1.
#[must_use]
pub fn paper_i2_limited() -> Setup {
    Setup {
        positions: vec![vec![-1.0, 0.0], vec![-3.0, 1.0], vec![1.0, 2.5], vec![0.5, 1.0], vec![-2.75, 2.5]],
        visibility: vec![5.0, 3.0, 0.3, 2.5],
        capture: vec![0.1; 4],
    }
}

/// A family of games of any size with varied weights, for benches and tests: r_{d_i} = 0.8 + 0.4 (i mod 3), r_τ = 1.2,
/// r_a = 0.8, λ = 1, unit weights otherwise (ours).
///
/// # Errors
/// [`GameError`] for a grid that breaks its rule.
pub fn varied_game(interaction: Interaction, n: usize, horizon: f64, step: f64) -> Result<Game, GameError> {
    let r_d = (0..n).map(|i| 0.8 + 0.4 * (i % 3) as f64).collect();
    unit_game(interaction, r_d, 1.2, 0.8, 1.0, horizon, step)
}
