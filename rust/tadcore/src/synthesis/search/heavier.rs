//! Where γ₁ dominates: another search with the other weights heavier, lowered to γ's own.
//!
//! With γ₁ far above the others Θ has valleys, on whose floors ‖GᵀRG − M‖ stays next to nothing while a row of √R·G
//! turns into that of another player. Descents come down to a floor anywhere and follow it to the nearest dip. With
//! heavier weights beside γ₁ the floors are no longer flat, and the search finds the dip that is the lowest there. From
//! its end the weights are lowered by a factor of [`STEP`] at a time, each a few steps of Newton's method from the
//! last.

use super::candidate::Candidate;
use super::stages::Search;
use crate::error::Stopped;
use crate::synthesis::newton::Reached;
use crate::synthesis::theta::{Precisions, Problem};

/// How far above the others γ₁ dominates; how many times heavier they are made at most; and by how much at a time they
/// are lowered. The last two are powers of four, of which roots are exact.
const DOMINATES: f64 = 32.0;
const MOST: f64 = 1024.0;
const STEP: f64 = 4.0;

impl Search<'_> {
    /// A second search for the candidates `open`, where γ₁ dominates; which it leads lower.
    pub(super) fn search_heavier(
        &mut self,
        candidates: &mut [Candidate],
        open: &[usize],
    ) -> Result<Vec<usize>, Stopped> {
        let (problem, mut lower) = (self.problem, Vec::new());
        let ratio = problem.dominance();
        if ratio < DOMINATES {
            return Ok(lower);
        }
        let mut factors = vec![STEP];
        while let Some(factor) = factors.last().map(|last| last * STEP).filter(|&next| next <= MOST.min(ratio * STEP)) {
            factors.push(factor);
        }
        factors.reverse();
        let thetas: Vec<Precisions> = factors.iter().map(|&factor| problem.heavier(factor)).collect();
        let heaviest = problem.with(thetas[0].clone());
        let mut others = open.iter().map(|&e| candidates[e].again()).collect::<Result<Vec<_>, _>>()?;
        self.of(&heaviest).everywhere(&mut others)?;
        for (&e, other) in open.iter().zip(&others) {
            let candidate = &mut candidates[e];
            candidate.iterations += other.iterations;
            let end = self.lower(candidate, other, thetas[1..].iter().map(|theta| (1.0, theta)).collect())?;
            if candidate.offer(end.start, &end.g, Reached { iterations: 0, ..end.reached }) {
                candidate.certified = end.certified;
                lower.push(e);
            }
        }
        Ok(lower)
    }
}

impl Problem {
    /// γ₁ relative to the largest other entry of γ.
    fn dominance(&self) -> f64 {
        let most = self.gamma[1..].iter().fold(0.0, |a: f64, &b| a.max(b));
        self.gamma[0] / most
    }

    /// Θ with every weight but γ₁ so many times as large, a power of four.
    pub(crate) fn heavier(&self, factor: f64) -> Precisions {
        let mut of = self.theta.double.clone();
        let times = |numbers: &mut Vec<f64>, factor: f64| numbers.iter_mut().for_each(|x| *x *= factor);
        of.coupling.iter_mut().for_each(|w| times(w, factor.sqrt()));
        times(&mut of.gram, factor);
        times(&mut of.closeness, factor);
        of.quadratic.iter_mut().for_each(|q| times(q, factor));
        let scale = &mut of.scale;
        scale.coupling *= factor;
        scale.closeness *= factor;
        scale.value += (factor - 1.0) / factor * (4.0 * scale.coupling + scale.closeness) * scale.fne * scale.fne;
        of.into()
    }
}
