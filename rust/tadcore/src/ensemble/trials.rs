//! The trials of a chunk: their states in blocks, which trial stands in which place, and how each ends.

use super::block::{BLOCK, Blocks, PerTrial, Shape};
use super::fates::{Fates, Played};
use super::{Batch, End};
use crate::error::NoMemory;
use crate::memory::grow;
use crate::network::{Topology, observe, squared_reach};
use crate::policy::Policy;
use crate::simd::Width;
use crate::simulation::divergence::{self, within};
use crate::simulation::{Outcome, Reach};

/// What asks for memory here.
const WHAT: &str = "the trials of a batch";

/// Trials of a batch from `first` on; those that still play fill the places from the front.
pub(super) struct Trials<'a> {
    pub(super) policy: &'a Policy,
    pub(super) batch: &'a Batch<'a>,
    pub(super) first: usize,
    pub(super) shape: Shape,
    pub(super) blocks: Blocks,
    /// Which trial of the chunk stands in each place.
    pub(super) who: Vec<u32>,
    /// What a world does to them.
    fates: Option<Fates<'a>>,
}

impl<'a> Trials<'a> {
    /// The trials from `first` on at their initial positions.
    ///
    /// # Errors
    /// [`NoMemory`] where there is none for so many.
    pub(super) fn new(
        policy: &'a Policy,
        batch: &'a Batch<'a>,
        played: Option<&Played<'a>>,
        first: usize,
        trials: usize,
        width: Width,
    ) -> Result<Self, NoMemory> {
        let (size, rows, dim) = (policy.game().size(), policy.game().constrained(), batch.dim);
        let shape = Shape { size, rows, dim, words: (rows * size).div_ceil(64) };
        let blocks = trials.div_ceil(BLOCK);
        let (mut z, mut far) = (Vec::new(), Vec::new());
        grow(WHAT, &mut z, blocks * size * dim, [0.0; BLOCK])?;
        grow(WHAT, &mut far, blocks, [0.0; BLOCK])?;
        for place in 0..blocks * BLOCK {
            // Places past the last trial repeat the first of their block, so that they ask for nothing new.
            let trial = if place < trials { place } else { place / BLOCK * BLOCK };
            let row = batch.position(first + trial, size + 1);
            let (players, attacker) = row.split_at(size * dim);
            let numbers = &mut z[place / BLOCK * size * dim..][..size * dim];
            for (e, (of_trials, x)) in numbers.iter_mut().zip(players).enumerate() {
                of_trials[place % BLOCK] = x - attacker[e % dim];
            }
        }
        let (sight, sight_step) = reaches(batch.visibility, rows, first, trials);
        let (capture, capture_step) = reaches(batch.capture, size, first, trials);
        let who: Vec<u32> = (0..trials as u32).collect();
        let mut blocks = Blocks { z, sight, capture, far, sight_step, capture_step, network: None, live: trials };
        let steps = policy.game().grid().steps();
        let fates =
            played.map(|played| Fates::new(played, first, trials, steps, shape, width, &mut blocks)).transpose()?;
        let mut of_chunk = Self { policy, batch, first, shape, blocks, who, fates };
        for place in 0..of_chunk.blocks.far.len() * BLOCK {
            let scale = divergence::scale(&of_chunk.state(place), dim);
            of_chunk.blocks.far[place / BLOCK][place % BLOCK] = divergence::limit(scale);
        }
        of_chunk.fill_up();
        Ok(of_chunk)
    }

    /// Moves what fails on to t_k.
    pub(super) fn fail(&mut self, k: usize) {
        if let Some(fates) = &mut self.fates
            && fates.fail(k, &mut self.blocks)
        {
            self.fill_up();
        }
    }

    /// Shakes every trial after its step from t_k.
    pub(super) fn shake(&mut self, k: usize) {
        if let Some(fates) = &mut self.fates {
            fates.shake(k, &self.who, &mut self.blocks);
        }
    }

