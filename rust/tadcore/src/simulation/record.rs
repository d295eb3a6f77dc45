//! What one game records, row by row.

use super::course::{Course, Present, WHAT};
use super::divergence::Divergence;
use super::outcome::Outcome;
use super::passes::Pass;
use super::state::{acted_on, apply, positions};
use crate::error::Stopped;
use crate::game::Grid;
use crate::game::validation::BEYOND;
use crate::memory::{MOST_BYTES, append, reserve, spare, within};
use crate::network::Topology;
use crate::policy::{GainKind, Policy, StepPolicy, closed_loop::FreeRows};
use crate::synthesis::Status;

/// A recorded run of L steps: L + 1 rows, the last the terminal state.
///
/// No step follows the terminal state; its row carries the last network in force and the feedback under it. Where a game
/// that diverged leaves the range of double precision, the record stops before: it is shorter than the game.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    /// How it ended.
    pub outcome: Outcome,
    /// L.
    pub steps: usize,
    /// How long after the instant before the last row the game ended, between two instants: 0 but for
    /// [`Termination::Continuous`](super::Termination::Continuous). The last row is then the state there, under the
    /// feedback of that instant, which is held.
    pub after: f64,
    /// Capture radii that were entered between two instants, in the order of time.
    pub passes: Vec<Pass>,
    /// The grid index of the end, or of the instant before it: that of the last row, unless the record stops before.
    pub end: usize,
    /// Whether and when the game diverged, before its end or at it.
    pub diverged: Option<Divergence>,
    /// Axes.
    pub dim: usize,
    /// (L + 1) × (n + 2) × dim.
    pub positions: Vec<f64>,
    /// Velocities, (L + 1) × (n + 2) × dim.
    pub controls: Vec<f64>,
    /// The network at each row.
    pub networks: Vec<Topology>,
    /// What the gains are made of.
    pub kind: GainKind,
    /// Gain rows, (L + 1) × m × N.
    pub gains: Vec<f64>,
    /// Their imaginary parts, (L + 1) × m × N; empty for scalar gains.
    pub turn: Vec<f64>,
    /// Θ at each row, reduced.
    pub theta: Vec<f64>,
    /// Terms of Θ, unweighted and reduced, (L + 1) × 4 or 3.
    pub terms: Vec<f64>,
    /// Iterations of all syntheses that the run needed, whether or not the table held them.
    pub iterations: usize,
    /// Rows whose synthesis did not reach its tolerance.
    pub unconverged: usize,
    /// Rows whose gains are proved to be globally optimal.
    pub certified: usize,
    /// What came between sight and network, in a world or under a network from outside.
    pub course: Option<Course>,
}

/// What one row records.
pub(super) struct Row<'a> {
    pub(super) z: &'a [f64],
    pub(super) attacker: &'a [f64],
    pub(super) step: &'a StepPolicy,
    pub(super) network: &'a Topology,
    pub(super) seen: &'a Topology,
    pub(super) present: Option<&'a Present>,
}

impl Record {
    /// A record without rows.
    pub(super) fn empty(dim: usize, kind: GainKind, course: Option<Course>) -> Self {
        Self {
            outcome: Outcome::Timeout,
            steps: 0,
            after: 0.0,
            passes: Vec::new(),
            end: 0,
            diverged: None,
            dim,
            positions: Vec::new(),
            controls: Vec::new(),
            networks: Vec::new(),
            kind,
            gains: Vec::new(),
            turn: Vec::new(),
            theta: Vec::new(),
            terms: Vec::new(),
            iterations: 0,
            unconverged: 0,
            certified: 0,
            course,
        }
    }

    /// The grid index of the end, or of the instant before it.
    #[must_use]
    pub fn grid_index(&self) -> usize {
        self.end
    }

    /// When the game ended.
    #[must_use]
    pub fn time(&self, grid: &Grid) -> f64 {
        grid.time_after(self.grid_index(), self.after)
    }

