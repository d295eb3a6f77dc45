//! Answers in gains that turn, for recorded runs in the plane.
//!
//! They are functions of (t_k, topology) as scalar ones are, and in a table of their own. Where no gains that turn are
//! lower the answer is that of scalar gains, bitwise. Of two mirror images A ± iB the one is held whose first
//! imaginary part that is not zero is positive, row by row; the other one plays with −Jz in the place of Jz.

use std::borrow::Cow;
use std::sync::Arc;

use super::closed_loop::{self, beside_turned};
use super::exponential::{self, exponential};
use super::table::Table;
use super::{Policy, StepPolicy, symmetry};
use crate::cancel::CancelToken;
use crate::error::Stopped;
use crate::memory::{spare, zeros};
use crate::network::Topology;
use crate::synthesis::{Gains, Synthesizer};

/// Imaginary parts this small beside the largest entry of the gains are rounding.
const ROUNDING: f64 = 1e-8;

/// What the gains of the constrained players are made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum GainKind {
    /// Scalars times the identity.
    #[default]
    Scalar,
    /// Blocks aI + bJ, in the plane; of two mirror images the one whose first b that is not zero is positive.
    Turning,
    /// Their mirror images.
    Mirror,
}

impl StepPolicy {
    /// The rows of the constrained players: on z, or on z and Jz where they turn.
    pub(crate) fn feedback(&self, n: usize) -> Cow<'_, [f64]> {
        let gains = &self.gains;
        if gains.turn.is_empty() { Cow::from(&gains.rows) } else { beside_turned(&gains.rows, &gains.turn, n).into() }
    }
}

impl Gains {
    /// These of a kind: where it is [`GainKind::Mirror`], their mirror image.
    #[must_use]
    pub fn of(mut self, kind: GainKind) -> Self {
        if kind == GainKind::Mirror {
            self.turn.iter_mut().for_each(|b| *b = 0.0 - *b);
        }
        self
    }
}

impl Policy {
    /// The gains of lowest Θ among those that turn at (step, topology), without looking at the table.
    ///
    /// # Errors
    /// [`Stopped`] when there is no memory for them, or `cancel` was raised.
    pub fn turning_gains(
        &self,
        step: usize,
        topology: &Topology,
        solver: &mut Synthesizer,
        cancel: &CancelToken,
    ) -> Result<Gains, Stopped> {
        let (canonical, order) = self.classes.canonical(topology);
        solver.watch(cancel);
        let problem = self.problem(step, cancel)?;
        let scalars = self.solve_form(step, &problem, &canonical, solver, cancel)?;
        let gains = solver.turn(&problem, &canonical, &scalars)?;
        let (rows, mut turn) = (symmetry::back(&order, &gains.rows)?, symmetry::back(&order, &gains.turn)?);
        let largest = rows.iter().chain(&turn).fold(0.0, |most: f64, x| most.max(x.abs()));
        if turn.iter().find(|x| x.abs() > ROUNDING * largest).is_some_and(|&x| x < 0.0) {
            turn.iter_mut().for_each(|x| *x = 0.0 - *x);
        }
        Ok(Gains { rows, turn, ..gains })
    }

    /// The answer at (step, topology) in gains of some kind, from the table or solved now. That of [`GainKind::Mirror`]
    /// is the one of [`GainKind::Turning`], for the other state.
    ///
    /// # Errors
    /// [`Stopped`] when there is no memory for it, or `cancel` was raised.
    pub fn answer(
        &self,
        kind: GainKind,
        step: usize,
        topology: &Topology,
        solver: &mut Synthesizer,
        cancel: &CancelToken,
    ) -> Result<Arc<StepPolicy>, Stopped> {
        if kind == GainKind::Scalar {
            return self.at(step, topology, solver, cancel);
        }
        let table = self.turning_table(cancel)?;
        if let Some(found) = table.get(step, topology) {
            return Ok(found);
        }
        let gains = self.turning_gains(step, topology, solver, cancel)?;
        let entry = if gains.turn.is_empty() {
            self.at(step, topology, solver, cancel)?
        } else {
            Arc::new(self.turning_step(step, gains, cancel)?)
        };
        table.keep(step, topology, &entry, &self.budget);
        Ok(entry)
    }

    fn turning_table(&self, cancel: &CancelToken) -> Result<&Table, Stopped> {
        if self.turning.get().is_none() {
            // Another thread may have been quicker.
            drop(self.turning.set(Table::new(self.table.instants(), cancel)?));
        }
        Ok(self.turning.get().unwrap_or(&self.table))
    }

    fn turning_step(&self, step: usize, gains: Gains, cancel: &CancelToken) -> Result<StepPolicy, Stopped> {
        spare("the answers at all instants")?;
        let n = self.game.size();
        let free = self.free_rows(step).beside_turned();
        let mut c = zeros(exponential::WHAT, 4 * n * n)?;
        closed_loop::matrix(&free, &beside_turned(&gains.rows, &gains.turn, n), &mut c);
        let terms = {
            let problem = self.problem(step, cancel)?;
            problem.turning_terms(self.equilibrium.node(step), &gains.rows, &gains.turn, cancel)?
        };
        let (mut transition, mut attacker) = (zeros(exponential::WHAT, 4 * n * n)?, vec![0.0; 2 * n]);
        exponential(&c, &free.attacker, self.game.grid().step(), &mut transition, &mut attacker, cancel)?;
        transition.truncate(2 * n * n);
        Ok(StepPolicy { gains, terms, transition, attacker })
    }
}
