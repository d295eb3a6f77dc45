//! Newton's method from a point near a minimum of another instant.

use super::candidate::{Candidate, Start};
use super::dispatch::Kind;
use super::stages::Search;
use crate::error::Stopped;
use crate::simd::norm;
use crate::synthesis::newton::{Limits, Status};

/// Steps that Newton's method may take from between two minima, how far, relative to the gains, it may lead, and the
/// gradient aimed at: the last step is made for what a gradient within the tolerance leaves in a valley.
const CONTINUED: usize = 5;
const MOVED: f64 = 0.01;
const CLOSE: f64 = 1e-15;

impl Search<'_> {
    /// Newton's method from a point for each candidate, where a minimum of another instant was; whether it soon led to a
    /// minimum near there.
    pub(crate) fn continue_from(
        &mut self,
        candidates: &mut [Candidate],
        starts: &[Vec<f64>],
    ) -> Result<Vec<bool>, Stopped> {
        self.begin(1);
        for (e, (candidate, start)) in candidates.iter_mut().zip(starts).enumerate() {
            candidate.g.copy_from_slice(start);
            let point = self.tasks.add(e, false, 0.0)?;
            point.copy_from_slice(start);
            candidate.in_double(point);
        }
        let limits = self.limits;
        self.limits = Limits { iterations: CONTINUED, tolerance: CLOSE, ..limits };
        self.descend(Kind::Certified, candidates)?;
        self.limits = limits;
        let mut near = Vec::with_capacity(candidates.len());
        for (e, candidate) in candidates.iter_mut().enumerate() {
            let (point, reached) = (self.tasks.point(e), self.tasks.reached(e));
            let moved: f64 = point.iter().zip(&candidate.g).map(|(x, y)| (x - y) * (x - y)).sum();
            near.push(reached.status == Status::Converged && moved.sqrt() <= MOVED * norm(&candidate.g));
            candidate.take(Start::Between, point, reached);
            candidate.iterations = reached.iterations;
            candidate.certified = self.tasks.certified(e);
            candidate.quick = true;
        }
        self.refine(candidates)?;
        let still = |candidate: &Candidate| candidate.reached.status == Status::Converged;
        near.iter_mut().zip(candidates.iter()).for_each(|(near, candidate)| *near &= still(candidate));
        Ok(near)
    }
}
