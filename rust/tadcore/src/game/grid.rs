//! The one definition of the time grid: t_k is the double nearest to k T / K, k = 0…K.

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

    /// t_k + s for an s within a step: never beyond t_{k+1}.
    #[must_use]
    pub fn time_after(&self, k: usize, s: f64) -> f64 {
        if s > 0.0 { (self.time(k) + s).min(self.time(k + 1)) } else { self.time(k) }
    }

    /// t_k, the double nearest to k T / K: t_0 = 0 and t_K = T exactly.
    ///
    /// The rounded product k T over K would be rounded twice, and miss T itself by a digit for one grid in 17.
    #[must_use]
    pub fn time(&self, k: usize) -> f64 {
        if k >= self.steps {
            return self.horizon;
        }
        // Powers of two keep the product and what it loses within the range of doubles.
        let scale = match self.horizon {
            ..1e-200 => 2.0_f64.powi(200),
            1e200.. => 2.0_f64.powi(-200),
            _ => 1.0,
        };
        let (k, steps, horizon) = (k as f64, self.steps as f64, self.horizon * scale);
        let product = k * horizon;
        let quotient = product / steps;
        // What both roundings lost, exactly; K < 2³⁰, so that the sum cannot come to lie on the wrong side of a tie.
        let lost = k.mul_add(horizon, -product) - quotient.mul_add(steps, -product);
        (quotient + lost / steps) / scale
    }
}
