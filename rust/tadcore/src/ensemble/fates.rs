//! What a world does to the trials of a chunk: what fails, who is told, who is shaken; the draws of recorded runs.
//!
//! A trial's chains stay with its number; the masks stand in its place, beside its state. Between flips nothing is done
//! but to compare: every place knows the step of its next.

use super::block::{BLOCK, Shape};
use super::noise::Noise;
use crate::error::NoMemory;
use crate::memory::{MOST_BYTES, grow, reserve_exact, within};
use crate::network::{Links, Topology, observe};
use crate::random::{Draws, NEVER, Walk};
use crate::simd::Width;
use crate::simulation::{Chances, Conditions};
use tadcore_kernels::ensemble::block::Blocks;
use tadcore_kernels::ensemble::network::{Network, Relay, Rule, Words};

/// What asks for memory here.
const WHAT: &str = "what fails and who is told in the trials of a batch";

/// A world, as the trials of a batch meet it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Played<'a> {
    pub(super) chances: Chances<'a>,
    pub(super) conditions: &'a Conditions,
}

/// What happens to the trials of a chunk.
pub(super) struct Fates<'a> {
    conditions: &'a Conditions,
    chances: Chances<'a>,
    /// How many trials of the batch come before the chunk.
    first: u64,
    shape: Shape,
    /// Edges and links, all up.
    all_up: (Topology, Topology),
    /// The chains of each trial.
    walks: Vec<Walk>,
    /// The step of the next flip in each place.
    due: Vec<i32>,
    noise: Option<Noise>,
}

/// The links of a team as the rule of a relay.
struct Told {
    links: Links,
    rows: usize,
    size: usize,
}

impl Rule for Told {
    fn told(&mut self, seen: &[u64], heard: &[u64], told: &mut [u64]) {
        let (seen, heard) =
            (Topology::from_words(self.rows, self.size, seen), Topology::from_words(self.rows, self.rows, heard));
        told.copy_from_slice(self.links.told(&seen, &heard).words());
    }
}

impl<'a> Fates<'a> {
    /// Of the trials from `first` on, at step 0; gives the blocks what comes between sight and network.
    ///
    /// # Errors
    /// [`NoMemory`] where there is none for the chains of all these trials.
    pub(super) fn new(
        played: &Played<'a>,
        first: usize,
        who: &[u32],
        shape: Shape,
        width: Width,
        blocks: &mut Blocks,
    ) -> Result<Self, NoMemory> {
        let Played { conditions, chances } = *played;
        let failures = &conditions.failures;
        let count = blocks.far.len();
        let edges = Topology::complete(shape.rows, shape.size);
        let links = Topology::from_fn(shape.rows, shape.rows, |i, j| i != j);
        let chains = who.len() * failures.len();
        // A relay keeps the words of what was seen, heard and told last, too: asked for here, and given back.
        let all = size_of::<Words>() * count * (3 * edges.words().len() + 2 * links.words().len());
        within(WHAT, (chains * size_of::<Walk>() + all) as u128, MOST_BYTES)?;
        reserve_exact(WHAT, &mut Vec::<u8>::new(), all)?;
        let words = |all: &Topology| -> Result<Vec<Words>, NoMemory> {
            let mut list = Vec::new();
            reserve_exact(WHAT, &mut list, count * all.words().len())?;
            for _ in 0..count {
                list.extend(all.words().iter().map(|&word| [word; BLOCK]));
            }
            Ok(list)
        };
        let relay = match &conditions.links {
            None => None,
            Some(talk) => {
                let rule = Box::new(Told { links: talk.clone(), rows: shape.rows, size: shape.size });
                Some(Relay::new(&shape, talk.reach(), count, words(&links)?, rule))
            }
        };
        let up = if failures.blind() { words(&edges)? } else { Vec::new() };
        blocks.network = (relay.is_some() || !up.is_empty()).then(|| Box::new(Network::new(width, shape, up, relay)));
        let (mut walks, mut due) = (Vec::new(), Vec::new());
        grow(WHAT, &mut walks, chains, Walk::default())?;
        grow(WHAT, &mut due, count * BLOCK, NEVER)?;
        let mut fates = Self {
            conditions,
            chances,
            first: first as u64,
            shape,
            all_up: (edges, links),
            walks,
            due,
            noise: conditions.spread.as_ref().map(|spread| Noise::new(spread, shape, chances.seed, width)),
        };
        for (place, &trial) in who.iter().enumerate() {
            let draws = fates.draws(trial);
            fates.due[place] = failures.begin(&draws, fates.own(trial));
            fates.write(place, trial, blocks);
        }
        Ok(fates)
    }

