//! How a game ends.
//!
//! At every grid instant, in this order: the nearest defender within its own capture radius intercepts the attacker;
//! otherwise the attacker captures the target when it is within σ_a; at t = T the game times out.

use crate::network::{squared_norm, squared_reach};

/// How a game ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Outcome {
    /// Nobody was caught up to T.
    Timeout,
    /// The attacker captured the target.
    Captured,
    /// This defender (0-based) intercepted the attacker.
    Intercepted(usize),
}

impl Outcome {
    /// The code used in arrays: timeout 0, captured 1, intercepted 2.
    #[must_use]
    pub fn code(self) -> i8 {
        match self {
            Self::Timeout => 0,
            Self::Captured => 1,
            Self::Intercepted(_) => 2,
        }
    }

    /// The defender that intercepted, −1 where none did.
    #[must_use]
    pub fn defender(self) -> i32 {
        match self {
            Self::Intercepted(i) => i32::try_from(i).unwrap_or(i32::MAX),
            _ => -1,
        }
    }
}

/// Capture radii in the form the test needs.
#[derive(Debug, Clone, PartialEq)]
pub struct Reach {
    defenders: Vec<f64>,
    attacker: f64,
}

impl Reach {
    /// From σ_{d_1}…σ_{d_n}, σ_a.
    #[must_use]
    pub fn new(capture: &[f64]) -> Self {
        let squares: Vec<f64> = capture.iter().map(|&radius| squared_reach(radius)).collect();
        let (attacker, defenders) = squares.split_last().map_or((0.0, &[][..]), |(a, d)| (*a, d));
        Self { defenders: defenders.to_vec(), attacker }
    }

    /// The largest squared distance of row i within its radius.
    pub(crate) fn squared(&self, i: usize) -> f64 {
        self.defenders.get(i).copied().unwrap_or(self.attacker)
    }

    /// The row of z whose radius decides an outcome.
    pub(crate) fn row(&self, outcome: Outcome) -> usize {
        if let Outcome::Intercepted(i) = outcome { i } else { self.defenders.len() }
    }

    /// The capture or interception at the state `z` (N rows of `dim`), if there is one.
    #[must_use]
    pub fn ends(&self, z: &[f64], dim: usize) -> Option<Outcome> {
        let mut nearest = (f64::INFINITY, None);
        for (i, (zi, &reach)) in z.chunks_exact(dim).zip(&self.defenders).enumerate() {
            let d2 = squared_norm(zi);
            if d2 <= reach && d2 < nearest.0 {
                nearest = (d2, Some(i));
            }
        }
        if let Some(i) = nearest.1 {
            return Some(Outcome::Intercepted(i));
        }
        let target = &z[self.defenders.len() * dim..];
        (squared_norm(target) <= self.attacker).then_some(Outcome::Captured)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_defender_in_its_own_reach_comes_first() {
        let reach = Reach::new(&[0.5, 1.0, 0.1, 9.0]);
        // d₁ is out of its reach, d₂ in its reach, d₃ nearer but out of its own; the target is within σ_a too.
        assert_eq!(reach.ends(&[0.6, 0.0, 0.9, 0.0, 0.2, 0.0, 1.0, 0.0], 2), Some(Outcome::Intercepted(1)));
        assert_eq!(reach.ends(&[0.4, 0.0, 0.9, 0.0, 0.2, 0.0, 1.0, 0.0], 2), Some(Outcome::Intercepted(0)));
        assert_eq!(reach.ends(&[0.6, 0.0, 1.1, 0.0, 0.2, 0.0, 1.0, 0.0], 2), Some(Outcome::Captured));
        assert_eq!(reach.ends(&[0.6, 0.0, 1.1, 0.0, 0.2, 0.0, 9.1, 0.0], 2), None);
        // A radius met exactly counts; of two equally near the first wins.
        assert_eq!(reach.ends(&[0.3, 0.4, 0.0, 0.5, 1.0, 0.0, 9.1, 0.0], 2), Some(Outcome::Intercepted(0)));
    }

    /// 15 is a radius whose square is the largest number that roots to it: the rim itself decides.
    #[test]
    fn rims_belong_to_the_balls() {
        assert_eq!(squared_reach(15.0), 225.0);
        let (on, off) = (Reach::new(&[15.0, 15.0]), Reach::new(&[15.0_f64.next_down(), 15.0_f64.next_down()]));
        let (caught, captured) = ([9.0, 12.0, 20.0, 0.0], [20.0, 0.0, 12.0, -9.0]);
        assert_eq!(on.ends(&caught, 2), Some(Outcome::Intercepted(0)));
        assert_eq!(on.ends(&captured, 2), Some(Outcome::Captured));
        assert_eq!((off.ends(&caught, 2), off.ends(&captured, 2)), (None, None));
    }
}
