//! What one run adds to a game: positions and radii, checked before anything runs.

use super::state::relative_state;
use crate::error::GameError;
use crate::game::Game;
use crate::game::validation::{FARTHEST, FINEST, is_positive, positive, rule};
use crate::network::{Topology, observe, squared_reach};

/// Positions and radii of one run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setup<'a> {
    /// Axes, 2 or 3 (any positive number works).
    pub dim: usize,
    /// Positions, (n + 2) × dim: d₁…d_n, target, attacker.
    pub positions: &'a [f64],
    /// ζ of the constrained players (m); may be infinite.
    pub visibility: &'a [f64],
    /// σ_{d_1}…σ_{d_n}, σ_a.
    pub capture: &'a [f64],
}

impl Setup<'_> {
    /// Checks every number against its rule.
    ///
    /// # Errors
    /// [`GameError`] naming the first that breaks it.
    pub fn check(&self, game: &Game) -> Result<(), GameError> {
        let n = game.n();
        rule("dim", self.dim as f64, self.dim >= 1, "at least one axis")?;
        let lengths: [(&'static str, usize, usize); 3] = [
            ("positions", self.positions.len(), (n + 2) * self.dim),
            ("visibility_radii", self.visibility.len(), game.constrained()),
            ("capture_radii", self.capture.len(), n + 1),
        ];
        for (field, found, expected) in lengths {
            if found != expected {
                return Err(GameError::Length { field, found, expected });
            }
        }
        // A name is put together only for a number that breaks its rule: this runs for every trial of an ensemble.
        let refuse = |field: &str, value: f64, words: &'static str| rule(field, value, false, words);
        if let Some(e) = self.positions.iter().position(|x| !x.is_finite()) {
            let field = format!("positions[{}, {}]", e / self.dim, e % self.dim);
            refuse(&field, self.positions[e], "a finite number")?;
        }
        if let Some(e) = self.positions.iter().position(|x| x.abs() > FARTHEST) {
            let field = format!("positions[{}, {}]", e / self.dim, e % self.dim);
            refuse(&field, self.positions[e], "between -1e100 and 1e100")?;
        }
        // 0 < ζ ≤ ∞, and 0 < σ < ζ for the defenders.
        if let Some(i) = self.visibility.iter().position(|&zeta| zeta.is_nan() || zeta <= 0.0) {
            refuse(&format!("visibility_radii[{i}]"), self.visibility[i], "a positive number or infinity")?;
        }
        if let Some(i) = self.capture.iter().position(|&sigma| !is_positive(sigma)) {
            positive(&format!("capture_radii[{i}]"), self.capture[i])?;
        }
        if let Some(i) = (0..n).find(|&i| self.capture[i] >= self.visibility[i]) {
            refuse(&format!("capture_radii[{i}]"), self.capture[i], "smaller than the visibility radius")?;
        }
        let least = FINEST * self.extent();
        if let Some(i) = self.visibility.iter().position(|&zeta| zeta < least) {
            let words = "at least 1e-12 of the largest distance from the attacker along an axis, or infinity";
            refuse(&format!("visibility_radii[{i}]"), self.visibility[i], words)?;
        }
        Ok(())
    }

    /// The largest distance of a player from the attacker along an axis.
    fn extent(&self) -> f64 {
        let (players, attacker) = self.positions.split_at(self.positions.len() - self.dim);
        let rows = players.chunks_exact(self.dim);
        rows.flat_map(|row| row.iter().zip(attacker)).map(|(x, a)| (x - a).abs()).fold(0.0, f64::max)
    }

    /// Who sees whom at the start, as a run sees it: by states relative to the attacker, rounded as in a run.
    ///
    /// # Errors
    /// [`GameError`] where positions and radii are not those of one game.
    pub fn network(&self) -> Result<Topology, GameError> {
        let (players, m) = (self.positions.len() / self.dim.max(1), self.visibility.len());
        let found = self.positions.len();
        if self.dim == 0 || found != players * self.dim || players < 3 || !(players - 2..players).contains(&m) {
            return Err(GameError::Length { field: "positions", found, expected: (m + 2) * self.dim });
        }
        let mut z = Vec::new();
        relative_state(self.positions, self.dim, &mut z);
        let sight: Vec<f64> = self.visibility.iter().map(|&zeta| squared_reach(zeta)).collect();
        let mut topology = Topology::empty(m, players - 1);
        observe(&z, self.dim, &sight, &mut topology);
        Ok(topology)
    }
}
