//! Gains between anchors: at some instants every network is searched for by itself, at those between them Newton's method
//! begins between the minima at the two around.
//!
//! P(t) is smooth, and with it the minimisers of Θ: from one instant to the next a branch of minima moves a little, and
//! which branch is the lowest seldom changes. *Anchors* are instants of the grid between which P changes by at most
//! [`APART`], and which are at most [`LONGEST`] steps apart. Between two of them the gains of a network are those that
//! Newton's method reaches from the point between the gains at both, if these are near each other and it stays near
//! them; else they are searched for there as well. So they remain a function of (t_k, topology) alone, whoever asks
//! first and for whatever else.
//!
//! What this can miss is a minimum that becomes the lowest and ceases to be so between two anchors.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | a ≤ k ≤ b | [`Anchors::place`] | the anchors next to an instant |
//! | G_a + (k − a)/(b − a) · (G_b − G_a) | [`between`] | where Newton begins |

use std::collections::HashMap;
use std::sync::{Arc, PoisonError, RwLock, TryLockError};

use super::Policy;
use super::transitions::each;
use crate::cancel::CancelToken;
use crate::error::Stopped;
use crate::memory::{copy, reserve};
use crate::network::Topology;
use crate::riccati::Equilibrium;
use crate::simd::norm;
use crate::synthesis::{Gains, Options, Problem, Status, Synthesizer, TABULATED_UP_TO};

/// How far P moves from one anchor to the next, relative to itself, and how many steps apart they are at most.
const APART: f64 = 0.03;
const LONGEST: usize = 32;
/// How far apart the gains at two anchors may be, relative to themselves, to be on one branch.
const NEAR: f64 = 0.1;

type Known = RwLock<HashMap<Topology, Arc<Gains>>>;

/// The anchors of a game, and the gains that are known there by the canonical form of the network.
#[derive(Debug)]
pub(super) struct Anchors {
    steps: Vec<usize>,
    known: Vec<Known>,
}

/// Where an instant is.
enum Place {
    /// At an anchor.
    At(usize),
    /// Between two anchors.
    Between(Stretch),
}

/// Two neighbouring anchors, and what part of the way from one to the other an instant is.
struct Stretch {
    low: usize,
    high: usize,
    share: f64,
}

impl Anchors {
    pub(super) fn of(equilibrium: &Equilibrium, cancel: &CancelToken) -> Result<Self, Stopped> {
        // Large games are searched at every instant.
        let one = equilibrium.is_constant() || equilibrium.size() > TABULATED_UP_TO;
        let last = if one { 0 } else { equilibrium.steps() };
        let mut steps = Vec::new();
        reserve("the anchors of a game", &mut steps, last + 1)?;
        steps.push(0);
        let mut anchor = 0;
        for k in 1..=last {
            if k % 65_536 == 0 {
                cancel.check()?;
            }
            let far = k - anchor > LONGEST || moved(equilibrium, anchor, k);
            if far && k - 1 > anchor {
                anchor = k - 1;
                steps.push(anchor);
            }
            if k == last || k - anchor == 1 && moved(equilibrium, anchor, k) {
                anchor = k;
                steps.push(k);
            }
        }
        let known = each(steps.len(), Known::default, cancel)?;
        Ok(Self { steps, known })
    }

    fn place(&self, step: usize) -> Place {
        if self.steps.len() == 1 {
            return Place::At(0);
        }
        match self.steps.binary_search(&step) {
            Ok(anchor) => Place::At(anchor),
            Err(high) => {
                let (low, [a, b]) = (high - 1, [self.steps[high - 1], self.steps[high]]);
                Place::Between(Stretch { low, high, share: (step - a) as f64 / (b - a) as f64 })
            }
        }
    }

    fn get(&self, anchor: usize, form: &Topology) -> Option<Arc<Gains>> {
        self.known[anchor].read().unwrap_or_else(PoisonError::into_inner).get(form).cloned()
    }

    /// Whether no thread holds an anchor.
    pub(super) fn is_idle(&self) -> bool {
        self.known.iter().all(|known| !matches!(known.try_write(), Err(TryLockError::WouldBlock)))
    }
}

/// Whether some group of P at instant k is further from that at instant `a` than anchors may be apart.
fn moved(equilibrium: &Equilibrium, a: usize, k: usize) -> bool {
    let far = |group: usize| {
        let (p, q) = (equilibrium.p(group, a), equilibrium.p(group, k));
        let (mut apart, mut size) = (0.0, 0.0);
        for (x, y) in p.iter().zip(q) {
            apart += (x - y) * (x - y);
            size += x * x;
        }
        apart > APART * APART * size
    };
    (0..equilibrium.groups()).any(far)
}

