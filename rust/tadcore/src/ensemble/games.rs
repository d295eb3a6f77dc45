//! Many games, each played once: trials whose weights, horizon or step differ, and which therefore share no table.
//!
//! Every trial has its Riccati equations solved and its own gains synthesised as it meets networks; its outcome is
//! bitwise that of [`super::run`] with the same game. A game without an equilibrium on [0, T] is not played, and that is
//! its outcome.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | T*, P(T − t) for t < T* | [`GameEnd::NoEquilibrium`] | how far back from T the Riccati solution reaches |

use rayon::prelude::*;

use super::chunk::{Chunk, Worker};
use super::{Answers, Batch, Between, End, threads_for};
use crate::cancel::CancelToken;
use crate::error::{EquilibriumError, RunError};
use crate::game::Game;
use crate::policy::Policy;
use crate::simd::Width;

/// Bytes of the table of one game, which is gone with its trial.
const TABLE_BYTES: usize = 64 << 20;

/// How a trial with a game of its own ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum GameEnd {
    /// As any other trial.
    Played {
        /// How it ended.
        end: End,
        /// When.
        time: f64,
    },
    /// The game has no equilibrium, so nobody knows how to play it.
    NoEquilibrium {
        /// How far back from the horizon the Riccati solution reaches.
        escape_time: f64,
    },
}

/// Plays row i of `batch` as game i; how each ended, in order.
///
/// # Errors
/// [`RunError`] for the first row that breaks a rule of its game, before anything is played; when the Riccati equations
/// of a game can be neither solved nor shown to escape; or when the caller cancelled.
///
/// # Panics
/// When there is not one game for each row (a programming error).
pub fn run_games(
    games: &[Game],
    batch: &Batch,
    between: Between,
    threads: Option<usize>,
    cancel: &CancelToken,
) -> Result<Vec<GameEnd>, RunError> {
    for (i, game) in games.iter().enumerate() {
        batch.setup(i, game.n(), game.constrained()).check(game)?;
    }
    let threads = threads_for(threads, games.len())?;
    let one = |(i, game): (usize, &Game)| play(game, batch, i, between, cancel);
    if threads == 1 {
        return games.iter().enumerate().map(one).collect();
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(|_| RunError::Threads(threads))?;
    pool.install(|| games.par_iter().enumerate().with_max_len(1).map(one).collect())
}

/// One trial.
fn play(game: &Game, batch: &Batch, i: usize, between: Between, cancel: &CancelToken) -> Result<GameEnd, RunError> {
    let setup = batch.setup(i, game.n(), game.constrained());
    let row =
        Batch { dim: batch.dim, positions: setup.positions, visibility: setup.visibility, capture: setup.capture };
    let policy = match Policy::for_one(game.clone(), TABLE_BYTES, cancel) {
        Ok(policy) => policy,
        Err(EquilibriumError::FiniteEscape { escape_time, .. }) => return Ok(GameEnd::NoEquilibrium { escape_time }),
        Err(error) => return Err(error.into()),
    };
    let mut ends = [End::NOT_PLAYED];
    let mut chunk = Chunk::new(&policy, &row, None, 0, 1, Width::in_use())?;
    chunk.play(
        between,
        Answers { ends: &mut ends, scores: &mut [], course: None },
        &mut Worker::new(&policy),
        cancel,
    )?;
    let [end] = ends;
    Ok(GameEnd::Played { end, time: game.grid().time_after(end.step, end.after) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::game::{Grid, Interaction, bank};
    use crate::policy::DEFAULT_TABLE_BYTES;

    /// A duel of I2 that escapes somewhere between the horizons 2 and 4.
    fn duel(horizon: f64) -> Game {
        let unit = bank::unit_game(Interaction::I2, vec![1.0], 1.0, 0.8, 1.0, 1.0, 0.05).expect("a valid game");
        let mut weights = unit.weights().clone();
        (weights.q_atau, weights.f_atau) = (0.01, 0.01);
        Game::new(Interaction::I2, weights, Grid::new(horizon, 0.05).expect("a grid")).expect("a valid game")
    }

    /// Every row ends as in a batch of its own game, on any number of threads; a game without an equilibrium says so.
    #[test]
    fn every_row_is_played_as_its_own_game() {
        let cancel = CancelToken::new();
        let games: Vec<Game> = [1.0, 4.0, 2.0, 0.5, 4.0, 1.5].map(duel).into();
        let positions: Vec<f64> = (0..games.len() * 6).map(|i| 2.0 * (1.7 * i as f64).sin()).collect();
        let batch = Batch { dim: 2, positions: &positions, visibility: &[1.5, 1.5], capture: &[0.1, 0.1] };
        let one = run_games(&games, &batch, Between::NOTHING, Some(1), &cancel).expect("played");
        let three = run_games(&games, &batch, Between::NOTHING, Some(3), &cancel).expect("played");
        assert_eq!(one, three);
        for (i, (game, found)) in games.iter().zip(&one).enumerate() {
            let row = Batch { positions: &positions[i * 6..(i + 1) * 6], ..batch };
            match Policy::new(game.clone(), DEFAULT_TABLE_BYTES, &cancel) {
                Ok(policy) => {
                    let end = super::super::run(&policy, &row, Some(1), &cancel).expect("played")[0];
                    assert_eq!(*found, GameEnd::Played { end, time: game.grid().time_after(end.step, end.after) });
                }
                Err(EquilibriumError::FiniteEscape { escape_time, .. }) => {
                    assert_eq!(*found, GameEnd::NoEquilibrium { escape_time });
                }
                Err(error) => assert_eq!(error.to_string(), "an equilibrium, or its escape"),
            }
        }
        assert!(one.iter().any(|end| matches!(end, GameEnd::NoEquilibrium { .. })), "{one:?}");
        cancel.cancel();
        assert!(run_games(&games, &batch, Between::NOTHING, Some(2), &cancel).is_err());
    }
}
