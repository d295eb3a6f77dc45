//! What becomes of the sight of eight trials: what failed is taken out, and who hears others is told.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | mask | [`Network::sensors`], [`Network::edges`] | what is up, a bit for each edge, as in a block's keys |
//! | L | [`Relay::up`], [`Relay::new`] | bit [`link`]: i hears j, if the link is up and they are near enough |
//! | relay | [`Rule`] | who is told what, from what is seen and who hears whom |
//!
//! What small teams are told is looked up, by a table that fills as it is asked; the sweeps of the smallest do so without
//! leaving their registers. In larger ones, what a trial was told last is kept beside what it was told from, and asked for
//! anew only where that differs.

use super::eight::{BLOCK, PerTrial, Shape, distance};
use crate::simd::{Entries, Number, Simd, Width, dispatch};

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
    /// Which edges have a sensor that is up, as many words a block as a key has; empty where none fails.
    pub sensors: Vec<Words>,
    /// Which edges are up; empty where none fails.
    pub edges: Vec<Words>,
    /// How players talk, if they do.
    pub relay: Option<Relay>,
}

/// Players that talk.
pub struct Relay {
    rule: Box<dyn Rule>,
    /// Squared reaches, m; empty where everybody is heard everywhere.
    reach: Vec<f64>,
    /// Which links are up, [`Relay::words`] a block; empty where none fails.
    pub up: Vec<Words>,
    /// The bit of the first link: in small teams links come after what is seen, in one key.
    shift: usize,
    /// All links.
    all: Vec<u64>,
    /// Of each block: what was seen, who heard whom, and what was told.
    last: Vec<Words>,
    heard: Vec<Words>,
    scratch: [Vec<u64>; 3],
    /// By who hears whom and what is seen: what is told; none in larger teams.
    table: Option<Entries>,
}

/// The bit of the link by which i hears j ≠ i.
#[inline(always)]
pub const fn link(rows: usize, i: usize, j: usize) -> usize {
    i * (rows - 1) + j - (j > i) as usize
}

impl Relay {
    /// Words of who hears whom.
    pub fn words(rows: usize) -> usize {
        (rows * rows.saturating_sub(1)).div_ceil(64).max(1)
    }

    /// The bit of the first link.
    pub fn shift(shape: &Shape) -> usize {
        let bits = shape.rows * shape.size;
        let small = bits + shape.rows * (shape.rows - 1) <= TABLE_BITS && bits < KNOWN.trailing_zeros() as usize;
        if small { bits } else { 0 }
    }

    /// Players with these squared reaches, in so many blocks.
    pub fn new(shape: &Shape, reach: &[f64], blocks: usize, rule: Box<dyn Rule>) -> Self {
        let (words, links, shift) = (Self::words(shape.rows), shape.rows * (shape.rows - 1), Self::shift(shape));
        let everywhere = reach.iter().all(|&reach| reach == f64::INFINITY);
        let reach = if everywhere { Vec::new() } else { reach.to_vec() };
        let mut all = vec![0; words];
        (shift..shift + links).for_each(|bit| all[bit / 64] |= 1 << (bit % 64));
        let table = (shift > 0).then(|| Entries::new(shift + links));
        // Nobody hears itself, so this was never asked for.
        let last = vec![[u64::MAX; BLOCK]; if shift > 0 { 0 } else { blocks * (2 * shape.words + words) }];
        let scratch = [vec![0; shape.words], vec![0; words], vec![0; shape.words]];
        Self { rule, reach, up: Vec::new(), shift, all, last, heard: vec![[0; BLOCK]; words], scratch, table }
    }

    /// Writes who hears whom in one block.
    #[inline(always)]
    fn hear<V: Simd, const D: usize>(&mut self, shape: &Shape, block: usize, z: &[PerTrial]) {
        let (m, shift, words) = (shape.rows, self.shift, self.heard.len());
        if self.reach.is_empty() {
            for (heard, &all) in self.heard.iter_mut().zip(&self.all) {
                *heard = [all; BLOCK];
            }
        } else if D > 0 && words == 1 {
            let mut keys = V::no_keys();
            for i in 0..m {
                for j in 0..i {
                    let d2 = distance::<V, D>(z, i, j);
                    let [here, there] = [link(m, i, j), link(m, j, i)];
                    keys = V::set(keys, 1 << (shift + here), d2.at_most(V::Eight::splat(self.reach[j])));
                    keys = V::set(keys, 1 << (shift + there), d2.at_most(V::Eight::splat(self.reach[i])));
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
                    for (bit, reach) in [(link(m, i, j), self.reach[j]), (link(m, j, i), self.reach[i])] {
                        let bit = shift + bit;
                        for l in 0..BLOCK {
                            self.heard[bit / 64][l] |= u64::from(d2[l] <= reach) << (bit % 64);
                        }
                    }
                }
            }
        }
        keep(&mut self.heard, &self.up, block);
    }

