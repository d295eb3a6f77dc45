//! What becomes of the sight of eight trials: what failed is taken out, and who hears others is told.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | mask | [`Network::up`] | which edges are up, a bit each, as in a block's keys |
//! | L | [`Relay::up`], [`Relay::new`] | bit i·m + j: i hears j, if the link is up and they are near enough |
//! | relay | [`Rule`] | who is told what, from what is seen and who hears whom |
//!
//! What small teams are told is looked up, by a table that fills as it is asked. In larger ones, what a trial was told
//! last is kept beside what it was told from, and asked for anew only where that differs.

use super::eight::{BLOCK, PerTrial, Shape, distance};
use crate::simd::{Number, Simd, Width, dispatch};

/// One word of each trial.
pub type Words = [u64; BLOCK];

/// Bits of what is seen and of who hears whom, up to which what is told is looked up: 4 MiB, of which little is touched.
const TABLE_BITS: usize = 21;
/// Marks an entry of that table; the bits below it are what is told.
const KNOWN: u16 = 1 << 15;

/// Who is told what: a function of the words of what is seen and of who hears whom.
pub trait Rule: Send {
    /// Writes the words of the network in force.
    fn told(&mut self, seen: &[u64], heard: &[u64], told: &mut [u64]);
}

/// What comes between sight and network, for the trials of a chunk.
pub struct Network {
    width: Width,
    shape: Shape,
    /// Which edges are up, as many words a block as a key has; empty where none fails.
    pub up: Vec<Words>,
    /// How players talk, if they do.
    pub relay: Option<Relay>,
}

/// Players that talk.
pub struct Relay {
    rule: Box<dyn Rule>,
    /// Squared reaches, m; empty where everybody is heard everywhere.
    reach: Vec<f64>,
    /// Which links are up, [`Relay::words`] a block.
    pub up: Vec<Words>,
    /// Of each block: what was seen, who heard whom, and what was told.
    last: Vec<Words>,
    heard: Vec<Words>,
    scratch: [Vec<u64>; 3],
    /// By who hears whom and what is seen: what is told; empty in larger teams.
    table: Vec<u16>,
}

impl Relay {
    /// Words of who hears whom.
    pub fn words(rows: usize) -> usize {
        (rows * rows).div_ceil(64)
    }

    /// Players with these squared reaches, in so many blocks; all links up but those that `up` clears.
    pub fn new(shape: &Shape, reach: &[f64], blocks: usize, up: Vec<Words>, rule: Box<dyn Rule>) -> Self {
        let links = Self::words(shape.rows);
        let everywhere = reach.iter().all(|&reach| reach == f64::INFINITY);
        let (bits, all) = (shape.rows * shape.size, shape.rows * (shape.rows + shape.size));
        let small = all <= TABLE_BITS && bits < KNOWN.trailing_zeros() as usize;
        let table = if small { vec![0; 1 << all] } else { Vec::new() };
        // Nobody hears itself, so this was never asked for.
        let last = vec![[u64::MAX; BLOCK]; if small { 0 } else { blocks * (2 * shape.words + links) }];
        let scratch = [vec![0; shape.words], vec![0; links], vec![0; shape.words]];
        let reach = if everywhere { Vec::new() } else { reach.to_vec() };
        Self { rule, reach, up, last, heard: vec![[0; BLOCK]; links], scratch, table }
    }

    /// Writes who hears whom in one block.
    #[inline(always)]
    fn hear<V: Simd, const D: usize>(&mut self, shape: &Shape, block: usize, z: &[PerTrial]) {
        let (m, links) = (shape.rows, self.heard.len());
        let up = &self.up[block * links..][..links];
        if self.reach.is_empty() {
            self.heard.copy_from_slice(up);
            return;
        }
        if D > 0 && links == 1 {
            let mut keys = V::no_keys();
            for i in 0..m {
                for j in 0..i {
                    let d2 = distance::<V, D>(z, i, j);
                    keys = V::set(keys, 1 << (i * m + j), d2.at_most(V::Eight::splat(self.reach[j])));
                    keys = V::set(keys, 1 << (j * m + i), d2.at_most(V::Eight::splat(self.reach[i])));
                }
            }
            self.heard[0] = V::keys(keys);
        } else {
            self.heard.fill([0; BLOCK]);
            for i in 0..m {
                for j in 0..i {
                    let mut d2 = [0.0; BLOCK];
                    for x in 0..shape.dim {
                        let (a, b) = (&z[i * shape.dim + x], &z[j * shape.dim + x]);
                        for l in 0..BLOCK {
                            d2[l] += (a[l] - b[l]) * (a[l] - b[l]);
                        }
                    }
                    for (bit, reach) in [(i * m + j, self.reach[j]), (j * m + i, self.reach[i])] {
                        for l in 0..BLOCK {
                            self.heard[bit / 64][l] |= u64::from(d2[l] <= reach) << (bit % 64);
                        }
                    }
                }
            }
        }
        for (heard, up) in self.heard.iter_mut().zip(up) {
            for l in 0..BLOCK {
                heard[l] &= up[l];
            }
        }
    }

