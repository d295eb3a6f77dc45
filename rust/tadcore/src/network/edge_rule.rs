//! A variant that is not the paper's game: edges with hysteresis and dwell time.
//!
//! In the paper an edge is there at t_k exactly when the distance is at most ζ_i (eq:limob). Under an [`EdgeRule`] the
//! first network is the paper's, and from then on
//!
//! - **hysteresis** h: an edge forms at a distance of at most ζ_i and breaks only beyond ζ_i + h;
//! - **dwell** D: an edge that changed at t_c keeps its state at every t_k < t_c + D, wherever the players are.
//!
//! Either bounds how often an edge can flip, so a network that chatters under the paper's rule does not under this one.
//! The network then depends on the past: only single recorded runs have the variant, ensembles do not.

use super::Topology;
use super::sight::{observe, squared_distance, squared_norm, squared_reach};
use crate::error::GameError;
use crate::game::validation::rule;

/// When an edge forms and breaks.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct EdgeRule {
    /// h, a length.
    pub hysteresis: f64,
    /// D, a time; rounded up to whole steps.
    pub dwell: f64,
}

/// How far from a whole number of steps rounding may leave D/δ.
const WHOLE: f64 = 1e-9;

impl EdgeRule {
    /// The paper's rule, eq:limob: neither.
    pub const PAPER: Self = Self { hysteresis: 0.0, dwell: 0.0 };

    /// Checks both numbers.
    ///
    /// # Errors
    /// [`GameError`] naming the one that is negative or not finite.
    pub fn check(&self) -> Result<(), GameError> {
        for (field, value) in [("hysteresis", self.hysteresis), ("dwell", self.dwell)] {
            rule(field, value, value >= 0.0 && value.is_finite(), "a finite number of at least 0")?;
        }
        Ok(())
    }
}

/// The past of the edges of one run.
#[derive(Debug)]
pub struct EdgeState {
    /// The squared distance up to which an edge of each constrained player is kept.
    keep: Vec<f64>,
    /// Steps for which a changed edge rests.
    dwell: usize,
    /// The step until which each edge rests, m × N.
    rests: Vec<usize>,
    next: Topology,
}

impl EdgeState {
    /// The state of a run that has not begun: visibility radii ζ, N and δ.
    #[must_use]
    pub fn new(rule: &EdgeRule, visibility: &[f64], size: usize, step: f64) -> Self {
        Self {
            keep: visibility.iter().map(|zeta| squared_reach(zeta + rule.hysteresis)).collect(),
            dwell: (rule.dwell / step - WHOLE).ceil().max(0.0) as usize,
            rests: vec![0; visibility.len() * size],
            next: Topology::empty(visibility.len(), size),
        }
    }

    /// Writes the network at step k of the state `z` into `topology`, which holds the one before; `reach` as for
    /// [`observe`].
    pub fn observe(&mut self, k: usize, z: &[f64], dim: usize, reach: &[f64], topology: &mut Topology) {
        if k == 0 {
            observe(z, dim, reach, topology);
            return;
        }
        self.next.clear();
        let size = topology.size();
        for (i, (&form, &keep)) in reach.iter().zip(&self.keep).enumerate() {
            let zi = &z[i * dim..(i + 1) * dim];
            for j in 0..size {
                let was = topology.sees(i, j);
                let rest = &mut self.rests[i * size + j];
                let d2 = if j == i { squared_norm(zi) } else { squared_distance(zi, &z[j * dim..(j + 1) * dim]) };
                let is = if k < *rest { was } else { d2 <= if was { keep } else { form } };
                if is != was {
                    *rest = k.saturating_add(self.dwell);
                }
                if is {
                    self.next.set(i, j);
                }
            }
        }
        std::mem::swap(&mut self.next, topology);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The edge of one player to the attacker at a sequence of distances, ζ = 1, δ = 0.1.
    fn edge(rule: EdgeRule, distances: &[f64]) -> Vec<bool> {
        let mut memory = EdgeState::new(&rule, &[1.0], 2, 0.1);
        let mut topology = Topology::empty(1, 2);
        let look = |(k, &d): (usize, &f64)| {
            memory.observe(k, &[d, 9.0], 1, &[squared_reach(1.0)], &mut topology);
            topology.sees_attacker(0)
        };
        distances.iter().enumerate().map(look).collect()
    }

    #[test]
    fn a_band_keeps_an_edge_and_does_not_make_one() {
        let rule = EdgeRule { hysteresis: 0.5, dwell: 0.0 };
        let seen = edge(rule, &[1.2, 1.0, 1.2, 1.5, 1.6, 1.4, 1.0]);
        assert_eq!(seen, [false, true, true, true, false, false, true]);
    }

    #[test]
    fn a_changed_edge_rests() {
        // Three steps of 0.1: changed at step 1, free again at step 4; changed there, free at step 7.
        let rule = EdgeRule { hysteresis: 0.0, dwell: 0.3 };
        let seen = edge(rule, &[2.0, 1.0, 2.0, 2.0, 2.0, 1.0, 1.0, 1.0]);
        assert_eq!(seen, [false, true, true, true, false, false, false, true]);
        // The first network is no change, and the paper's rule has no memory.
        assert_eq!(edge(rule, &[1.0, 2.0]), [true, false]);
        assert_eq!(edge(EdgeRule::PAPER, &[2.0, 1.0, 2.0, 1.0]), [false, true, false, true]);
    }

    #[test]
    fn bad_numbers_are_named() {
        for (hysteresis, dwell, field) in
            [(-0.1, 0.0, "hysteresis"), (0.0, f64::NAN, "dwell"), (f64::INFINITY, 0.0, "hysteresis")]
        {
            let found = EdgeRule { hysteresis, dwell }.check();
            assert!(matches!(found, Err(GameError::Value { field: named, .. }) if named == field));
        }
    }
}