    /// Replaces what is seen by what is told, by the table.
    #[inline(always)]
    fn look_up(&mut self, keys: &mut Words) {
        let heard = &self.heard[0];
        for l in 0..BLOCK {
            keys[l] |= heard[l];
        }
        let Some(table) = &self.table else { return };
        let (mut told, mut known) = ([0; BLOCK], KNOWN);
        for l in 0..BLOCK {
            let entry = table.get(keys[l]);
            told[l] = u64::from(entry & !KNOWN);
            known &= entry;
        }
        if known == 0 {
            self.learn(keys);
            return self.look_up(keys);
        }
        *keys = told;
    }

    /// Adds to the table what is told from the keys of a block.
    #[cold]
    #[inline(never)]
    fn learn(&mut self, keys: &Words) {
        let Some(table) = &mut self.table else { return };
        for &key in keys {
            if table.get(key) & KNOWN == 0 {
                let mut word = [0];
                self.rule.told(&[key & ((1 << self.shift) - 1)], &[key >> self.shift], &mut word);
                table.set(key, KNOWN | word[0] as u16);
            }
        }
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

/// Keeps of the words of a block what is up; nothing fails where there are no words.
#[inline(always)]
fn keep(words: &mut [Words], up: &[Words], block: usize) {
    if up.is_empty() {
        return;
    }
    let count = words.len();
    for (words, up) in words.iter_mut().zip(&up[block * count..]) {
        for l in 0..BLOCK {
            words[l] &= up[l];
        }
    }
}

impl Network {
    /// What comes between sight and network in games of one shape: nothing fails yet.
    pub fn new(width: Width, shape: Shape, relay: Option<Relay>) -> Self {
        Self { width, shape, sensors: Vec::new(), edges: Vec::new(), relay }
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

    /// Squared reaches of links, where a sweep that keeps keys in registers is to compare distances with them.
    #[inline(always)]
    pub fn reach(&self) -> &[f64] {
        self.relay.as_ref().map_or(&[], |relay| &relay.reach)
    }

    /// Whether the network in force is a function of one word for each trial that is looked up, if it is not a mask alone.
    #[inline(always)]
    pub fn in_registers(&self) -> bool {
        self.relay.as_ref().is_none_or(|relay| relay.table.is_some())
    }

    /// The network in force in one block, for games of one word: of what is seen and, where links have reaches, heard.
    #[inline(always)]
    pub fn in_force<V: Simd>(&mut self, block: usize, mut keys: V::Keys) -> V::Keys {
        if let Some(up) = self.sensors.get(block) {
            keys = V::both(keys, V::load_keys(up));
        }
        if let Some(up) = self.edges.get(block) {
            keys = V::both(keys, V::load_keys(up));
        }
        let Some(relay) = &mut self.relay else { return keys };
        if relay.reach.is_empty() {
            keys = V::set(keys, relay.all[0], V::Eight::mask(0xFF));
        }
        if let Some(up) = relay.up.get(block) {
            keys = V::both(keys, V::load_keys(up));
        }
        let Some(table) = &relay.table else { return keys };
        let mut told = V::entries(table, keys);
        const ALL: u64 = KNOWN as u64 * 0x0001_0001_0001_0001;
        let [first, second] = V::low(told);
        if first & second & ALL != ALL {
            relay.learn(&V::keys(keys));
            let Some(table) = &relay.table else { return keys };
            told = V::entries(table, keys);
        }
        told
    }

    /// What was looked up without what marks it.
    #[inline(always)]
    pub fn plain(keys: &mut Words) {
        keys.iter_mut().for_each(|key| *key &= u64::from(!KNOWN));
    }

    /// Copies a trial from one place to another.
    pub fn copy(&mut self, from: usize, to: usize) {
        let links = Relay::words(self.shape.rows);
        let relay = self.relay.as_mut().map(|relay| (&mut relay.up, links));
        let sight = [(&mut self.sensors, self.shape.words), (&mut self.edges, self.shape.words)];
        for (all, step) in relay.into_iter().chain(sight).filter(|(all, _)| !all.is_empty()) {
            for e in 0..step {
                all[to / BLOCK * step + e][to % BLOCK] = all[from / BLOCK * step + e][from % BLOCK];
            }
        }
    }
}

dispatch! {
    /// What becomes of one block, compiled for two and three axes, and for any number.
    fn become_of<V, const D: usize>(network: &mut Network, block: usize, z: &[PerTrial], keys: &mut [Words]) {
        keep(keys, &network.sensors, block);
        keep(keys, &network.edges, block);
        if let Some(relay) = &mut network.relay {
            relay.hear::<V, D>(&network.shape, block, z);
            if relay.shift == 0 {
                relay.tell(network.shape.words, block, keys);
            } else {
                relay.look_up(&mut keys[0]);
            }
        }
    }
}
