//! Disturbances of many trials side by side: the numbers of recorded runs, bitwise.
//!
//! A tile of places is shaken together, the attacker before the players: the counters of all, then for each its numbers in
//! (0, 1), its normal numbers, and every block by its own columns.

use super::block::{BLOCK, Blocks, Shape};
use super::lineages::Numbers;
use crate::random::{Counters, Purpose, Tails, key, normals};
use crate::simd::{Number, Width, dispatch};

/// Places of a tile: few enough for the first cache, enough for the tails to be worth gathering.
const TILE: usize = 256;

/// One number for each place of a tile.
type Column = [f64; TILE];

/// What shakes the trials of a chunk.
pub(super) struct Noise {
    spread: Vec<f64>,
    shape: Shape,
    width: Width,
    scratch: Box<Scratch>,
}

/// What is computed for one tile after another.
struct Scratch {
    trials: [u64; TILE],
    counters: Counters<TILE>,
    uniforms: [Column; 2],
    tails: Tails<TILE>,
    /// s ξ of the attacker and of one player, on two axes.
    attacker: [Column; 2],
    player: [Column; 2],
}

impl Noise {
    pub(super) fn new(spread: &[f64], shape: Shape, seed: u64, width: Width) -> Self {
        let none = [[0.0; TILE]; 2];
        let scratch = Scratch {
            trials: [0; TILE],
            counters: Counters::new(key(seed)),
            uniforms: none,
            tails: Tails::new(),
            attacker: none,
            player: none,
        };
        Self { spread: spread.to_vec(), shape, width, scratch: Box::new(scratch) }
    }

    /// Shakes every trial after the step from t_k.
    pub(super) fn add(&mut self, k: usize, whose: &Numbers, who: &[u32], blocks: &mut Blocks) {
        let live = blocks.live;
        let numbers = self.shape.size * self.shape.dim;
        for start in (0..live).step_by(TILE) {
            let places = TILE.min(live.next_multiple_of(BLOCK) - start);
            let playing = &who[start..live.min(start + TILE)];
            whose.of_all(playing, &mut self.scratch.trials);
            // Places past the last trial repeat the first of their block; past the last block they are whatever.
            let first = self.scratch.trials[playing.len() / BLOCK * BLOCK % TILE];
            self.scratch.trials[playing.len()..].fill(first);
            let z = &mut blocks.z[start / BLOCK * numbers..][..places / BLOCK * numbers];
            shaken(self.width, &self.spread, &self.shape, k as u32, &mut self.scratch, z);
        }
    }
}

dispatch! {
    /// Shakes a tile, two axes at a time.
    fn shaken<V>(spread: &[f64], shape: &Shape, k: u32, scratch: &mut Scratch, z: &mut [[f64; BLOCK]]) {
        let Shape { size, dim, .. } = *shape;
        let Scratch { trials, counters, uniforms, tails, attacker, player } = scratch;
        for first in (0..dim).step_by(2) {
            let axes = first..dim.min(first + 2);
            counters.set(trials, k, Purpose::Disturbance((first / 2) as u8).bits());
            for p in (0..=size).rev() {
                let columns = &mut if p == size { &mut *attacker } else { &mut *player }[..axes.len()];
                if spread[p] == 0.0 {
                    columns.as_flattened_mut().fill(0.0);
                } else {
                    counters.uniforms::<V>(p as u32, uniforms);
                    for (column, numbers) in columns.iter_mut().zip(&*uniforms) {
                        normals::<V, _>(numbers, spread[p], column, tails);
                    }
                }
                if p == size {
                    continue;
                }
                for (block, rows) in z.chunks_exact_mut(size * dim).enumerate() {
                    let row = &mut rows[p * dim..][axes.clone()];
                    for ((numbers, by), own) in row.iter_mut().zip(&*player).zip(&*attacker) {
                        let by = V::Eight::load(&by[block * BLOCK..]) - V::Eight::load(&own[block * BLOCK..]);
                        (V::Eight::load(numbers) + by).store(numbers);
                    }
                }
            }
        }
    }
}
