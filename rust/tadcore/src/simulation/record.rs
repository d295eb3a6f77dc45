//! One game, everything recorded.

use super::course::{Course, Moment, Outside, Present};
use super::divergence;
use super::outcome::{Outcome, Reach};
use super::passes::{Pass, Step, Termination};
use super::setup::Setup;
use super::state::{acted_on, apply, relative_state};
use super::world::Chances;
use crate::cancel::CancelToken;
use crate::error::{RunError, Stopped};
use crate::game::Grid;
use crate::game::validation::{BEYOND, rule};
use crate::memory::{MOST_BYTES, append, reserve, spare, within};
use crate::network::{EdgeRule, EdgeState, Topology, observe, squared_reach};
use crate::policy::{GainKind, Policy, StepPolicy, closed_loop::FreeRows};
use crate::synthesis::{Status, Synthesizer};

/// When a run diverged, and how far.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Divergence {
    /// The grid index of the first instant beyond [`divergence::DIVERGED`].
    pub step: usize,
    /// The largest distance to the attacker up to the end, over the largest distance between players at the start; where
    /// the game leaves the range of double precision, a lower bound.
    pub size: f64,
}

/// What asks for memory here.
const WHAT: &str = "the record of one run";

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
    /// [`Termination::Continuous`]. The last row is then the state there, under the feedback of that instant, which is held.
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
pub fn simulate_with(
    policy: &Policy,
    setup: &Setup,
    mut rules: Rules,
    cancel: &CancelToken,
) -> Result<Record, RunError> {
    setup.check(policy.game())?;
    let kind = rules.gains;
    let words = "2: gains turn in the plane alone";
    rule("dim", setup.dim as f64, kind == GainKind::Scalar || setup.dim == 2, words)?;
    rules.edges.check()?;
    if let (Some(chances), Termination::Continuous) = (&rules.chances, rules.termination) {
        chances.world.refuse_between()?;
    }
    let mut present = rules.chances.map(|chances| Present::new(&chances, policy.game(), setup.dim)).transpose()?;
    spare(WHAT)?;
    let game = policy.game();
    let (n, size, m, dim) = (game.n(), game.size(), game.constrained(), setup.dim);
    let reach = Reach::new(setup.capture);
    let sight: Vec<f64> = setup.visibility.iter().map(|&zeta| squared_reach(zeta)).collect();
    let mut z = Vec::with_capacity(size * dim);
    relative_state(setup.positions, dim, &mut z);
    let mut attacker = setup.positions[(n + 1) * dim..].to_vec();
    // The network in force, what is seen of it, and the sight.
    let mut topology = Topology::empty(m, size);
    let (mut seen, mut within_sight) = (topology.clone(), topology.clone());
    let mut edges = (rules.edges != EdgeRule::PAPER)
        .then(|| EdgeState::new(&rules.edges, setup.visibility, size, game.grid().step()));
    let mut solver = Synthesizer::new();
    let mut record = Record {
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
        course: (present.is_some() || rules.outside.is_some()).then(Course::default),
    };
    let last = game.grid().steps();
    let mut next = vec![0.0; size * dim];
    let scale = divergence::scale(&z, dim);
    let (limit, mut most, mut recording) = (divergence::limit(scale), 0.0, true);
    for k in 0..=last {
        cancel.check()?;
        let far = divergence::reach(&z, dim);
        if record.diverged.is_none() && !divergence::within(far, limit) {
            record.diverged = Some(Divergence { step: k, size: 0.0 });
        }
        most = f64::max(most, if divergence::within(far, divergence::LAST) { far } else { divergence::LAST });
        if k > 0 && !divergence::within(far, divergence::LAST) {
            // Nobody is caught any more, and the numbers end.
            record.end = last;
            break;
        }
        let end = reach.ends(&z, dim).or((k == last).then_some(Outcome::Timeout));
        if end.is_none() || k == 0 {
            match &mut edges {
                None => observe(&z, dim, &sight, &mut within_sight),
                Some(edges) => edges.observe(k, &z, dim, &sight, &mut within_sight),
            }
            seen.clone_from(&within_sight);
            topology = match &mut present {
                None => seen.clone(),
                Some(present) => present.network(k, &z, &mut seen),
            };
            if let Some(outside) = &mut rules.outside {
                let (time, positions) = (game.grid().time(k), positions(&z, &attacker, dim));
                let given = outside(&Moment { step: k, time, positions: &positions, seen: &seen });
                topology = given.ok_or(RunError::Network { time })?;
            }
        }
        let step = policy.answer(kind, k, &topology, &mut solver, cancel)?;
        if recording {
            record.push(policy, k, &z, &attacker, &topology, &step)?;
            if let Some(course) = &mut record.course {
                course.push(&seen, present.as_ref())?;
            }
            recording = record.last_row_is_bounded(n + 2);
            if recording {
                record.count(&step);
                record.steps = k;
            } else if record.diverged.is_some() && k > 0 {
                record.pop(n + 2);
            } else {
                return Err(RunError::Range { time: game.grid().time(k) });
            }
        }
        if let Some(outcome) = end {
            (record.outcome, record.end) = (outcome, k);
            break;
        }
        let before = (rules.termination == Termination::Continuous).then(|| attacker.clone());
        // Scalar rows act on the first of it, z alone.
        let from = acted_on(&z, kind);
        advance(&step, &from, dim, &mut next, &mut attacker);
        let (gains, to) = (step.feedback(size), acted_on(&next, kind));
        let width = dim * gains.len() / m;
        let within = Step { k, gains: &gains, start: &from[..width], end: &to[..width], dim };
        match before {
            None if record.diverged.is_some() => {} // a pass says nothing any more
            None if present.as_ref().is_some_and(Present::shakes) => {}
            None => within.passes(policy, &reach, &mut record.passes, cancel)?,
            Some(from) => {
                if let Some((row, after, mut z, moved)) = within.end(policy, &reach, cancel)? {
                    z.truncate(size * dim);
                    let attacker: Vec<f64> = from.iter().zip(moved).map(|(x, d)| x + d).collect();
                    if recording {
                        record.push(policy, k, &z, &attacker, &topology, &step)?;
                        if let Some(course) = &mut record.course {
                            course.push(&seen, present.as_ref())?;
                        }
                        record.certified += usize::from(step.gains.certified);
                        record.steps = k + 1;
                    }
                    (record.outcome, record.after, record.end) = (Pass::outcome(row, n), after, k);
                    break;
                }
            }
        }
        std::mem::swap(&mut z, &mut next);
        if let Some(present) = &mut present {
            let added = present.shake(k, &mut z, &mut attacker);
            if let (true, Some(course)) = (recording, &mut record.course) {
                course.note(added);
            }
        }
    }
    if let Some(diverged) = &mut record.diverged {
        diverged.size = (most / scale).sqrt();
    }
    Ok(record)
}

