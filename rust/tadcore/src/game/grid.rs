//! The one definition of the time grid: t_k = k T / K, k = 0…K.

use crate::error::GameError;

/// How far T / δ may lie from a whole number, relative to it.
const DIVISION_TOLERANCE: f64 = 1e-9;

/// The sampling grid of a game.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    horizon: f64,
    steps: usize,
}

impl Grid {
    /// The grid with step δ on [0, T].
    ///
    /// # Errors
    /// [`GameError::Grid`] when δ does not divide T; [`GameError::Value`] when either is not a positive number.
    pub fn new(horizon: f64, step: f64) -> Result<Self, GameError> {
        super::validation::positive("horizon", horizon)?;
        super::validation::positive("step", step)?;
        let ratio = horizon / step;
        let steps = ratio.round();
        if !(1.0..=1e9).contains(&steps) || (ratio - steps).abs() > DIVISION_TOLERANCE * steps {
            return Err(GameError::Grid { horizon, step });
        }
        Ok(Self { horizon, steps: steps as usize })
    }

    /// T.
    #[must_use]
    pub fn horizon(&self) -> f64 {
        self.horizon
    }

    /// K, the number of steps; there are K + 1 nodes.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// δ.
    #[must_use]
    pub fn step(&self) -> f64 {
        self.horizon / self.steps as f64
    }

    /// t_k, rounded once, so that t_K is T to the bit.
    #[must_use]
    pub fn time(&self, k: usize) -> f64 {
        k as f64 * self.horizon / self.steps as f64
    }
}
