//! When a game counts as diverged.
//!
//! Under limited sight the closed loop can be unstable by itself: every step is exact, and the players part for ever,
//! by many orders of magnitude. The measure is the game's own: the largest distance from a player to the attacker over
//! the largest distance between any two players at the start. It does not change where all lengths are scaled, moved,
//! turned or reflected, and it reads only z, the state in which ensembles play.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | max ‖X_i(0) − X_j(0)‖² | [`scale`] | the start's own scale, squared |
//! | max ‖z_i‖² | [`reach`] | how far the players are from the attacker, squared |

use crate::game::validation::BEYOND;
use crate::network::{squared_distance, squared_norm};

/// A game diverges at the first grid instant at which somebody is further from the attacker than this many times the
/// largest distance at the start. In 3,941 random games nobody was caught any more beyond a factor of 10, and no
/// equilibrium in full sight went beyond 30 (docs/decisions/0012).
pub const DIVERGED: f64 = 1e3;

/// The least squared scale: the squares of smaller lengths lose digits.
pub(crate) const LEAST: f64 = 1e-290;

/// The largest squared distance between any two players at the state `z`, the attacker included.
#[must_use]
pub fn scale(z: &[f64], dim: usize) -> f64 {
    let mut most = reach(z, dim);
    for (i, a) in z.chunks_exact(dim).enumerate() {
        for b in z[(i + 1) * dim..].chunks_exact(dim) {
            most = most.max(squared_distance(a, b));
        }
    }
    most.max(LEAST)
}

/// The largest squared distance from a player to the attacker; no number where any of them is none.
#[must_use]
pub fn reach(z: &[f64], dim: usize) -> f64 {
    z.chunks_exact(dim).map(squared_norm).fold(0.0, |most, x| if x > most || x.is_nan() { x } else { most })
}

/// The squared distance beyond which a game that started on the squared scale `scale` has diverged.
#[must_use]
pub fn limit(scale: f64) -> f64 {
    DIVERGED * DIVERGED * scale
}

/// The squared distance beyond which a game cannot be played on: its costs would be no doubles any more.
pub const LAST: f64 = BEYOND * BEYOND;

/// Whether a squared distance is within a limit; what is no number is not.
#[must_use]
pub fn within(reach: f64, limit: f64) -> bool {
    reach <= limit
}

/// When a run diverged, and how far.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Divergence {
    /// The grid index of the first instant beyond [`DIVERGED`].
    pub step: usize,
    /// The largest distance to the attacker up to the end, over the largest distance between players at the start; where
    /// the game leaves the range of double precision, a lower bound.
    pub size: f64,
}

/// How far from the attacker the players of one run have been so far.
#[derive(Debug)]
pub(super) struct Excursion {
    scale: f64,
    /// The largest squared distance, [`LAST`] at most.
    most: f64,
    since: Option<usize>,
}

impl Excursion {
    /// Of a run that starts at the state `z`.
    pub(super) fn from_start(z: &[f64], dim: usize) -> Self {
        Self { scale: scale(z, dim), most: 0.0, since: None }
    }

    /// Notes the state at step k; whether the game can be played on from it.
    pub(super) fn note(&mut self, k: usize, z: &[f64], dim: usize) -> bool {
        let far = reach(z, dim);
        if self.since.is_none() && !within(far, limit(self.scale)) {
            self.since = Some(k);
        }
        let playable = within(far, LAST);
        self.most = self.most.max(if playable { far } else { LAST });
        playable
    }

    pub(super) fn has_diverged(&self) -> bool {
        self.since.is_some()
    }

    pub(super) fn divergence(&self) -> Option<Divergence> {
        self.since.map(|step| Divergence { step, size: (self.most / self.scale).sqrt() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scale_is_the_largest_distance_between_any_two() {
        // Two on opposite sides of the attacker: 3 + 4 apart, further than either from it.
        assert_eq!(scale(&[3.0, 0.0, -4.0, 0.0], 2), 49.0);
        assert_eq!(scale(&[3.0, 4.0, 3.0, 4.0], 2), 25.0);
        assert_eq!((reach(&[3.0, 0.0, -4.0, 0.0], 2), limit(49.0)), (16.0, 4.9e7));
    }

    #[test]
    fn what_is_no_number_is_beyond_every_limit() {
        for bad in [f64::NAN, f64::INFINITY] {
            for z in [[bad, 0.0, 1.0, 0.0], [1.0, 0.0, bad, 0.0], [1.0, bad, 2.0, 0.0]] {
                assert!(!within(reach(&z, 2), f64::MAX), "{z:?}");
            }
        }
        assert!(within(LAST, LAST) && !within(LAST.next_up(), LAST));
    }
}
