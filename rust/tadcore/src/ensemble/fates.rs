//! What a world does to the trials of a chunk: what fails, who is told, who is shaken; the draws of recorded runs.
//!
//! A trial's chains stay with its number; the masks stand in its place, beside its state. A chain is touched at its flips
//! alone: the [`Agenda`] has each under the step of its next, and the flips of a step are drawn side by side.

use super::agenda::Agenda;
use super::block::{BLOCK, Shape};
use super::flips::Flips;
use super::lineages::{Lineages, Numbers};
use super::noise::Noise;
use crate::error::NoMemory;
use crate::memory::{MOST_BYTES, reserve_exact, within};
use crate::network::{Failures, Kind, Links, Topology, observe};
use crate::simd::Width;
use crate::simulation::{Chances, Conditions};
use tadcore_kernels::ensemble::block::Blocks;
use tadcore_kernels::ensemble::network::{Network, Relay, Rule, Words, link};

/// What asks for memory here.
const WHAT: &str = "what fails and who is told in the trials of a batch";

/// A world, as the trials of a batch meet it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Played<'a> {
    pub(super) chances: Chances<'a>,
    pub(super) conditions: &'a Conditions,
    /// Whose draws each row has, where that is not the trial of its number.
    pub(super) lineages: Option<Lineages<'a>>,
}

/// What happens to the trials of a chunk.
pub(super) struct Fates<'a> {
    conditions: &'a Conditions,
    /// The trials whose draws its rows have.
    numbers: Numbers,
    shape: Shape,
    failing: Option<Failing>,
    noise: Option<Noise>,
}

/// What fails, and when.
struct Failing {
    /// What the flip of a chain changes.
    targets: Vec<Target>,
    flips: Flips,
    agenda: Agenda,
    /// Where each trial of the chunk stands; [`GONE`] where it is over.
    places: Vec<u32>,
}

/// The place of a trial that is over.
const GONE: u32 = u32::MAX;

/// What the flip of a chain changes: bits of words, mostly of one.
struct Target {
    part: Part,
    words: Vec<(usize, u64)>,
}

/// Which of a network's masks.
#[derive(Clone, Copy, PartialEq)]
enum Part {
    Sensors,
    Edges,
    Links,
}

impl Target {
    fn new(kind: Kind, shape: &Shape) -> Self {
        let (part, bits) = match kind {
            Kind::Sensor(i) => (Part::Sensors, i * shape.size..(i + 1) * shape.size),
            Kind::Edge(i, j) => (Part::Edges, i * shape.size + j..i * shape.size + j + 1),
            Kind::Link(i, j) => {
                let bit = Relay::shift(shape) + link(shape.rows, i, j);
                (Part::Links, bit..bit + 1)
            }
        };
        let mut words: Vec<(usize, u64)> = Vec::new();
        for bit in bits {
            match words.last_mut().filter(|(word, _)| *word == bit / 64) {
                Some((_, mask)) => *mask |= 1 << (bit % 64),
                None => words.push((bit / 64, 1 << (bit % 64))),
            }
        }
        Self { part, words }
    }

    /// Changes its bits in one place.
    #[inline]
    fn flip(&self, place: usize, network: &mut Network, shape: &Shape) {
        let (all, count) = match (self.part, &mut network.relay) {
            (Part::Sensors, _) => (&mut network.sensors, shape.words),
            (Part::Edges, _) => (&mut network.edges, shape.words),
            (Part::Links, Some(relay)) => (&mut relay.up, Relay::words(shape.rows)),
            (Part::Links, None) => return,
        };
        for &(word, mask) in &self.words {
            all[place / BLOCK * count + word][place % BLOCK] ^= mask;
        }
    }
}

/// The links of a team as the rule of a relay.
struct Told {
    links: Links,
    rows: usize,
    size: usize,
}

/// Who hears whom, by the bits of links.
fn listened(rows: usize, words: &[u64], shift: usize) -> Topology {
    let bit = |i: usize, j: usize| shift + link(rows, i, j);
    Topology::from_fn(rows, rows, |i, j| i != j && words[bit(i, j) / 64] >> (bit(i, j) % 64) & 1 == 1)
}

impl Rule for Told {
    fn told(&mut self, seen: &[u64], heard: &[u64], told: &mut [u64]) {
        let (seen, heard) = (Topology::from_words(self.rows, self.size, seen), listened(self.rows, heard, 0));
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
        trials: usize,
        steps: usize,
        shape: Shape,
        width: Width,
        blocks: &mut Blocks,
    ) -> Result<Self, NoMemory> {
        let Played { conditions, chances, lineages } = *played;
        let numbers = Numbers::new(chances.trial + first as u64, lineages, first, trials);
        let count = blocks.far.len();
        let failures = &conditions.failures;
        // Masks, what was seen, heard and told last, and the agenda: asked for here together, and given back.
        let words = 4 * shape.words + 3 * Relay::words(shape.rows);
        let agenda = if failures.is_empty() { 0 } else { Agenda::bytes(trials * failures.len(), steps) };
        let all = size_of::<Words>() * count * words + agenda;
        within(WHAT, all as u128, MOST_BYTES)?;
        reserve_exact(WHAT, &mut Vec::<u8>::new(), all)?;
        let relay = conditions.links.as_ref().map(|talk| {
            let rule = Box::new(Told { links: talk.clone(), rows: shape.rows, size: shape.size });
            Relay::new(&shape, talk.reach(), count, rule)
        });
        let mut failing = None;
        if relay.is_some() || !failures.is_empty() {
            let mut network = Box::new(Network::new(width, shape, relay));
            if !failures.is_empty() {
                failing =
                    Some(Failing::new(failures, chances.seed, &numbers, trials, steps, &shape, width, &mut network));
            }
            blocks.network = Some(network);
        }
        let noise = conditions.spread.as_ref().map(|spread| Noise::new(spread, shape, chances.seed, width));
        Ok(Self { conditions, numbers, shape, failing, noise })
    }

