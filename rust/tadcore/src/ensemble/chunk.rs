//! A chunk of trials in lockstep: all that still play stand at the same grid instant.
//!
//! At every instant the blocks of the chunk move one after another. A trial that is over leaves: the last one takes its
//! place, so the blocks stay full. A block whose topologies are not all in the table waits; when the others have moved,
//! what is missing is solved and the waiting blocks follow.

use super::between::Watch;
use super::block::{BLOCK, Keys, Stop, Sweep};
use super::fates::Played;
use super::scores::Scores;
use super::sweep::sweep_of;
use super::trials::Trials;
use super::{Answers, Batch, Between, End};
use crate::cancel::CancelToken;
use crate::error::{NoMemory, RunError};
use crate::network::Topology;
use crate::policy::Policy;
use crate::policy::filler::Filler;
use crate::policy::step_table::StepTable;
use crate::simd::Width;

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

/// Trials that are played together.
pub(super) struct Chunk<'a> {
    trials: Trials<'a>,
    width: Width,
    sweep: Sweep,
}

impl<'a> Chunk<'a> {
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
        let trials = Trials::new(policy, batch, played, first, trials, width)?;
        Ok(Self { sweep: sweep_of(&trials.shape, trials.blocks.network.as_deref()), trials, width })
    }

    /// Plays every trial to its end.
    pub(super) fn play(
        &mut self,
        between: Between,
        answers: Answers,
        w: &mut Worker,
        cancel: &CancelToken,
    ) -> Result<(), RunError> {
        let Answers { ends, scores, course } = answers;
        let mut scores = match scores {
            [] => None,
            out => Some(Scores::new(&mut self.trials, self.width, course, out)?),
        };
        let mut watch = (between != Between::NOTHING).then(|| Watch::new(between, ends.len()));
        let transitions = self.trials.policy.transitions();
        let last = self.trials.policy.game().grid().steps();
        let (mut lookups, mut misses) = (0, 0);
        for k in 0..last {
            cancel.check()?;
            w.missing.clear();
            w.waiting.clear();
            self.trials.fail(k);
            if let Some(scores) = &mut scores {
                scores.observe(&mut self.trials, k, ends);
            }
            if let Some(watch) = &mut watch {
                watch.note(&self.trials);
            }
            let tables = transitions.step_tables(k, k + 1 < last);
            self.pass(k, &tables.now, tables.next(), ends, w);
            drop(tables);
            lookups += self.trials.blocks.live as u64;
            if !w.waiting.is_empty() {
                w.missing.sort_unstable();
                w.missing.dedup();
                w.local.clear();
                misses += w.filler.fill(self.trials.policy, k, &w.missing, &mut w.local, cancel)?;
                self.follow(k, w)?;
            }
            self.trials.shake(k);
            if let Some(watch) = &mut watch {
                watch.look(&mut self.trials, k, ends, cancel)?;
            }
            if self.trials.blocks.live == 0 {
                break;
            }
        }
        transitions.count(lookups.max(misses), misses);
        match scores {
            Some(scores) => scores.finish(&mut self.trials, last, ends),
            None => self.trials.finish(last, ends),
        }
        Ok(())
    }

    /// Moves every block that can move, and lists those that wait with the topologies they miss.
    fn pass(&mut self, k: usize, table: &StepTable, next: Option<&StepTable>, ends: &mut [End], w: &mut Worker) {
        let mut from = 0;
        loop {
            match (self.sweep)(self.width, &self.trials.shape, &mut self.trials.blocks, from, table, next, &mut w.keys)
            {
                Stop::End => return,
                Stop::Over(block, members) => {
                    self.trials.retire(block, members, k, ends);
                    from = block;
                }
                Stop::Missing(block) => {
                    for member in 0..BLOCK {
                        w.words.clear();
                        w.words.extend(w.keys.iter().map(|word| word[member]));
                        if table.find(&w.words) == 0 {
                            w.missing.push(Topology::from_words(
                                self.trials.shape.rows,
                                self.trials.shape.size,
                                &w.words,
                            ));
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
        let table = self.trials.policy.transitions().step_table(k);
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
        let live = self.trials.blocks.live;
        self.trials.blocks.live = live.min((block + 1) * BLOCK);
        let stop = (self.sweep)(self.width, &self.trials.shape, &mut self.trials.blocks, block, table, None, keys);
        self.trials.blocks.live = live;
        stop == Stop::End
    }
}