    /// The network in force in one place, had the trial there the state `z`.
    pub(super) fn network(&self, place: usize, z: &[f64]) -> Topology {
        let sight: Vec<f64> = (0..self.shape.rows)
            .map(|i| self.blocks.sight[place / BLOCK * self.blocks.sight_step + i][place % BLOCK])
            .collect();
        if let Some(fates) = &self.fates {
            return fates.network(place, z, &sight, &self.blocks);
        }
        let mut network = Topology::empty(self.shape.rows, self.shape.size);
        observe(z, self.shape.dim, &sight, &mut network);
        network
    }

    /// The state of the trial in one place, row by row.
    pub(super) fn state(&self, place: usize) -> Vec<f64> {
        let width = self.shape.size * self.shape.dim;
        self.blocks.z[place / BLOCK * width..][..width].iter().map(|numbers| numbers[place % BLOCK]).collect()
    }

    /// How the trial in one place ends at its present state, if it does.
    fn outcome(&self, place: usize) -> Option<Outcome> {
        let trial = self.first + self.who[place] as usize;
        Reach::new(self.batch.capture_row(trial, self.shape.size)).ends(&self.state(place), self.shape.dim)
    }

    /// Whether the trial in one place is over at t_k, and how; notes that it diverged, which is no end.
    fn ends(&mut self, place: usize, k: usize, end: &mut End) -> bool {
        let last = self.policy.game().grid().steps();
        let far = divergence::reach(&self.state(place), self.shape.dim);
        let limit = self.blocks.far[place / BLOCK][place % BLOCK];
        if !within(far, limit) {
            end.diverged = true;
            self.blocks.far[place / BLOCK][place % BLOCK] = divergence::LAST;
        }
        // Where the numbers end nobody is caught any more.
        let outcome = if within(far, divergence::LAST) { self.outcome(place) } else { Some(Outcome::Timeout) };
        end.step = if outcome == Some(Outcome::Timeout) { last } else { k };
        end.outcome = outcome.unwrap_or(Outcome::Timeout);
        outcome.is_some()
    }

    /// Looks at the trials in `members` of a block, and takes those out that are over; the last ones take their places.
    pub(super) fn retire(&mut self, block: usize, members: u32, k: usize, ends: &mut [End]) {
        // From the highest member down, so that a trial that moves in has not been looked at.
        for member in (0..BLOCK).rev().filter(|member| members >> member & 1 == 1) {
            let place = block * BLOCK + member;
            if !self.ends(place, k, &mut ends[self.who[place] as usize]) {
                continue;
            }
            self.remove(place);
        }
        self.fill_up();
    }

    /// Takes the trial in one place out; the last one moves in.
    pub(super) fn remove(&mut self, place: usize) {
        self.blocks.live -= 1;
        let last = self.blocks.live;
        if let Some(fates) = &mut self.fates {
            fates.moved(self.who[place], self.who[last], place);
        }
        self.who[place] = self.who[last];
        self.blocks.copy(&self.shape, last, place);
    }

    pub(super) fn fill_up(&mut self) {
        // Places past the last trial repeat the first of their block.
        let live = self.blocks.live;
        for place in live..live.next_multiple_of(BLOCK) {
            self.blocks.copy(&self.shape, live / BLOCK * BLOCK, place);
        }
    }

    /// The trials that are left at T: caught in the last instant, or out of time.
    pub(super) fn finish(&mut self, last: usize, ends: &mut [End]) {
        for place in 0..self.blocks.live {
            self.ends(place, last, &mut ends[self.who[place] as usize]);
        }
    }
}

/// Squared reaches of `width` radii a trial in blocks, and how many lie from block to block: none where all share one row.
fn reaches(radii: &[f64], width: usize, first: usize, trials: usize) -> (Vec<PerTrial>, usize) {
    if radii.len() == width {
        return (radii.iter().map(|&radius| [squared_reach(radius); BLOCK]).collect(), 0);
    }
    let mut numbers = vec![[0.0; BLOCK]; trials.div_ceil(BLOCK) * width];
    for place in 0..trials.next_multiple_of(BLOCK) {
        let trial = first + if place < trials { place } else { place / BLOCK * BLOCK };
        for (e, &radius) in radii[trial * width..(trial + 1) * width].iter().enumerate() {
            numbers[place / BLOCK * width + e][place % BLOCK] = squared_reach(radius);
        }
    }
    (numbers, width)
}