    /// Moves what fails on to step k; whether anything may have changed in the last block.
    pub(super) fn fail(&mut self, k: usize, blocks: &mut Blocks) -> bool {
        let live = blocks.live;
        let mut changed = false;
        if let (Some(failing), Some(network)) = (&mut self.failing, &mut blocks.network) {
            changed = failing.advance(k, live, &self.numbers, network, &self.shape);
        }
        for row in self.numbers.turn(k) {
            if let Some(failing) = &mut self.failing {
                failing.flips.part(k, row, &self.numbers, &mut failing.agenda);
            }
        }
        changed
    }

    /// The trial `gone` is over; the trial `last` moves to the place that it had.
    pub(super) fn moved(&mut self, gone: u32, last: u32, place: usize) {
        if let Some(failing) = &mut self.failing {
            failing.places[last as usize] = place as u32;
            failing.places[gone as usize] = GONE;
        }
    }

    /// Shakes all trials after the step from t_k.
    pub(super) fn shake(&mut self, k: usize, who: &[u32], blocks: &mut Blocks) {
        if let Some(noise) = &mut self.noise {
            noise.add(k, &self.numbers, who, blocks);
        }
    }

    /// The network in force in one place, at the state `z`, with squared visibility radii `sight`.
    pub(super) fn network(&self, place: usize, z: &[f64], sight: &[f64], blocks: &Blocks) -> Topology {
        let Shape { rows, size, dim, words } = self.shape;
        let of = |all: &[Words], count: usize| -> Vec<u64> {
            all[place / BLOCK * count..][..count].iter().map(|word| word[place % BLOCK]).collect()
        };
        let mut seen = Topology::empty(rows, size);
        observe(z, dim, sight, &mut seen);
        let Some(network) = &blocks.network else { return seen };
        for up in [&network.sensors, &network.edges].into_iter().filter(|up| !up.is_empty()) {
            seen.keep(&Topology::from_words(rows, size, &of(up, words)));
        }
        let (Some(relay), Some(links)) = (&network.relay, &self.conditions.links) else { return seen };
        let mut heard = Topology::empty(rows, rows);
        links.heard(z, dim, &mut heard);
        if !relay.up.is_empty() {
            heard.keep(&listened(rows, &of(&relay.up, Relay::words(rows)), Relay::shift(&self.shape)));
        }
        links.told(&seen, &heard)
    }
}

impl Failing {
    /// All chains of the trials of a chunk; gives the network its masks.
    #[allow(clippy::too_many_arguments, reason = "what fails, whose numbers, and where it is written")]
    fn new(
        failures: &Failures,
        seed: u64,
        numbers: &Numbers,
        trials: usize,
        steps: usize,
        shape: &Shape,
        width: Width,
        network: &mut Network,
    ) -> Self {
        let targets: Vec<Target> = failures.kinds().map(|kind| Target::new(kind, shape)).collect();
        let blocks = trials.div_ceil(BLOCK);
        let there = |part: Part| targets.iter().any(|target| target.part == part);
        let words = |part: Part, count: usize| vec![[u64::MAX; BLOCK]; if there(part) { blocks * count } else { 0 }];
        network.sensors = words(Part::Sensors, shape.words);
        network.edges = words(Part::Edges, shape.words);
        if let Some(relay) = &mut network.relay {
            relay.up = words(Part::Links, Relay::words(shape.rows));
        }
        let mut agenda = Agenda::new(steps);
        let mut flips = Flips::new(failures, seed, width);
        flips.begin(trials, numbers, &mut agenda, |trial, chain| targets[chain].flip(trial, network, shape));
        Self { targets, flips, agenda, places: (0..trials as u32).collect() }
    }

    /// Flips what is due at step k; whether anything may have changed in the last block.
    fn advance(&mut self, k: usize, live: usize, numbers: &Numbers, network: &mut Network, shape: &Shape) -> bool {
        let (places, targets) = (&self.places, &self.targets);
        let mut last = false;
        self.flips.flip(k, numbers, &mut self.agenda, |trial, chain| {
            let place = places[trial];
            if place == GONE {
                return false;
            }
            targets[chain].flip(place as usize, network, shape);
            last |= place as usize / BLOCK == live / BLOCK;
            true
        });
        last
    }
}