    /// Replaces what is seen by what is told, by the table.
    #[inline(always)]
    fn look_up(&mut self, bits: usize, keys: &mut Words) {
        let (heard, last) = (&self.heard[0], self.table.len() - 1);
        let (mut told, mut known) = ([0; BLOCK], KNOWN);
        for l in 0..BLOCK {
            // The mask changes nothing; it tells the compiler that the index lies within the table.
            let entry = self.table[(heard[l] << bits | keys[l]) as usize & last];
            told[l] = u64::from(entry & !KNOWN);
            known &= entry;
        }
        if known == 0 {
            for l in 0..BLOCK {
                let mut word = [0];
                self.rule.told(&[keys[l]], &[heard[l]], &mut word);
                told[l] = word[0];
                self.table[(heard[l] << bits | keys[l]) as usize & last] = KNOWN | word[0] as u16;
            }
        }
        *keys = told;
    }

    /// The same for any team.
    #[inline(always)]
    fn tell(&mut self, words: usize, block: usize, keys: &mut [Words]) {
        let links = self.heard.len();
        let last = &mut self.last[block * (2 * words + links)..][..2 * words + links];
        let mut differs = [0; BLOCK];
        for (last, now) in last.iter().zip(keys.iter().chain(&self.heard)) {
            for l in 0..BLOCK {
                differs[l] |= last[l] ^ now[l];
            }
        }
        if differs.iter().fold(0, |all, word| all | word) != 0 {
            let [seen, heard, told] = &mut self.scratch;
            for l in (0..BLOCK).filter(|&l| differs[l] != 0) {
                seen.iter_mut().zip(&*keys).for_each(|(word, key)| *word = key[l]);
                heard.iter_mut().zip(&self.heard).for_each(|(word, key)| *word = key[l]);
                self.rule.told(seen, heard, told);
                let all = seen.iter().chain(&*heard).chain(&*told);
                last.iter_mut().zip(all).for_each(|(last, word)| last[l] = *word);
            }
        }
        keys.copy_from_slice(&last[words + links..]);
    }
}

impl Network {
    /// What comes between sight and network in games of one shape.
    pub fn new(width: Width, shape: Shape, up: Vec<Words>, relay: Option<Relay>) -> Self {
        Self { width, shape, up, relay }
    }

    /// Makes of what is seen in one block, at the states `z`, the network in force.
    #[inline(never)]
    pub fn apply(&mut self, block: usize, z: &[PerTrial], keys: &mut [Words]) {
        match self.shape.dim {
            2 => become_of::<2>(self.width, self, block, z, keys),
            3 => become_of::<3>(self.width, self, block, z, keys),
            _ => become_of::<0>(self.width, self, block, z, keys),
        }
    }

    /// Copies a trial from one place to another.
    pub fn copy(&mut self, from: usize, to: usize) {
        let links = Relay::words(self.shape.rows);
        let relay = self.relay.as_mut().map(|relay| (&mut relay.up, links));
        for (all, step) in
            relay.into_iter().chain([(&mut self.up, self.shape.words)]).filter(|(all, _)| !all.is_empty())
        {
            for e in 0..step {
                all[to / BLOCK * step + e][to % BLOCK] = all[from / BLOCK * step + e][from % BLOCK];
            }
        }
    }
}

dispatch! {
    /// What becomes of one block, compiled for two and three axes, and for any number.
    fn become_of<V, const D: usize>(network: &mut Network, block: usize, z: &[PerTrial], keys: &mut [Words]) {
        let words = network.shape.words;
        if !network.up.is_empty() {
            for (key, up) in keys.iter_mut().zip(&network.up[block * words..]) {
                for l in 0..BLOCK {
                    key[l] &= up[l];
                }
            }
        }
        if let Some(relay) = &mut network.relay {
            relay.hear::<V, D>(&network.shape, block, z);
            if relay.table.is_empty() {
                relay.tell(words, block, keys);
            } else {
                relay.look_up(network.shape.rows * network.shape.size, &mut keys[0]);
            }
        }
    }
}