    /// When row i was recorded.
    #[must_use]
    pub fn time_of(&self, i: usize, grid: &Grid) -> f64 {
        if self.after > 0.0 && i == self.end + 1 { self.time(grid) } else { grid.time(i) }
    }

    /// Whether the numbers of the last row are in the range of double precision.
    pub(super) fn last_row_is_bounded(&self) -> bool {
        let row = self.positions.len() / self.networks.len();
        let tails = [&self.positions, &self.controls].map(|all| &all[all.len() - row..]);
        tails.into_iter().flatten().all(|x| x.abs() <= BEYOND) && self.theta.last().is_some_and(|x| x.is_finite())
    }

    /// Takes the last row back.
    pub(super) fn pop(&mut self) {
        let (rows, row) = (self.networks.len(), self.positions.len() / self.networks.len());
        for list in [&mut self.positions, &mut self.controls, &mut self.terms, &mut self.gains, &mut self.turn] {
            list.truncate(list.len() - list.len() / rows);
        }
        self.networks.pop();
        self.theta.pop();
        if let Some(course) = &mut self.course {
            course.pop(row);
        }
    }

    /// Bytes that `rows` rows of a game take.
    fn bytes(&self, policy: &Policy, rows: usize, dim: usize) -> u128 {
        let game = policy.game();
        let (n, m) = (game.size() as u128, game.constrained() as u128);
        let gains = if self.kind == GainKind::Scalar { m * n } else { 2 * m * n };
        let numbers = 2 * (n + 1) * dim as u128 + gains + 5;
        let course = if self.course.is_some() { Course::bytes(game, dim) } else { 0 };
        rows as u128 * (8 * numbers + m * n / 8 + size_of::<Topology>() as u128 + course)
    }

    /// Adds a row, under the feedback of t_k.
    pub(super) fn push(&mut self, policy: &Policy, k: usize, row: &Row) -> Result<(), Stopped> {
        let (dim, step) = (self.dim, row.step);
        within(WHAT, self.bytes(policy, k + 1, dim), MOST_BYTES)?;
        if k.is_multiple_of(64) {
            spare(WHAT)?;
        }
        for list in [&mut self.positions, &mut self.controls] {
            reserve(WHAT, list, row.z.len() + dim)?;
        }
        for list in [&mut self.theta, &mut self.terms] {
            reserve(WHAT, list, 4)?;
        }
        reserve(WHAT, &mut self.networks, 1)?;
        self.positions.extend(positions(row.z, row.attacker));
        let FreeRows { attacker: h, target } = policy.free_rows(k);
        let mut velocity = vec![0.0; dim];
        let (state, feedback) = (acted_on(row.z, self.kind), step.feedback(row.network.size()));
        let gains = feedback.chunks_exact(feedback.len() / row.network.rows());
        for gain in gains.chain(target.as_deref()).chain(std::iter::once(&h[..])) {
            apply(gain, &state, dim, &mut velocity);
            self.controls.extend_from_slice(&velocity);
        }
        self.terms.extend_from_slice(&step.terms);
        self.networks.push(row.network.clone());
        append(WHAT, &mut self.gains, &step.gains.rows)?;
        if self.kind != GainKind::Scalar {
            let mirror = self.kind == GainKind::Mirror;
            reserve(WHAT, &mut self.turn, step.gains.rows.len())?;
            self.turn.extend(step.gains.turn.iter().map(|&b| if mirror { 0.0 - b } else { b }));
            self.turn.resize(self.gains.len(), 0.0);
        }
        self.theta.push(step.gains.theta);
        if let Some(course) = &mut self.course {
            course.push(row.seen, row.present)?;
        }
        Ok(())
    }

    /// Counts how the gains of a row were found.
    pub(super) fn count(&mut self, step: &StepPolicy) {
        self.iterations += step.gains.iterations;
        self.unconverged += usize::from(step.gains.status != Status::Converged);
        self.certified += usize::from(step.gains.certified);
    }
}
