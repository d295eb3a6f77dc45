//! Whether weights that lie far apart determine P in double precision.
//!
//! The coupled equations of I1 may amplify what rounding does: in a layer near the horizon that is thinner than a step of
//! the grid, some solutions grow by a factor that no number of digits survives. Every step keeps its tolerance there and
//! every node but one satisfies the equations to ten digits, so no residual says it; a second solution does. The weights
//! are changed by a 10⁻¹²th, about the local error of the integrator, and the two solutions are compared.
//!
//! It is asked only where weights lie further apart than [`APART`]. Of 900 random games (n = 1 … 6, T = 3 … 1,000) whose
//! weights lie within three decades none changed by more than 5 · 10⁻⁹.
//!
//! Source: ours, by measurement.

use crate::error::EquilibriumError;
use crate::game::Game;
use crate::memory::zeros;

/// Ratio of the largest to the least of the control weights, or of the weights on states, from which it is asked.
const APART: f64 = 1e3;
/// How much the weights are changed.
const NUDGE: f64 = 1e-12;
/// How much P may change, relative to the norm of each of its matrices, or an escape time relative to itself: five digits
/// are certain. (A millionth before a pole P changes by 3 · 10⁻⁶, rightly.)
const MOST: f64 = 1e-5;

/// What `solve` finds, if it is determined.
///
/// # Errors
/// What `solve` says, and [`EquilibriumError::Undetermined`].
pub(super) fn determined(
    game: &Game,
    nodes: &mut [f64],
    mut solve: impl FnMut(&Game, &mut [f64]) -> Result<usize, EquilibriumError>,
) -> Result<usize, EquilibriumError> {
    use EquilibriumError::{Cancelled, FiniteEscape, Memory};
    let found = solve(game, nodes);
    if !matches!(found, Ok(_) | Err(FiniteEscape { .. })) || !apart(game) {
        return found;
    }
    let mut others = zeros("a second solution of the Riccati equations", nodes.len())?;
    let change = match (&found, solve(&game.nudged(NUDGE), &mut others)) {
        (_, Err(stopped @ (Cancelled(_) | Memory(_)))) => return Err(stopped),
        (Ok(_), Ok(_)) => largest_change(nodes, &others, game.size()),
        (Err(FiniteEscape { escape_time: a, .. }), Err(FiniteEscape { escape_time: b, .. })) => (a - b).abs() / a,
        _ => f64::INFINITY,
    };
    if change <= MOST { found } else { Err(EquilibriumError::Undetermined { change, nudge: NUDGE }) }
}

/// Whether the weights lie so far apart.
fn apart(game: &Game) -> bool {
    let w = game.weights();
    let ratio = |values: &mut dyn Iterator<Item = f64>| {
        let (low, high) = values.fold((f64::INFINITY, 0.0), |(low, high): (f64, f64), x| (low.min(x), high.max(x)));
        high / low
    };
    let states = [false, true].map(|terminal| game.state_weights(terminal)).into_iter().flatten().flatten();
    ratio(&mut w.r_d.iter().copied().chain([w.r_tau, w.r_a])) > APART
        || ratio(&mut states.map(f64::abs).filter(|&x| x > 0.0)) > APART
}

/// The largest change of a matrix relative to its norm.
fn largest_change(nodes: &[f64], others: &[f64], n: usize) -> f64 {
    let mut worst = 0.0_f64;
    for (p, other) in nodes.chunks_exact(n * n).zip(others.chunks_exact(n * n)) {
        // Scaled, as the squares of entries need not be in range.
        let size = p.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        let (mut change, mut all) = (0.0, 0.0);
        for (x, y) in p.iter().zip(other) {
            change += ((x - y) / size).powi(2);
            all += (x / size).powi(2);
        }
        if size > 0.0 {
            worst = worst.max((change / all).sqrt());
        }
    }
    worst
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cancel::CancelToken;
    use crate::game::{Grid, Interaction, bank};
    use crate::riccati;

    fn game(r_a: f64, horizon: f64) -> Game {
        let base = bank::varied_game(Interaction::I1, 3, 3.0, 0.1).expect("a game");
        let mut weights = base.weights().clone();
        weights.r_a = r_a;
        Game::new(Interaction::I1, weights, Grid::new(horizon, horizon / 100.0).expect("a grid")).expect("a game")
    }

    /// A change of one in a matrix of size four is a quarter; a matrix of zeros changes by nothing.
    #[test]
    fn changes_are_relative_to_each_matrix() {
        let (p, other) = ([4e200, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], [4e200, 0.0, 0.0, 1e200, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(largest_change(&p, &other, 2), 0.25);
    }

    /// A layer that amplifies rounding beyond all digits is refused by name; ordinary weights are solved once.
    #[test]
    fn an_undetermined_solution_is_refused() {
        let cancel = CancelToken::new();
        let found = riccati::solve(&game(1e-12, 1e-6), &cancel);
        assert!(matches!(found, Err(EquilibriumError::Undetermined { change, .. }) if change > 1e-3), "{found:?}");
        assert!(riccati::solve(&game(1e-3, 1e-3), &cancel).is_ok());
        let mut times = 0;
        let mut count = |game: &Game, nodes: &mut [f64]| {
            times += 1;
            riccati::coupled::solve(game, &cancel, nodes)
        };
        let mut nodes = vec![0.0; 101 * 3 * 16];
        determined(&game(1.0, 3.0), &mut nodes, &mut count).expect("an equilibrium");
        determined(&game(1e-4, 1e-3), &mut nodes, &mut count).expect("an equilibrium");
        assert_eq!(times, 3);
    }
}
