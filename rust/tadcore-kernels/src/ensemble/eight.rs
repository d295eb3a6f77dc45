//! Eight trials side by side: their numbers, the sizes of their game, and distances in it.

use crate::simd::{Number, Simd};

/// Trials side by side.
pub const BLOCK: usize = 8;
/// One number of each of them.
pub type PerTrial = [f64; BLOCK];

/// Sizes of a game, for code that is not compiled for them.
#[derive(Debug, Clone, Copy)]
pub struct Shape {
    /// N.
    pub size: usize,
    /// m.
    pub rows: usize,
    /// Axes.
    pub dim: usize,
    /// Words of a key.
    pub words: usize,
}

/// ‖z_i‖² of eight trials, the axes added in order.
#[inline(always)]
pub fn norm<V: Simd, const D: usize>(z: &[PerTrial], i: usize) -> V::Eight {
    let first = V::Eight::load(&z[i * D]);
    let mut sum = first * first;
    for x in 1..D {
        let a = V::Eight::load(&z[i * D + x]);
        sum = sum + a * a;
    }
    sum
}

/// ‖z_i − z_j‖² of eight trials.
#[inline(always)]
pub fn distance<V: Simd, const D: usize>(z: &[PerTrial], i: usize, j: usize) -> V::Eight {
    let first = V::Eight::load(&z[i * D]) - V::Eight::load(&z[j * D]);
    let mut sum = first * first;
    for x in 1..D {
        let a = V::Eight::load(&z[i * D + x]) - V::Eight::load(&z[j * D + x]);
        sum = sum + a * a;
    }
    sum
}
