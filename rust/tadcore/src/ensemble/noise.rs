//! Disturbances of many trials side by side: the numbers of recorded runs, bitwise.
//!
//! A tile of places is shaken together: for each player its counters, the numbers in (0, 1), the normal numbers, all in
//! plain loops over the tile, and then every block by its own columns.

use super::block::{BLOCK, Blocks, Shape};
use super::lineages::Numbers;
use crate::random::{Counters, Purpose, key, normals};
use crate::simd::{Number, Width, dispatch};

/// Places of a tile: few enough for the first cache, enough for the tails to be worth gathering.
const TILE: usize = 256;

/// What shakes the trials of a chunk.
pub(super) struct Noise {
    spread: Vec<f64>,
    shape: Shape,
    key: [u32; 2],
    width: Width,
    /// s ξ of each player and axis, for a tile.
    added: Vec<[f64; TILE]>,
}

impl Noise {
    pub(super) fn new(spread: &[f64], shape: Shape, seed: u64, width: Width) -> Self {
        let added = vec![[0.0; TILE]; spread.len() * shape.dim];
        Self { spread: spread.to_vec(), shape, key: key(seed), width, added }
    }

    /// Shakes every trial after the step from t_k.
    pub(super) fn add(&mut self, k: usize, whose: &Numbers, who: &[u32], blocks: &mut Blocks) {
        let live = blocks.live;
        let numbers = self.shape.size * self.shape.dim;
        for start in (0..live).step_by(TILE) {
            let places = TILE.min(live.next_multiple_of(BLOCK) - start);
            let trials: [u64; TILE] = std::array::from_fn(|t| {
                // Places past the last trial repeat the first of their block.
                let place = start + t.min(places - 1);
                whose.of(who[if place < live { place } else { place / BLOCK * BLOCK }].into())
            });
            let z = &mut blocks.z[start / BLOCK * numbers..][..places / BLOCK * numbers];
            shaken(self.width, self, k as u32, &trials, z);
        }
    }
}

dispatch! {
    /// Shakes a tile.
    fn shaken<V>(noise: &mut Noise, k: u32, trials: &[u64; TILE], z: &mut [[f64; BLOCK]]) {
        let Shape { size, dim, .. } = noise.shape;
        let counters = Counters::new(trials, noise.key);
        for (p, &s) in noise.spread.iter().enumerate() {
            if s == 0.0 {
                continue;
            }
            for (pair, axes) in noise.added[p * dim..(p + 1) * dim].chunks_mut(2).enumerate() {
                let bits = Purpose::Disturbance(pair as u8).bits();
                let (mut a, mut b) = ([0.0; TILE], [0.0; TILE]);
                counters.uniforms([k, p as u32], bits, &mut a, &mut b);
                for (axis, numbers) in axes.iter_mut().zip([&a, &b]) {
                    normals::<V, _>(numbers, s, axis);
                }
            }
        }
        let (players, own) = noise.added.split_at(size * dim);
        for (block, rows) in z.chunks_exact_mut(size * dim).enumerate() {
            let at = block * BLOCK;
            for (row, players) in rows.chunks_exact_mut(dim).zip(players.chunks_exact(dim)) {
                for ((numbers, by), own) in row.iter_mut().zip(players).zip(own) {
                    let by = V::Eight::load(&by[at..]) - V::Eight::load(&own[at..]);
                    (V::Eight::load(numbers) + by).store(numbers);
                }
            }
        }
    }
}
