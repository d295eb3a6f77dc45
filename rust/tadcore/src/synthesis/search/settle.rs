//! Gains where Θ has no weight on S, and equal minima may differ.

use super::candidate::{Candidate, TIE};
use super::dispatch::Kind;
use super::stages::Search;
use crate::error::Stopped;
use crate::synthesis::newton::Owner;
use crate::synthesis::theta::Precisions;

/// Small weights on S, relative to the parts of Θ, one after another: the last moves gains by no more than rounding does.
const SMALL: [f64; 3] = [9.765_625e-4, 3.814_697_265_625e-6, 1.490_116_119_384_765_6e-8];
/// A difference in Θ that rounding makes, relative to the parts that cancel in it.
const LOST_BY_ROUNDING: f64 = 1e-14;

impl Search<'_> {
    /// Without weight on S minima need not be unique: the sign of a row, or a rotation of rows, may change nothing. Of
    /// equal minima those gains are taken to which a small weight leads: nearest to the equilibrium.
    pub(super) fn settle(&mut self, candidates: &mut [Candidate]) -> Result<(), Stopped> {
        let (n, players) = (self.problem.size, self.problem.unweighted());
        if players.is_empty() {
            return Ok(());
        }
        let of: Vec<Precisions> = SMALL.iter().map(|&weight| self.problem.weighted(&players, weight)).collect();
        let limits = self.limits;
        for candidate in candidates.iter_mut().filter(|candidate| !candidate.complete) {
            for &i in players.iter().filter(|_| self.problem.even()) {
                let (g, f) = (&mut candidate.g[i * n..(i + 1) * n], &self.problem.fne()[i * n..(i + 1) * n]);
                if g.iter().zip(f).map(|(g, f)| g * f).sum::<f64>() < 0.0 {
                    g.iter_mut().for_each(|x| *x = -*x);
                }
            }
            let value = candidate.reached.value + LOST_BY_ROUNDING * self.problem.theta.double.scale.value;
            // The larger weights shorten the way; where they lead to another minimum the smallest alone may not.
            for first in [0, of.len() - 1] {
                let (mut point, mut certified) = (candidate.g.clone(), false);
                let mut reached = candidate.reached;
                for theta in of[first..].iter().chain([&self.problem.theta]) {
                    self.begin(1);
                    self.tasks.add(0, false, 0.0)?.copy_from_slice(&point);
                    let owner = [Owner { variables: &candidate.variables, incumbent: None }];
                    self.dispatcher.run(Kind::Certified, theta, self.tasks, &owner, limits)?;
                    reached = self.tasks.reached(0);
                    point.copy_from_slice(self.tasks.point(0));
                    certified = self.tasks.certified(0);
                    candidate.iterations += reached.iterations;
                }
                if reached.value <= value * (1.0 + TIE) {
                    candidate.take(candidate.start, &point, reached);
                    candidate.certified = certified;
                    break;
                }
            }
        }
        Ok(())
    }
}
