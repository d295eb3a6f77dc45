//! Gains where Θ has next to no weight on S, or none.
//!
//! Without weight on S minima need not be unique: the sign of a row, or a rotation of rows, may change nothing. With next
//! to none they lie on the floor of a valley so flat that Newton's method creeps along it, or stops: what S adds to the
//! gradient is lost beside the parts of the others. So such a Θ is not searched itself. Two that have no such valley are:
//! the one without the faint weights, and the one with [`SMALL`] in their place. From both ends the weight is then lowered
//! step by step, each a few steps of Newton's method from the last, until it is what γ says.

use super::candidate::{Candidate, Start, TIE};
use super::dispatch::Kind;
use super::stages::Search;
use crate::error::Stopped;
use crate::synthesis::newton::{Limits, Owner, Reached};
use crate::synthesis::theta::{Precisions, Problem};

/// Small weights on S, relative to the parts of Θ: the first, and by what each is below the one before.
const SMALL: f64 = 9.765_625e-4;
const LOWER: f64 = 3.906_25e-3;
/// The last of them where γ has none at all: it moves gains by no more than rounding does.
const LAST: f64 = 1.490_116_119_384_765_6e-8;
/// The last of them where γ has some; and how far above γ's own it may be.
const LEAST: f64 = 2e-13;
const OWN: f64 = 4.0;
/// A difference in Θ that rounding makes, relative to the parts that cancel in it.
const LOST_BY_ROUNDING: f64 = 1e-14;
/// Steps for each weight below [`LAST`], in which a gradient within the tolerance is not enough.
const STEPS: usize = 50;

/// Where one way from a search to γ's own weights ended.
pub(super) struct End {
    pub start: Start,
    pub g: Vec<f64>,
    pub reached: Reached,
    pub certified: bool,
}

impl Search<'_> {
    /// The search where S has next to no weight for some players.
    pub(super) fn settle(&mut self, candidates: &mut [Candidate], players: &[usize]) -> Result<(), Stopped> {
        let problem = self.problem;
        let without = problem.with(problem.without(players));
        let with_some = problem.with(problem.weighted(players, SMALL));
        let unweighted = problem.unweighted();
        let own = problem.weight(players);
        let mut small = vec![SMALL];
        while let Some(&weight) = small.last() {
            let next = weight * LOWER;
            if next < if own > 0.0 { LEAST.max(OWN * own) } else { LAST } {
                break;
            }
            small.push(next);
        }
        let thetas: Vec<(f64, Precisions)> =
            small.iter().map(|&weight| (weight, problem.weighted(players, weight))).collect();
        let mut ends: Vec<Vec<End>> = candidates.iter().map(|_| Vec::new()).collect();
        for searched in [&without, &with_some] {
            let mut others = candidates.iter().map(Candidate::again).collect::<Result<Vec<_>, _>>()?;
            self.of(searched).everywhere(&mut others)?;
            for ((candidate, other), ends) in candidates.iter_mut().zip(&mut others).zip(&mut ends) {
                candidate.iterations += other.iterations;
                candidate.left_out = candidate.left_out.max(other.left_out);
                candidate.quick &= other.quick;
                if candidate.complete {
                    continue;
                }
                problem.nearer(players, &mut other.g);
                // The larger weights shorten the way; where they lead to another minimum the smallest alone may not.
                for first in [0, thetas.len() - 1, thetas.len()] {
                    let way = thetas[first..].iter().map(|(weight, theta)| (*weight, theta)).collect();
                    ends.push(self.lower(candidate, other, way)?);
                }
            }
        }
        for (candidate, ends) in candidates.iter_mut().zip(ends).filter(|(candidate, _)| !candidate.complete) {
            let lowest = ends.iter().map(|end| end.reached.value).fold(f64::INFINITY, f64::min);
            // Of equal minima the one nearest to the equilibrium.
            let room = if unweighted.is_empty() {
                0.0
            } else {
                TIE * lowest + LOST_BY_ROUNDING * problem.theta.double.scale.value
            };
            let away = |end: &End| problem.away(players, &end.g);
            let best = ends.into_iter().filter(|end| end.reached.value <= lowest + room).min_by(|a, b| {
                if room > 0.0 { away(a).total_cmp(&away(b)) } else { a.reached.value.total_cmp(&b.reached.value) }
            });
            if let Some(end) = best {
                candidate.take(end.start, &end.g, end.reached);
                candidate.certified = end.certified;
            }
        }
        Ok(())
    }

    /// From the end of another search along `thetas`, each with its weight, and last by Θ itself.
    pub(super) fn lower(
        &mut self,
        candidate: &mut Candidate,
        from: &Candidate,
        thetas: Vec<(f64, &Precisions)>,
    ) -> Result<End, Stopped> {
        let mut end = End { start: from.start, g: from.g.clone(), reached: Reached::default(), certified: false };
        let last = (0.0, &self.problem.theta);
        for (weight, theta) in thetas.into_iter().chain([last]) {
            let limits =
                if weight < LAST { Limits { iterations: STEPS, tolerance: 0.0, ..self.limits } } else { self.limits };
            self.begin(1);
            self.tasks.add(0, false, 0.0)?.copy_from_slice(&end.g);
            let owner = [Owner { variables: &candidate.variables, incumbent: None }];
            self.dispatcher.run(Kind::Certified, theta, self.tasks, &owner, limits)?;
            end.reached = self.tasks.reached(0);
            end.g.copy_from_slice(self.tasks.point(0));
            end.certified = self.tasks.certified(0);
            candidate.iterations += end.reached.iterations;
        }
        Ok(end)
    }
}

impl Problem {
    /// Turns the row of each of those players whose sign changes nothing but S towards the equilibrium.
    fn nearer(&self, players: &[usize], g: &mut [f64]) {
        let n = self.size;
        for &i in players.iter().filter(|_| self.even()) {
            let (g, f) = (&mut g[i * n..(i + 1) * n], &self.fne()[i * n..(i + 1) * n]);
            if g.iter().zip(f).map(|(g, f)| g * f).sum::<f64>() < 0.0 {
                g.iter_mut().for_each(|x| *x = -*x);
            }
        }
    }

    /// Σ‖S_i‖² over those players.
    fn away(&self, players: &[usize], g: &[f64]) -> f64 {
        let (n, r) = (self.size, &self.theta.double.r);
        let of_row = |&i: &usize| -> f64 {
            let rows = g[i * n..(i + 1) * n].iter().zip(&self.fne()[i * n..(i + 1) * n]);
            r[i] * r[i] * rows.map(|(g, f)| (g - f) * (g - f)).sum::<f64>()
        };
        players.iter().map(of_row).sum()
    }
}
