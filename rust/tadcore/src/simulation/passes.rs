//! Between two instants, where termination is not tested: passes within a capture radius, and the continuous end.
//!
//! The sampled game ends at an instant at which somebody is within a radius. Whoever runs through a ball between two
//! instants is recorded as a [`Pass`]; with [`Termination::Continuous`] the game ends there, at the crossing itself.

use super::motion::Motion;
use super::near::{clear, near};
use super::outcome::{Outcome, Reach};
use crate::cancel::CancelToken;
use crate::error::RunError;
use crate::game::validation::BEYOND;
use crate::memory::{reserve, zeros};
use crate::policy::{Policy, closed_loop, closed_loop::FreeRows};

/// What asks for memory here.
const WHAT: &str = "the passes of one run";

/// When a game ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Termination {
    /// At the first instant of the grid at which somebody is within a capture radius: the definition.
    #[default]
    Sampled,
    /// At the first crossing of a capture radius, at an instant or between two.
    Continuous,
}

/// A capture radius that is entered between two instants, before the one whose player ends the game: if there is any, the
/// game with [`Termination::Continuous`] ends at the first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pass {
    /// k, of the instant before.
    pub step: usize,
    /// Whose: a defender's (0-based), or at n the attacker's own around the target.
    pub row: usize,
    /// How long after t_k it is entered.
    pub enters: f64,
    /// How long after t_k the two are closest.
    pub closest: f64,
    /// How close.
    pub distance: f64,
}

impl Pass {
    /// Who would have caught whom.
    pub(crate) fn outcome(row: usize, defenders: usize) -> Outcome {
        if row < defenders { Outcome::Intercepted(row) } else { Outcome::Captured }
    }
}

/// A step from z(t_k) to z(t_{k+1}) at which nobody is within a radius at its start.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Step<'a> {
    pub(crate) k: usize,
    /// Gain rows in force: on z, or on z and Jz where they turn, as are then the two states.
    pub(crate) gains: &'a [f64],
    pub(crate) start: &'a [f64],
    pub(crate) end: &'a [f64],
    pub(crate) dim: usize,
}

impl Step<'_> {
    /// The motion of the step and every radius that is entered within it, in the order of time, an interception before a
    /// capture: the row, and how long after t_k. Calls `see` with both if there may be any.
    ///
    /// # Errors
    /// [`RunError::Turns`] where the motion turns too often to be followed.
    fn entries(
        &self,
        policy: &Policy,
        reach: &Reach,
        cancel: &CancelToken,
        see: impl FnOnce(&mut Motion, &[(usize, f64)]) -> Result<(), RunError>,
    ) -> Result<(), RunError> {
        let (game, free) = (policy.game(), self.free_rows(policy));
        let (step, size) = (game.grid().step(), free.attacker.len());
        let mut c = zeros(WHAT, size * size)?;
        closed_loop::matrix(&free, self.gains, &mut c);
        let stretch = clear(closed_loop::norm(&c, size) * step);
        if !self.may_enter(reach, stretch) || !self.end.iter().all(|x| x.abs() <= BEYOND) {
            return Ok(());
        }
        let mut motion = Motion::new(&c, size, self.dim, step, cancel)?;
        let mut found: Vec<(usize, f64)> = Vec::new();
        for i in 0..game.size() {
            if let Some(after) = motion.enters(i, reach.squared(i), self.start, self.end)? {
                found.push((i, after));
            }
        }
        found.sort_by(|a, b| a.1.total_cmp(&b.1));
        see(&mut motion, &found)?;
        if motion.lost() { Err(RunError::Turns { time: game.grid().time(self.k) }) } else { Ok(()) }
    }

    /// The rows of the players that see everything, on z or on z and Jz as the gains are.
    fn free_rows(&self, policy: &Policy) -> FreeRows {
        let free = policy.free_rows(self.k);
        let scalar = self.gains.len() == policy.game().constrained() * policy.game().size();
        if scalar { free } else { free.beside_turned() }
    }

    /// Whether some chord comes near enough to its radius for the motion to enter it; `stretch` is [`clear`]'s.
    fn may_enter(&self, reach: &Reach, stretch: f64) -> bool {
        let lanes = |z: &[f64]| -> Vec<[f64; 1]> { z.iter().map(|&x| [x]).collect() };
        let capture: Vec<[f64; 1]> = (0..self.start.len() / self.dim).map(|i| [reach.squared(i)]).collect();
        near(&lanes(self.start), &lanes(self.end), &capture, self.dim, stretch) != 0
    }

    /// The passes of the step: every radius that is entered before the one that ends the game at t_{k+1}, if one does.
    pub(crate) fn passes(
        &self,
        policy: &Policy,
        reach: &Reach,
        passes: &mut Vec<Pass>,
        cancel: &CancelToken,
    ) -> Result<(), RunError> {
        let ending =
            reach.ends(&self.end[..policy.game().size() * self.dim], self.dim).map(|outcome| reach.row(outcome));
        self.entries(policy, reach, cancel, |motion, found| {
            for &(row, enters) in found.iter().take_while(|entry| Some(entry.0) != ending) {
                let (closest, distance) = motion.closest(row, self.start, self.end)?;
                reserve(WHAT, passes, 1)?;
                passes.push(Pass { step: self.k, row, enters, closest, distance });
            }
            Ok(())
        })
    }

    /// Where the continuous game ends within the step: the row, how long after t_k, z there, and how far the attacker
    /// has moved.
    #[allow(clippy::type_complexity)]
    pub(crate) fn end(
        &self,
        policy: &Policy,
        reach: &Reach,
        cancel: &CancelToken,
    ) -> Result<Option<(usize, f64, Vec<f64>, Vec<f64>)>, RunError> {
        let step = policy.game().grid().step();
        let mut end = None;
        self.entries(policy, reach, cancel, |motion, found| {
            if let Some(&(row, after)) = found.first().filter(|first| first.1 < step) {
                let (z, moved) = motion.at(after, &self.free_rows(policy).attacker, self.start)?;
                end = Some((row, after, z, moved));
            }
            Ok(())
        })?;
        Ok(end)
    }
}