impl Policy {
    /// The gains of canonical forms at an instant, each handed to `each` with its index.
    ///
    /// # Errors
    /// [`Stopped`] when there is no memory for them, or `cancel` was raised; and what `each` says.
    pub(super) fn solve_forms(
        &self,
        step: usize,
        problem: &Problem,
        forms: &[Topology],
        solver: &mut Synthesizer,
        cancel: &CancelToken,
        mut each: impl FnMut(usize, &Gains) -> Result<(), Stopped>,
    ) -> Result<(), Stopped> {
        let alone = match self.anchors.place(step) {
            _ if !problem.is_followed() => (0..forms.len()).collect(),
            Place::At(anchor) => {
                for (index, gains) in self.at_anchor(anchor, Some(problem), forms, solver, cancel)?.iter().enumerate() {
                    each(index, gains)?;
                }
                Vec::new()
            }
            Place::Between(stretch) => self.follow(&stretch, problem, forms, solver, cancel, &mut each)?,
        };
        let networks: Vec<Topology> = alone.iter().map(|&index| forms[index].clone()).collect();
        solver.solve_all(problem, &networks, Options::default(), |at, gains| each(alone[at], &gains))
    }

    /// Hands `each` the gains that the minima at both ends of a stretch lead to; which forms have to be searched for.
    fn follow(
        &self,
        stretch: &Stretch,
        problem: &Problem,
        forms: &[Topology],
        solver: &mut Synthesizer,
        cancel: &CancelToken,
        each: &mut impl FnMut(usize, &Gains) -> Result<(), Stopped>,
    ) -> Result<Vec<usize>, Stopped> {
        let (mut alone, wanted): (Vec<usize>, Vec<usize>) =
            (0..forms.len()).partition(|&index| forms[index].is_complete());
        let listed: Vec<Topology> = wanted.iter().map(|&index| forms[index].clone()).collect();
        let before = self.at_anchor(stretch.low, None, &listed, solver, cancel)?;
        let after = self.at_anchor(stretch.high, None, &listed, solver, cancel)?;
        let (mut followed, mut networks, mut starts) = (Vec::new(), Vec::new(), Vec::new());
        for ((&index, network), (a, b)) in wanted.iter().zip(listed).zip(before.iter().zip(&after)) {
            match between(a, b, stretch.share)? {
                Some(start) => {
                    followed.push((index, a.certified && b.certified));
                    networks.push(network);
                    starts.push(start);
                }
                None => alone.push(index),
            }
        }
        solver.follow_all(problem, &networks, &starts, |at, gains| {
            let (index, certain) = followed[at];
            // Between two that are proved to be the lowest one is proved, too, or there is another.
            match gains.filter(|gains| gains.certified || !certain) {
                Some(gains) => each(index, &gains)?,
                None => alone.push(index),
            }
            Ok(())
        })?;
        Ok(alone)
    }

    /// The gains at an anchor, kept there as far as the budget goes; `problem` is the anchor's, where it is at hand.
    fn at_anchor(
        &self,
        anchor: usize,
        problem: Option<&Problem>,
        forms: &[Topology],
        solver: &mut Synthesizer,
        cancel: &CancelToken,
    ) -> Result<Vec<Arc<Gains>>, Stopped> {
        let mut found: Vec<Option<Arc<Gains>>> = forms.iter().map(|form| self.anchors.get(anchor, form)).collect();
        let missing: Vec<usize> = (0..forms.len()).filter(|&index| found[index].is_none()).collect();
        if !missing.is_empty() {
            let networks: Vec<Topology> = missing.iter().map(|&index| forms[index].clone()).collect();
            let made;
            let problem = match problem {
                Some(problem) => problem,
                None => {
                    made = self.problem(self.anchors.steps[anchor], cancel)?;
                    &made
                }
            };
            solver.solve_all(problem, &networks, Options::default(), |at, gains| {
                let gains = Arc::new(gains);
                self.keep(anchor, &networks[at], &gains);
                found[missing[at]] = Some(gains);
                Ok(())
            })?;
        }
        Ok(found.into_iter().flatten().collect())
    }

    fn keep(&self, anchor: usize, form: &Topology, gains: &Arc<Gains>) {
        let size = size_of::<Gains>() + size_of_val(gains.rows.as_slice()) + size_of_val(form.words());
        let size = size + size_of::<Topology>();
        if !self.budget.take(size) {
            return;
        }
        let mut known = self.anchors.known[anchor].write().unwrap_or_else(PoisonError::into_inner);
        if known.insert(form.clone(), Arc::clone(gains)).is_some() {
            self.budget.give(size);
        }
    }
}

/// The point between the gains at two anchors, if both are minima of one branch.
fn between(a: &Gains, b: &Gains, share: f64) -> Result<Option<Vec<f64>>, Stopped> {
    // Where no step was to be made the canonical start is the answer, at the instants between, too.
    let sure = |gains: &Gains| gains.status == Status::Converged && !gains.narrow && gains.iterations > 0;
    let mut point = copy("the gains between two instants", &b.rows)?;
    point.iter_mut().zip(&a.rows).for_each(|(x, a)| *x -= a);
    if !sure(a) || !sure(b) || norm(&point) > NEAR * norm(&a.rows) {
        return Ok(None);
    }
    point.iter_mut().zip(&a.rows).for_each(|(x, a)| *x = a + share * *x);
    Ok(Some(point))
}

#[cfg(test)]
mod tests;