/// X from z and X_a.
fn positions(z: &[f64], attacker: &[f64], dim: usize) -> Vec<f64> {
    let players = z.chunks_exact(dim).flat_map(|row| row.iter().zip(attacker).map(|(x, a)| x + a));
    players.chain(attacker.iter().copied()).collect()
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

impl Record {
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

    fn last_row_is_bounded(&self, players: usize) -> bool {
        let row = players * self.dim;
        let tails = [&self.positions, &self.controls].map(|all| &all[all.len() - row..]);
        tails.into_iter().flatten().all(|x| x.abs() <= BEYOND) && self.theta.last().is_some_and(|x| x.is_finite())
    }

    /// Takes the last row back.
    fn pop(&mut self, players: usize) {
        let row = players * self.dim;
        let (terms, gains) = (self.terms.len() / self.networks.len(), self.gains.len() / self.networks.len());
        for (all, width) in [(&mut self.positions, row), (&mut self.controls, row), (&mut self.terms, terms)] {
            all.truncate(all.len() - width);
        }
        self.gains.truncate(self.gains.len() - gains);
        self.turn.truncate(self.gains.len());
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

    fn push(
        &mut self,
        policy: &Policy,
        k: usize,
        z: &[f64],
        attacker: &[f64],
        network: &Topology,
        step: &StepPolicy,
    ) -> Result<(), Stopped> {
        let dim = self.dim;
        within(WHAT, self.bytes(policy, k + 1, dim), MOST_BYTES)?;
        if k.is_multiple_of(64) {
            spare(WHAT)?;
        }
        for list in [&mut self.positions, &mut self.controls] {
            reserve(WHAT, list, z.len() + dim)?;
        }
        for list in [&mut self.theta, &mut self.terms] {
            reserve(WHAT, list, 4)?;
        }
        reserve(WHAT, &mut self.networks, 1)?;
        self.positions.extend(positions(z, attacker, dim));
        let FreeRows { attacker: h, target } = policy.free_rows(k);
        let mut velocity = vec![0.0; dim];
        let (state, feedback) = (acted_on(z, self.kind), step.feedback(network.size()));
        let gains = feedback.chunks_exact(feedback.len() / network.rows());
        for row in gains.chain(target.as_deref()).chain(std::iter::once(&h[..])) {
            apply(row, &state, dim, &mut velocity);
            self.controls.extend_from_slice(&velocity);
        }
        self.terms.extend_from_slice(&step.terms);
        self.networks.push(network.clone());
        append(WHAT, &mut self.gains, &step.gains.rows)?;
        if self.kind != GainKind::Scalar {
            let mirror = self.kind == GainKind::Mirror;
            reserve(WHAT, &mut self.turn, step.gains.rows.len())?;
            self.turn.extend(step.gains.turn.iter().map(|&b| if mirror { 0.0 - b } else { b }));
            self.turn.resize(self.gains.len(), 0.0);
        }
        self.theta.push(step.gains.theta);
        Ok(())
    }

    fn count(&mut self, step: &StepPolicy) {
        self.iterations += step.gains.iterations;
        self.unconverged += usize::from(step.gains.status != Status::Converged);
        self.certified += usize::from(step.gains.certified);
    }
}
