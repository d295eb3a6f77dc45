//! A chunk of trials in lockstep: all that still play stand at the same grid instant.
//!
//! At every instant the blocks of the chunk move one after another. A trial that is over leaves: the last one takes its
//! place, so the blocks stay full. A block whose topologies are not all in the table waits; when the others have moved,
//! what is missing is solved and the waiting blocks follow.

use super::between::Watch;
use super::block::{BLOCK, Blocks, Keys, PerTrial, Shape, Stop, Sweep};
use super::sweep::sweep_of;
use super::{Batch, Between, End};
use crate::cancel::CancelToken;
use crate::error::{NoMemory, RunError};
use crate::network::{Topology, squared_reach};
use crate::policy::Policy;
use crate::policy::filler::Filler;
use crate::policy::step_table::StepTable;
use crate::simd::Width;
use crate::simulation::divergence::{self, within};
use crate::simulation::{Outcome, Reach};

/// The scratch of one worker, reused from chunk to chunk.
#[derive(Debug)]
pub(super) struct Worker {
    filler: Filler,
    local: StepTable,
    keys: Keys,
    /// The words of one key.
    words: Vec<u64>,
    missing: Vec<Topology>,
    waiting: Vec<usize>,
}

impl Worker {
    pub(super) fn new(policy: &Policy) -> Self {
        let (rows, size) = (policy.game().constrained(), policy.game().size());
        Self {
            filler: Filler::default(),
            local: StepTable::new(rows, size),
            keys: vec![[0; BLOCK]; (rows * size).div_ceil(64)],
            words: Vec::new(),
            missing: Vec::new(),
            waiting: Vec::new(),
        }
    }
}

/// Trials `first..first + ends.len()` of a batch.
pub(super) struct Chunk<'a> {
    pub(super) policy: &'a Policy,
    pub(super) batch: &'a Batch<'a>,
    pub(super) first: usize,
    pub(super) shape: Shape,
    width: Width,
    sweep: Sweep,
    pub(super) blocks: Blocks,
    /// Which trial of the chunk stands in each place.
    pub(super) who: Vec<u32>,
}

impl<'a> Chunk<'a> {
    /// The trials from `first` on at their initial positions.
    pub(super) fn new(policy: &'a Policy, batch: &'a Batch<'a>, first: usize, trials: usize, width: Width) -> Self {
        let (size, rows, dim) = (policy.game().size(), policy.game().constrained(), batch.dim);
        let shape = Shape { size, rows, dim, words: (rows * size).div_ceil(64) };
        let blocks = trials.div_ceil(BLOCK);
        let mut z = vec![[0.0; BLOCK]; blocks * size * dim];
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
        let who = (0..trials as u32).collect();
        let far = vec![[0.0; BLOCK]; blocks];
        let blocks = Blocks { z, sight, capture, far, sight_step, capture_step, live: trials };
        let mut chunk = Self { policy, batch, first, shape, width, sweep: sweep_of(&shape), blocks, who };
        for place in 0..chunk.blocks.far.len() * BLOCK {
            let scale = divergence::scale(&chunk.state(place), dim);
            chunk.blocks.far[place / BLOCK][place % BLOCK] = divergence::limit(scale);
        }
        chunk
    }

    /// Plays every trial to its end.
    pub(super) fn play(
        &mut self,
        between: Between,
        ends: &mut [End],
        w: &mut Worker,
        cancel: &CancelToken,
    ) -> Result<(), RunError> {
        let mut watch = (between != Between::NOTHING).then(|| Watch::new(between, ends.len()));
        let transitions = self.policy.transitions();
        let last = self.policy.game().grid().steps();
        let (mut lookups, mut misses) = (0, 0);
        for k in 0..last {
            cancel.check()?;
            w.missing.clear();
            w.waiting.clear();
            if let Some(watch) = &mut watch {
                watch.note(&self.blocks, &self.who);
            }
            let next = (k + 1 < last).then(|| transitions.step_table(k + 1));
            self.pass(k, &transitions.step_table(k), next.as_deref(), ends, w);
            drop(next);
            lookups += self.blocks.live as u64;
            if !w.waiting.is_empty() {
                w.missing.sort_unstable();
                w.missing.dedup();
                w.local.clear();
                misses += w.filler.fill(self.policy, k, &w.missing, &mut w.local, cancel)?;
                self.follow(k, w)?;
            }
            if let Some(watch) = &mut watch {
                self.look(k, watch, ends, cancel)?;
            }
            if self.blocks.live == 0 {
                break;
            }
        }
        transitions.count(lookups.max(misses), misses);
        self.finish(last, ends);
        Ok(())
    }

    /// Moves every block that can move, and lists those that wait with the topologies they miss.
    fn pass(&mut self, k: usize, table: &StepTable, next: Option<&StepTable>, ends: &mut [End], w: &mut Worker) {
        let mut from = 0;
        loop {
            match (self.sweep)(self.width, &self.shape, &mut self.blocks, from, table, next, &mut w.keys) {
                Stop::End => return,
                Stop::Over(block, members) => {
                    self.retire(block, members, k, ends);
                    from = block;
                }
                Stop::Missing(block) => {
                    for member in 0..BLOCK {
                        w.words.clear();
                        w.words.extend(w.keys.iter().map(|word| word[member]));
                        if table.find(&w.words) == 0 {
                            w.missing.push(Topology::from_words(self.shape.rows, self.shape.size, &w.words));
                        }
                    }
                    w.waiting.push(block);
                    from = block + 1;
                }
            }
        }
    }

    /// Moves the blocks that waited, from the table or, past the table's budget, from what this worker just solved.
    fn follow(&mut self, k: usize, w: &mut Worker) -> Result<(), NoMemory> {
        let table = self.policy.transitions().step_table(k);
        for &block in &w.waiting {
            if self.alone(block, &table, &mut w.keys) {
                continue;
            }
            for member in 0..BLOCK {
                w.words.clear();
                w.words.extend(w.keys.iter().map(|word| word[member]));
                if w.local.find(&w.words) == 0 {
                    let held = table.find(&w.words) as usize;
                    w.local.insert(&w.words, None, table.matrix(held))?;
                }
            }
            let moved = self.alone(block, &w.local, &mut w.keys);
            debug_assert!(moved, "a block misses what was just solved");
        }
        Ok(())
    }

    /// Moves one block, if the table holds all it needs.
    fn alone(&mut self, block: usize, table: &StepTable, keys: &mut Keys) -> bool {
        let live = self.blocks.live;
        self.blocks.live = live.min((block + 1) * BLOCK);
        let stop = (self.sweep)(self.width, &self.shape, &mut self.blocks, block, table, None, keys);
        self.blocks.live = live;
        stop == Stop::End
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
    fn retire(&mut self, block: usize, members: u32, k: usize, ends: &mut [End]) {
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
    fn finish(&mut self, last: usize, ends: &mut [End]) {
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
