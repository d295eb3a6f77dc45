//! The flips of many chains side by side: the numbers of recorded runs, bitwise.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | f | [`Flips::next`], from a chain's state | which of its flips is the next |
//! | H = 1 + ⌊ln u / ln(1 − p)⌋ | [`Tile::draw`] | steps up to it |

use super::agenda::{Agenda, Entry};
use super::lineages::Numbers;
use crate::network::Failures;
use crate::random::{Chain, Draws, NEVER, first_uniforms, key, ln};
use crate::simd::{Width, dispatch};

/// Flips that are drawn together.
const TILE: usize = 64;

/// The chains of all trials of a chunk. Chain c of trial t has the number t · 2^shift + c; its state is twice the number of
/// its flips, and 1 where it is up, and stands on the agenda with the next of them.
pub(super) struct Flips {
    chains: Vec<Chain>,
    /// Second words of their counters, and the bits of their purposes.
    entities: Vec<(u32, u32)>,
    shift: u32,
    seed: u64,
    /// The state under which each chain stands on the agenda, where rows part; what stands there besides is void.
    now: Vec<u32>,
    tile: Box<Tile>,
    width: Width,
}

/// Flips to be drawn.
struct Tile {
    entries: [Entry; TILE],
    counters: [[u64; TILE]; 4],
    /// ln(1 − p).
    stays: [f64; TILE],
    held: [i32; TILE],
    count: usize,
}

impl Flips {
    pub(super) fn new(failures: &Failures, seed: u64, width: Width) -> Self {
        let (chains, entities): (Vec<Chain>, Vec<_>) = failures.laws().unzip();
        let tile = Tile {
            entries: [Entry::default(); TILE],
            counters: [[0; TILE]; 4],
            stays: [-1.0; TILE],
            held: [NEVER; TILE],
            count: 0,
        };
        let shift = chains.len().next_power_of_two().trailing_zeros();
        Self { chains, entities, shift, seed, now: Vec::new(), tile: Box::new(tile), width }
    }

    /// Begins every chain, and puts its first flip on the agenda; tells of each that begins down.
    pub(super) fn begin(
        &mut self,
        trials: usize,
        numbers: &Numbers,
        agenda: &mut Agenda,
        mut down: impl FnMut(usize, usize),
    ) {
        if numbers.part() {
            self.now = vec![0; trials << self.shift];
        }
        for trial in 0..trials {
            let draws = Draws { seed: self.seed, trial: numbers.of(trial as u64) };
            for c in 0..self.chains.len() {
                let (entity, bits) = self.entities[c];
                let up = self.chains[c].begins_up(|| draws.first(bits, entity, 0));
                if !up {
                    down(trial, c);
                }
                self.next(0, Entry { number: (trial << self.shift | c) as u32, state: up.into() }, numbers, agenda);
            }
        }
        self.draw(0, agenda);
    }

    /// Flips what is due at step k, and puts the next flips on the agenda; `there` does what the flip of a chain of a trial
    /// changes, and says whether that trial still plays.
    pub(super) fn flip(
        &mut self,
        k: usize,
        numbers: &Numbers,
        agenda: &mut Agenda,
        mut there: impl FnMut(usize, usize) -> bool,
    ) {
        while let Some(piece) = agenda.take(k) {
            for &Entry { number, state } in piece.entries() {
                if self.now.get(number as usize).is_some_and(|&now| now != state) {
                    continue;
                }
                if there((number >> self.shift) as usize, self.chain(number)) {
                    self.next(k, Entry { number, state: (state + 2) ^ 1 }, numbers, agenda);
                }
            }
        }
        self.draw(k, agenda);
    }

    /// Draws again when the chains of a row flip next, which are as they are at t_k.
    pub(super) fn part(&mut self, k: usize, row: usize, numbers: &Numbers, agenda: &mut Agenda) {
        for c in 0..self.chains.len() {
            let number = (row << self.shift | c) as u32;
            // Numbers of another place, and what stands on the agenda is void.
            let state = self.now[number as usize] + 2;
            self.next(k, Entry { number, state }, numbers, agenda);
        }
        self.draw(k, agenda);
    }

    #[inline]
    fn chain(&self, number: u32) -> usize {
        (number & ((1 << self.shift) - 1)) as usize
    }

    /// Adds the next flip of a chain to the tile, if there is one.
    #[inline]
    fn next(&mut self, k: usize, entry: Entry, numbers: &Numbers, agenda: &mut Agenda) {
        let c = self.chain(entry.number);
        if let Some(now) = self.now.get_mut(entry.number as usize) {
            *now = entry.state;
        }
        let stays = self.chains[c].stays(entry.state & 1 == 1);
        if stays == 0.0 {
            return;
        }
        let ((entity, bits), trial) = (self.entities[c], numbers.of(u64::from(entry.number >> self.shift)));
        let tile = &mut *self.tile;
        let at = tile.count;
        tile.entries[at] = entry;
        let index = entry.state / 2 + 1;
        let counter = [index.into(), entity.into(), trial & 0xFFFF_FFFF, trial >> 32 | u64::from(bits)];
        for (words, word) in tile.counters.iter_mut().zip(counter) {
            words[at] = word;
        }
        tile.stays[at] = stays;
        tile.count += 1;
        if tile.count == TILE {
            self.draw(k, agenda);
        }
    }

    /// Draws what is in the tile.
    fn draw(&mut self, k: usize, agenda: &mut Agenda) {
        if self.tile.count == 0 {
            return;
        }
        drawn(self.width, &mut self.tile, key(self.seed));
        let tile = &mut *self.tile;
        for (&entry, &steps) in tile.entries[..tile.count].iter().zip(&tile.held) {
            agenda.put(k.saturating_add(steps as usize), entry);
        }
        tile.count = 0;
    }
}

dispatch! {
    /// Steps up to the next flips of a tile; [`NEVER`] where they are too many.
    fn drawn<V>(tile: &mut Tile, key: [u32; 2]) {
        // Eights are enough where little flips.
        const FEW: usize = 8;
        if tile.count <= FEW {
            held::<FEW>(tile, key);
        } else {
            held::<TILE>(tile, key);
        }
    }
}

/// The same of the first chains of a tile.
#[inline(always)]
fn held<const T: usize>(tile: &mut Tile, key: [u32; 2]) {
    let mut counters = [[0; T]; 4];
    for (own, all) in counters.iter_mut().zip(&tile.counters) {
        own.copy_from_slice(&all[..T]);
    }
    let mut numbers = [0.0; T];
    first_uniforms(&counters, key, &mut numbers);
    for t in 0..T {
        let steps = ln(numbers[t]) / tile.stays[t];
        // What is not below is never, no number included.
        tile.held[t] = if steps < f64::from(NEVER - 1) { steps as i32 + 1 } else { NEVER };
    }
}
