//! A chunk between two instants: trials that may have entered a capture radius on the way are looked at one by one.
//!
//! All trials move first, as ever. Then the chord of each row from its state before to its state now tells in a few
//! vector operations who stayed clear, by the largest ‖C‖ among the table's entries at this instant; the few others are
//! examined exactly, by the arithmetic of a recorded run. None of this runs unless it is asked for.

use super::block::{BLOCK, PerTrial, playing};
use super::trials::Trials;
use super::{Between, End};
use crate::cancel::CancelToken;
use crate::error::RunError;
use crate::simulation::crossing::{clear, near};
use crate::simulation::passes::Step;
use crate::simulation::{Pass, Reach, Termination};
use crate::synthesis::Synthesizer;

/// What is kept of the instant before, and scratch.
#[derive(Debug)]
pub(super) struct Watch {
    between: Between,
    before: Vec<PerTrial>,
    /// Where each trial stood.
    place: Vec<u32>,
    gathered: Vec<PerTrial>,
    solver: Synthesizer,
}

impl Watch {
    pub(super) fn new(between: Between, trials: usize) -> Self {
        let (before, gathered) = (Vec::new(), Vec::new());
        Self { between, before, place: vec![0; trials], gathered, solver: Synthesizer::new() }
    }

    /// Keeps the states at an instant.
    pub(super) fn note(&mut self, trials: &Trials) {
        self.before.clone_from(&trials.blocks.z);
        for (place, &trial) in trials.who[..trials.blocks.live].iter().enumerate() {
            self.place[trial as usize] = place as u32;
        }
    }

    /// The state of a trial at that instant.
    fn state(&self, trial: usize, width: usize) -> Vec<f64> {
        let place = self.place[trial] as usize;
        self.before[place / BLOCK * width..][..width].iter().map(|numbers| numbers[place % BLOCK]).collect()
    }

    /// Looks at what happened from t_k to now, when every live trial has moved.
    pub(super) fn look(
        &mut self,
        trials: &mut Trials,
        k: usize,
        ends: &mut [End],
        cancel: &CancelToken,
    ) -> Result<(), RunError> {
        let (size, dim) = (trials.shape.size, trials.shape.dim);
        let (width, step) = (size * dim, trials.policy.game().grid().step());
        let stretch = clear(trials.policy.transitions().rate(k) * step);
        let mut over = Vec::new();
        for block in 0..trials.blocks.live.div_ceil(BLOCK) {
            let places = block * BLOCK..trials.blocks.live.min((block + 1) * BLOCK);
            let moved_in = places.clone().any(|place| self.place[trials.who[place] as usize] as usize != place);
            self.gathered.clear();
            self.gathered.extend_from_slice(&self.before[block * width..(block + 1) * width]);
            if moved_in {
                for place in places {
                    let state = self.state(trials.who[place] as usize, width);
                    self.gathered.iter_mut().zip(state).for_each(|(numbers, x)| numbers[place % BLOCK] = x);
                }
            }
            let now = &trials.blocks.z[block * width..(block + 1) * width];
            let capture = &trials.blocks.capture[block * trials.blocks.capture_step..][..size];
            let bits = near(&self.gathered, now, capture, dim, stretch) & playing(trials.blocks.live, block);
            for member in (0..BLOCK).filter(|member| bits >> member & 1 == 1) {
                if self.examine(trials, k, block * BLOCK + member, ends, cancel)? {
                    over.push(block * BLOCK + member);
                }
            }
        }
        // From the last place down, so that none that moves in is over.
        for &place in over.iter().rev() {
            trials.remove(place);
        }
        if !over.is_empty() {
            trials.fill_up();
        }
        Ok(())
    }

    /// Examines the step of one trial; whether it is over.
    fn examine(
        &mut self,
        trials: &Trials,
        k: usize,
        place: usize,
        ends: &mut [End],
        cancel: &CancelToken,
    ) -> Result<bool, RunError> {
        let (size, dim, trial) = (trials.shape.size, trials.shape.dim, trials.who[place] as usize);
        let continuous = self.between.termination == Termination::Continuous;
        let end = &mut ends[trial];
        if !continuous && (end.passed || end.diverged) {
            return Ok(false);
        }
        let (start, now) = (self.state(trial, size * dim), trials.state(place));
        let network = trials.network(place, &start);
        let policy = trials.policy.at(k, &network, &mut self.solver, cancel)?;
        let reach = Reach::new(trials.batch.capture_row(trials.first + trial, size));
        let step = Step { k, gains: &policy.gains.rows, start: &start, end: &now, dim };
        if !continuous {
            let mut passes = Vec::new();
            step.passes(trials.policy, &reach, &mut passes, cancel)?;
            end.passed = !passes.is_empty();
            return Ok(false);
        }
        let Some((row, after, ..)) = step.end(trials.policy, &reach, cancel)? else { return Ok(false) };
        (end.outcome, end.step, end.after) = (Pass::outcome(row, size - 1), k, after);
        Ok(true)
    }
}
