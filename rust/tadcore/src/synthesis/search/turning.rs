//! Gains that turn: Θ over the paper's blocks aI + bJ in the plane, J a quarter turn, which act as the numbers a + ib.
//!
//! Scalar gains are those with b = 0, and every minimum among them is a critical point here, from which a descent with
//! b = 0 never leaves. So descents begin with a second part B, from the scalar minimum and from the canonical start, and
//! where GᴴRG is as it is at a point known already: it sees neither the phase of a row of √R·G nor whose row it is.
//! They are made with a limit to each step, in single precision where the instant allows; those that lead away from
//! the scalars, and not far above the incumbent, then go on in double precision by Newton's method. The lowest is kept,
//! and rows of it are turned in the same way, again while that goes lower.
//!
//! Θ(conj G) = Θ(G): a minimum that turns has a mirror image that is as low. What is proved of a scalar minimum, that the
//! certificate's form is positive semidefinite there, can for that reason hardly be proved of one that turns: G − conj G
//! would have to be a direction in which neither the form nor GᴴRG changes.

use super::candidate::{BACK, Candidate, TIE};
use super::dispatch::Kind;
use super::stages::{BASIN, DOUBLED_ITERATIONS, LONGEST_STEP, ROUNDS, Search};
use crate::error::Stopped;
use crate::simd::norm;
use crate::synthesis::newton::{Limits, Owner, Reached, Status, advance, balance};
use crate::synthesis::theta::Precisions;

/// Sizes of the second part at the starts, relative to ‖F‖.
const SIZES: [f64; 3] = [1.0, 0.3, 2.0];
/// Phases of the pattern that makes it.
const PHASES: [f64; 2] = [1.0, 2.5];
/// Θ at the end of a descent in a basin, relative to the incumbent, up to which it is made to the end.
const NEAR: f64 = 1.01;
/// Phases by which a row is turned, as (cos, sin): quarter turns, a half, and a third either way.
const TURNS: [(f64, f64); 5] = [(0.0, 1.0), (0.0, -1.0), (-1.0, 0.0), (-0.5, SIN), (-0.5, -SIN)];
const SIN: f64 = 0.866_025_403_784_438_6;

/// A point in gains that turn, A and then B, and how it was reached.
type Turned = (Vec<f64>, Reached);