    fn draws(&self, trial: u32) -> Draws {
        self.chances.draws(self.first + u64::from(trial))
    }

    /// The chains of one trial.
    fn own(&mut self, trial: u32) -> &mut [Walk] {
        let chains = self.conditions.failures.len();
        &mut self.walks[trial as usize * chains..][..chains]
    }

    /// Moves what fails on to step k; whether anything changed in the last block.
    pub(super) fn fail(&mut self, k: usize, who: &[u32], blocks: &mut Blocks) -> bool {
        let (k, live) = (k as i32, blocks.live);
        let mut last = false;
        for block in 0..live.div_ceil(BLOCK) {
            let due = &self.due[block * BLOCK..][..BLOCK];
            if due.iter().fold(NEVER, |least, &due| least.min(due)) > k {
                continue;
            }
            for place in block * BLOCK..live.min((block + 1) * BLOCK) {
                if self.due[place] <= k {
                    let (draws, failures) = (self.draws(who[place]), &self.conditions.failures);
                    self.due[place] = failures.advance(&draws, k, self.own(who[place]));
                    self.write(place, who[place], blocks);
                    last = block == live / BLOCK;
                }
            }
        }
        last
    }

    /// Writes what is up for a trial beside its state.
    fn write(&mut self, place: usize, trial: u32, blocks: &mut Blocks) {
        let Some(network) = blocks.network.as_mut().filter(|_| !self.conditions.failures.is_empty()) else { return };
        let (mut edges, mut links) = self.all_up.clone();
        let failures = &self.conditions.failures;
        let chains = failures.len();
        failures.mask(&self.walks[trial as usize * chains..][..chains], &mut edges, &mut links);
        let relay = network.relay.as_mut().map(|relay| (&mut relay.up, links.words()));
        for (all, words) in
            relay.into_iter().chain([(&mut network.up, edges.words())]).filter(|(all, _)| !all.is_empty())
        {
            for (w, &word) in words.iter().enumerate() {
                all[place / BLOCK * words.len() + w][place % BLOCK] = word;
            }
        }
    }

    /// The trial in the last place moves to another one.
    pub(super) fn copy(&mut self, from: usize, to: usize) {
        self.due[to] = self.due[from];
    }

    /// Shakes all trials after the step from t_k.
    pub(super) fn shake(&mut self, k: usize, who: &[u32], blocks: &mut Blocks) {
        if let Some(noise) = &mut self.noise {
            noise.add(k, self.chances.trial + self.first, who, blocks);
        }
    }

    /// The network in force in one place, at the state `z`, with squared visibility radii `sight`.
    pub(super) fn network(&self, place: usize, z: &[f64], sight: &[f64], blocks: &Blocks) -> Topology {
        let Shape { rows, size, dim, .. } = self.shape;
        let of = |all: &[Words], rows: usize, size: usize| {
            let count = (rows * size).div_ceil(64);
            let words: Vec<u64> =
                all[place / BLOCK * count..][..count].iter().map(|word| word[place % BLOCK]).collect();
            Topology::from_words(rows, size, &words)
        };
        let mut seen = Topology::empty(rows, size);
        observe(z, dim, sight, &mut seen);
        let Some(network) = &blocks.network else { return seen };
        if !network.up.is_empty() {
            seen.keep(&of(&network.up, rows, size));
        }
        let (Some(relay), Some(links)) = (&network.relay, &self.conditions.links) else { return seen };
        let mut heard = Topology::empty(rows, rows);
        links.heard(z, dim, &mut heard);
        heard.keep(&of(&relay.up, rows, rows));
        links.told(&seen, &heard)
    }
}
