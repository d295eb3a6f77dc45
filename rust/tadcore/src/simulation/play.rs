//! One game, played from instant to instant and recorded.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | z(t_k), X_a(t_k) | `Play::z`, `Play::attacker` | the state relative to the attacker; the attacker's position |
//! | exp(Cδ) | [`StepPolicy::transition`] | z(t_{k+1}) = exp(Cδ) z(t_k) |
//! | the network at t_k | `InForce::network` | sight, less what fails, with what is told; or from outside |

use std::ops::ControlFlow;

use super::course::{Course, Moment, Outside, Present, WHAT};
use super::divergence::Excursion;
use super::outcome::{Outcome, Reach};
use super::passes::{Pass, Step, Termination};
use super::record::{Record, Row};
use super::setup::Setup;
use super::state::{acted_on, apply, positions, relative_state};
use super::world::Chances;
use crate::cancel::CancelToken;
use crate::error::RunError;
use crate::game::validation::rule;
use crate::memory::spare;
use crate::network::{EdgeRule, EdgeState, Topology, observe, squared_reach};
use crate::policy::{GainKind, Policy, StepPolicy};
use crate::synthesis::Synthesizer;

/// What a run is given besides positions and radii; by default nothing, as in the paper.
#[derive(Default)]
pub struct Rules<'a> {
    /// When edges form and break.
    pub edges: EdgeRule,
    /// When the game ends.
    pub termination: Termination,
    /// What the gains are made of.
    pub gains: GainKind,
    /// A world, and which of its trials.
    pub chances: Option<Chances<'a>>,
    /// A network from outside, in the place of what is seen.
    pub outside: Option<Box<Outside<'a>>>,
}

impl Rules<'_> {
    /// Checks the rules by themselves, and that they go together with each other and with `dim` axes.
    fn check(&self, dim: usize) -> Result<(), RunError> {
        let words = "2: gains turn in the plane alone";
        rule("dim", dim as f64, self.gains == GainKind::Scalar || dim == 2, words)?;
        self.edges.check()?;
        if let (Some(chances), Termination::Continuous) = (&self.chances, self.termination) {
            chances.world.refuse_between()?;
        }
        Ok(())
    }
}

/// Runs one game and records everything.
///
/// # Errors
/// [`RunError`] for positions or radii that break a rule, for a game that leaves the range of double precision without
/// having diverged, or when the caller cancelled.
pub fn simulate(policy: &Policy, setup: &Setup, cancel: &CancelToken) -> Result<Record, RunError> {
    simulate_with(policy, setup, Rules::default(), cancel)
}

/// The same by other rules.
///
/// # Errors
/// [`RunError`] for positions, radii or rules that cannot be accepted, where a network from outside could not be given, or
/// when the caller cancelled.
pub fn simulate_with(policy: &Policy, setup: &Setup, rules: Rules, cancel: &CancelToken) -> Result<Record, RunError> {
    let mut play = Play::new(policy, setup, rules, cancel)?;
    for k in 0..=policy.game().grid().steps() {
        cancel.check()?;
        if play.instant(k)?.is_break() {
            break;
        }
    }
    play.record.diverged = play.excursion.divergence();
    Ok(play.record)
}

/// The network in force at an instant, and what it comes from.
struct InForce<'a> {
    /// Squared visibility radii of the constrained players.
    sight: Vec<f64>,
    edges: Option<EdgeState>,
    present: Option<Present>,
    outside: Option<Box<Outside<'a>>>,
    /// Edges within sight, by the rule of edges.
    within_sight: Topology,
    /// What failures leave of them.
    seen: Topology,
    /// What becomes of that by links, or from outside.
    network: Topology,
}

impl InForce<'_> {
    /// Brings all of it to the instant t_k = `time`.
    fn advance(&mut self, k: usize, time: f64, z: &[f64], attacker: &[f64]) -> Result<(), RunError> {
        let dim = attacker.len();
        match &mut self.edges {
            None => observe(z, dim, &self.sight, &mut self.within_sight),
            Some(edges) => edges.observe(k, z, dim, &self.sight, &mut self.within_sight),
        }
        self.seen.clone_from(&self.within_sight);
        self.network = match &mut self.present {
            None => self.seen.clone(),
            Some(present) => present.network(k, z, &mut self.seen),
        };
        if let Some(outside) = &mut self.outside {
            let positions: Vec<f64> = positions(z, attacker).collect();
            let moment = Moment { step: k, time, positions: &positions, seen: &self.seen };
            self.network = outside(&moment).ok_or(RunError::Network { time })?;
        }
        Ok(())
    }

    fn row<'a>(&'a self, z: &'a [f64], attacker: &'a [f64], step: &'a StepPolicy) -> Row<'a> {
        Row { z, attacker, step, network: &self.network, seen: &self.seen, present: self.present.as_ref() }
    }
}

/// A game that is being played.
struct Play<'a> {
    policy: &'a Policy,
    kind: GainKind,
    termination: Termination,
    reach: Reach,
    in_force: InForce<'a>,
    solver: Synthesizer,
    cancel: &'a CancelToken,
    z: Vec<f64>,
    /// Where the next z is written.
    next: Vec<f64>,
    attacker: Vec<f64>,
    excursion: Excursion,
    record: Record,
    /// Whether rows are recorded still: not once a game that diverged leaves the range of double precision.
    recording: bool,
}