impl Search<'_> {
    /// The lowest minimum in gains that turn, where one is lower than the scalar minimum of `candidate`.
    pub(crate) fn turn(&mut self, candidate: &mut Candidate) -> Result<Option<Turned>, Stopped> {
        let owners = std::slice::from_mut(candidate);
        self.begin(1);
        self.tasks.add(0, false, 0.0)?.copy_from_slice(&owners[0].g);
        let limits = self.limits;
        self.limits.iterations = 0;
        self.descend(Kind::Real, owners)?;
        self.limits = limits;
        candidate.reached = self.tasks.reached(0);
        let mut best: Option<Turned> = None;
        let mut starts = self.first_turned(candidate);
        for _ in 0..=ROUNDS {
            let Some(lower) = self.lowest_turned(candidate, &starts, best.as_ref())? else { break };
            starts = rotated(&lower.0, candidate, self.problem.size());
            best = Some(lower);
        }
        Ok(best)
    }

    /// The starts: a second part of some sizes beside the scalar minimum and the canonical start, and rows turned.
    fn first_turned(&self, candidate: &Candidate) -> Vec<Vec<f64>> {
        let (scale, unknowns) = (self.problem.theta.double.scale.fne, candidate.variables.len());
        let mut starts = Vec::new();
        for real in [&candidate.g, &candidate.initial] {
            for size in SIZES {
                for phase in PHASES {
                    let size = size * scale / (unknowns as f64).sqrt();
                    let pattern: Vec<f64> =
                        (0..unknowns).map(|v| size * (phase + 2.399_963_229_728_653 * v as f64).cos()).collect();
                    let mut point = [&real[..], &vec![0.0; real.len()]].concat();
                    advance(&mut point[real.len()..], &candidate.variables, &pattern);
                    starts.push(point);
                }
            }
            starts.extend(rotated(&[&real[..], &vec![0.0; real.len()]].concat(), candidate, self.problem.size()));
        }
        starts
    }

    /// What is lowest of where descents from `starts` lead, if it is lower than the incumbent and the scalar minimum.
    fn lowest_turned(
        &mut self,
        candidate: &mut Candidate,
        starts: &[Vec<f64>],
        incumbent: Option<&Turned>,
    ) -> Result<Option<Turned>, Stopped> {
        let (problem, limits) = (self.problem, self.limits);
        let value = incumbent.map_or(candidate.reached.value, |found| found.1.value);
        let basin = Limits {
            iterations: DOUBLED_ITERATIONS,
            tolerance: BASIN,
            acceptable: BASIN,
            longest: LONGEST_STEP * problem.theta.double.scale.fne,
        };
        let ends = self.descend_turned(candidate, &problem.theta, starts, basin)?;
        let mut near: Vec<Vec<f64>> = Vec::new();
        for (point, reached) in ends {
            let (a, b) = point.split_at(point.len() / 2);
            let known = || near.iter().any(|other| same(&point, other));
            if reached.value <= NEAR * value && norm(b) > BACK * norm(a) && !known() {
                near.push(point);
            }
        }
        let double = Precisions::double_only(problem.theta.double.clone());
        let mut best: Option<Turned> = None;
        for end in self.descend_turned(candidate, &double, &near, limits)? {
            let value = best.as_ref().map_or(value, |found| found.1.value);
            if end.1.status == Status::Converged && end.1.value < value - TIE * value.abs() {
                best = Some(end);
            }
        }
        Ok(best)
    }

    /// Where descents in gains that turn lead.
    fn descend_turned(
        &mut self,
        candidate: &mut Candidate,
        theta: &Precisions,
        starts: &[Vec<f64>],
        limits: Limits,
    ) -> Result<Vec<Turned>, Stopped> {
        self.begin(2);
        for start in starts {
            let point = self.tasks.add(0, true, candidate.reached.scale)?;
            point.copy_from_slice(start);
            let (a, b) = point.split_at_mut(candidate.g.len());
            candidate.in_double(a);
            balance(b, &candidate.variables);
        }
        let owner = [Owner { variables: &candidate.variables, incumbent: None }];
        self.dispatcher.run(Kind::Doubled, theta, self.tasks, &owner, limits)?;
        let mut ends = Vec::with_capacity(starts.len());
        for task in 0..self.tasks.len() {
            let (point, reached) = (self.tasks.point(task).to_vec(), self.tasks.reached(task));
            candidate.iterations += reached.iterations;
            ends.push((point, reached));
        }
        Ok(ends)
    }
}

/// The point with one row turned, for every row and phase.
fn rotated(point: &[f64], candidate: &Candidate, n: usize) -> Vec<Vec<f64>> {
    let half = point.len() / 2;
    let mut players: Vec<usize> = candidate.variables.iter().map(|v| v.own / n).collect();
    players.dedup();
    let turned = |i: usize, (cos, sin): (f64, f64)| {
        let mut other = point.to_vec();
        for e in i * n..(i + 1) * n {
            let (a, b) = (point[e], point[half + e]);
            (other[e], other[half + e]) = (cos * a - sin * b, sin * a + cos * b);
        }
        other
    };
    players.iter().flat_map(|&i| TURNS.map(|by| turned(i, by))).collect()
}

/// Whether two points are one, or mirror images of each other.
fn same(one: &[f64], other: &[f64]) -> bool {
    let (half, near) = (one.len() / 2, BACK * norm(one));
    let distance = |sign: f64| -> f64 {
        let pairs = one.iter().zip(other).enumerate();
        pairs.map(|(e, (x, y))| (x - if e < half { *y } else { sign * y }).powi(2)).sum()
    };
    distance(1.0).min(distance(-1.0)) <= near * near
}
