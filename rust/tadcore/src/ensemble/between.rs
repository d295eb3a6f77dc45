//! A chunk between two instants: trials that may have entered a capture radius on the way are looked at one by one.
//!
//! All trials move first, as ever. Then the chord of each row from its state before to its state now tells in a few
//! vector operations who stayed clear, by the largest ‖C‖ among the table's entries at this instant; the few others are
//! examined exactly, by the arithmetic of a recorded run. None of this runs unless it is asked for.

use super::block::{BLOCK, Blocks, PerTrial, playing};
use super::chunk::Chunk;
use super::{Between, End};
use crate::cancel::CancelToken;
use crate::error::RunError;
use crate::network::{Topology, observe};
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
    pub(super) fn note(&mut self, blocks: &Blocks, who: &[u32]) {
        self.before.clone_from(&blocks.z);
        for (place, &trial) in who[..blocks.live].iter().enumerate() {
            self.place[trial as usize] = place as u32;
        }
    }

    /// The state of a trial at that instant.
    fn state(&self, trial: usize, width: usize) -> Vec<f64> {
        let place = self.place[trial] as usize;
        self.before[place / BLOCK * width..][..width].iter().map(|numbers| numbers[place % BLOCK]).collect()
    }
}

impl Chunk<'_> {
    /// Looks at what happened from t_k to now, when every live trial has moved.
    pub(super) fn look(
        &mut self,
        k: usize,
        watch: &mut Watch,
        ends: &mut [End],
        cancel: &CancelToken,
    ) -> Result<(), RunError> {
        let (size, dim) = (self.shape.size, self.shape.dim);
        let (width, step) = (size * dim, self.policy.game().grid().step());
        let stretch = clear(self.policy.transitions().rate(k) * step);
        let mut over = Vec::new();
        for block in 0..self.blocks.live.div_ceil(BLOCK) {
            let places = block * BLOCK..self.blocks.live.min((block + 1) * BLOCK);
            let moved_in = places.clone().any(|place| watch.place[self.who[place] as usize] as usize != place);
            watch.gathered.clear();
            watch.gathered.extend_from_slice(&watch.before[block * width..(block + 1) * width]);
            if moved_in {
                for place in places {
                    let state = watch.state(self.who[place] as usize, width);
                    watch.gathered.iter_mut().zip(state).for_each(|(numbers, x)| numbers[place % BLOCK] = x);
                }
            }
            let now = &self.blocks.z[block * width..(block + 1) * width];
            let capture = &self.blocks.capture[block * self.blocks.capture_step..][..size];
            let bits = near(&watch.gathered, now, capture, dim, stretch) & playing(self.blocks.live, block);
            for member in (0..BLOCK).filter(|member| bits >> member & 1 == 1) {
                if self.examine(k, block * BLOCK + member, watch, ends, cancel)? {
                    over.push(block * BLOCK + member);
                }
            }
        }
        // From the last place down, so that none that moves in is over.
        for &place in over.iter().rev() {
            self.remove(place);
        }
        if !over.is_empty() {
            self.fill_up();
        }
        Ok(())
    }

    /// Examines the step of one trial; whether it is over.
    fn examine(
        &self,
        k: usize,
        place: usize,
        watch: &mut Watch,
        ends: &mut [End],
        cancel: &CancelToken,
    ) -> Result<bool, RunError> {
        let (size, dim, trial) = (self.shape.size, self.shape.dim, self.who[place] as usize);
        let continuous = watch.between.termination == Termination::Continuous;
        let end = &mut ends[trial];
        if !continuous && end.passed {
            return Ok(false);
        }
        let (start, now) = (watch.state(trial, size * dim), self.state(place));
        let sight: Vec<f64> = (0..self.shape.rows)
            .map(|i| self.blocks.sight[place / BLOCK * self.blocks.sight_step + i][place % BLOCK])
            .collect();
        let mut network = Topology::empty(self.shape.rows, size);
        observe(&start, dim, &sight, &mut network);
        let policy = self.policy.at(k, &network, &mut watch.solver, cancel)?;
        let reach = Reach::new(self.batch.capture_row(self.first + trial, size));
        let step = Step { k, gains: &policy.gains.rows, start: &start, end: &now, dim };
        if !continuous {
            let mut passes = Vec::new();
            step.passes(self.policy, &reach, &mut passes, cancel)?;
            end.passed = !passes.is_empty();
            return Ok(false);
        }
        let Some((row, after, ..)) = step.end(self.policy, &reach, cancel)? else { return Ok(false) };
        (end.outcome, end.step, end.after) = (Pass::outcome(row, size - 1), k, after);
        Ok(true)
    }
}