impl<'a> Play<'a> {
    /// The game before its first instant, everything checked.
    fn new(policy: &'a Policy, setup: &Setup, rules: Rules<'a>, cancel: &'a CancelToken) -> Result<Self, RunError> {
        let (game, dim) = (policy.game(), setup.dim);
        setup.check(game)?;
        rules.check(dim)?;
        let present = rules.chances.map(|chances| Present::new(&chances, game, dim)).transpose()?;
        spare(WHAT)?;
        let (size, none) = (game.size(), Topology::empty(game.constrained(), game.size()));
        let mut z = Vec::with_capacity(size * dim);
        relative_state(setup.positions, dim, &mut z);
        let in_force = InForce {
            sight: setup.visibility.iter().map(|&zeta| squared_reach(zeta)).collect(),
            edges: (rules.edges != EdgeRule::PAPER)
                .then(|| EdgeState::new(&rules.edges, setup.visibility, size, game.grid().step())),
            present,
            outside: rules.outside,
            within_sight: none.clone(),
            seen: none.clone(),
            network: none,
        };
        let course = (in_force.present.is_some() || in_force.outside.is_some()).then(Course::default);
        Ok(Self {
            policy,
            kind: rules.gains,
            termination: rules.termination,
            reach: Reach::new(setup.capture),
            in_force,
            solver: Synthesizer::new(),
            cancel,
            next: vec![0.0; size * dim],
            attacker: setup.positions[size * dim..].to_vec(),
            excursion: Excursion::from_start(&z, dim),
            z,
            record: Record::empty(dim, rules.gains, course),
            recording: true,
        })
    }

    /// What happens at t_k, and the step from there; breaks where the game ends.
    fn instant(&mut self, k: usize) -> Result<ControlFlow<()>, RunError> {
        let (grid, dim) = (self.policy.game().grid(), self.record.dim);
        let last = grid.steps();
        if !self.excursion.note(k, &self.z, dim) && k > 0 {
            // Nobody is caught any more, and the numbers end.
            self.record.end = last;
            return Ok(ControlFlow::Break(()));
        }
        let end = self.reach.ends(&self.z, dim).or((k == last).then_some(Outcome::Timeout));
        if end.is_none() || k == 0 {
            self.in_force.advance(k, grid.time(k), &self.z, &self.attacker)?;
        }
        let step = self.policy.answer(self.kind, k, &self.in_force.network, &mut self.solver, self.cancel)?;
        if self.recording {
            self.record_instant(k, &step)?;
        }
        if let Some(outcome) = end {
            (self.record.outcome, self.record.end) = (outcome, k);
            return Ok(ControlFlow::Break(()));
        }
        self.step(k, &step)
    }

    /// Adds the row of t_k; takes it back, and records no more, where its numbers are out of range.
    fn record_instant(&mut self, k: usize, step: &StepPolicy) -> Result<(), RunError> {
        self.record.push(self.policy, k, &self.in_force.row(&self.z, &self.attacker, step))?;
        self.recording = self.record.last_row_is_bounded();
        if self.recording {
            self.record.count(step);
            self.record.steps = k;
        } else if self.excursion.has_diverged() && k > 0 {
            self.record.pop();
        } else {
            return Err(RunError::Range { time: self.policy.game().grid().time(k) });
        }
        Ok(())
    }

    /// The motion from t_k to t_{k+1}, and what happens between the two; breaks where the continuous game ends there.
    fn step(&mut self, k: usize, step: &StepPolicy) -> Result<ControlFlow<()>, RunError> {
        let (policy, dim) = (self.policy, self.record.dim);
        let before = (self.termination == Termination::Continuous).then(|| self.attacker.clone());
        // Scalar rows act on the first of it, z alone.
        let from = acted_on(&self.z, self.kind);
        advance(step, &from, dim, &mut self.next, &mut self.attacker);
        let (gains, to) = (step.feedback(policy.game().size()), acted_on(&self.next, self.kind));
        let width = dim * gains.len() / policy.game().constrained();
        let within = Step { k, gains: &gains, start: &from[..width], end: &to[..width], dim };
        match before {
            None if self.excursion.has_diverged() => {} // a pass says nothing any more
            None if self.in_force.present.as_ref().is_some_and(Present::shakes) => {}
            None => within.passes(policy, &self.reach, &mut self.record.passes, self.cancel)?,
            Some(before) => {
                if let Some((row, after, z, moved)) = within.end(policy, &self.reach, self.cancel)? {
                    let attacker: Vec<f64> = before.iter().zip(moved).map(|(x, d)| x + d).collect();
                    if self.recording {
                        let z = &z[..self.z.len()];
                        self.record.push(policy, k, &self.in_force.row(z, &attacker, step))?;
                        self.record.certified += usize::from(step.gains.certified);
                        self.record.steps = k + 1;
                    }
                    let outcome = Pass::outcome(row, policy.game().n());
                    (self.record.outcome, self.record.after, self.record.end) = (outcome, after, k);
                    return Ok(ControlFlow::Break(()));
                }
            }
        }
        std::mem::swap(&mut self.z, &mut self.next);
        if let Some(present) = &mut self.in_force.present {
            let added = present.shake(k, &mut self.z, &mut self.attacker);
            if let (true, Some(course)) = (self.recording, &mut self.record.course) {
                course.note(added);
            }
        }
        Ok(ControlFlow::Continue(()))
    }
}

/// z ← exp(Cδ) z, and the attacker by its own row.
fn advance(step: &StepPolicy, z: &[f64], dim: usize, next: &mut [f64], attacker: &mut [f64]) {
    let size = step.attacker.len();
    for (row, out) in step.transition.chunks_exact(size).zip(next.chunks_exact_mut(dim)) {
        apply(row, z, dim, out);
    }
    let mut moved = vec![0.0; dim];
    apply(&step.attacker, z, dim, &mut moved);
    attacker.iter_mut().zip(moved).for_each(|(x, d)| *x += d);
}
