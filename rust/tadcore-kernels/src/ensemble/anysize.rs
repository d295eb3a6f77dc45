//! A sweep for sizes known only at run time, trial after trial.

use super::block::{BLOCK, Blocks, Keys, PerTrial, Shape, Stop, playing};
use crate::policy::step_table::{StepTable, padded};
use crate::simd::Width;

/// One step of the blocks from one on; a [`Sweep`](super::block::Sweep) that does not look ahead.
pub fn sweep_any(
    _: Width,
    shape: &Shape,
    blocks: &mut Blocks,
    from: usize,
    table: &StepTable,
    _: Option<&StepTable>,
    keys: &mut Keys,
) -> Stop {
    let (n, d) = (shape.size, shape.dim);
    let stride = n * padded(n);
    let (mut state, mut words) = (vec![0.0; n * d], vec![0; shape.words]);
    let mut next = vec![0.0; padded(n)];
    for block in from..blocks.live.div_ceil(BLOCK) {
        let playing = playing(blocks.live, block);
        let z = &mut blocks.z[block * n * d..][..n * d];
        let sight = &blocks.sight[block * blocks.sight_step..][..shape.rows];
        let capture = &blocks.capture[block * blocks.capture_step..][..n];
        let over = observe_any(shape, z, sight, capture, &blocks.far[block], keys) & playing;
        if over != 0 {
            return Stop::Over(block, over);
        }
        if let Some(network) = &mut blocks.network {
            network.apply(block, z, keys);
        }
        let mut slots = [0; BLOCK];
        for (l, slot) in slots.iter_mut().enumerate() {
            words.iter_mut().zip(&*keys).for_each(|(word, of_trials)| *word = of_trials[l]);
            *slot = table.find(&words) as usize;
        }
        if slots.contains(&0) {
            return Stop::Missing(block);
        }
        for (l, slot) in slots.into_iter().enumerate() {
            state.iter_mut().zip(&*z).for_each(|(x, numbers)| *x = numbers[l]);
            let t = &table.matrices()[slot * stride..][..stride];
            for x in 0..d {
                next.fill(0.0);
                for (j, column) in t.chunks_exact(padded(n)).enumerate() {
                    let value = state[j * d + x];
                    for (sum, c) in next.iter_mut().zip(column) {
                        *sum += c * value;
                    }
                }
                for (a, &value) in next[..n].iter().enumerate() {
                    z[a * d + x][l] = value;
                }
            }
        }
    }
    Stop::End
}

/// The keys of one block, and a bit for each trial in which somebody is caught or far off.
pub fn observe_any(
    shape: &Shape,
    z: &[PerTrial],
    sight: &[PerTrial],
    capture: &[PerTrial],
    far: &PerTrial,
    keys: &mut Keys,
) -> u32 {
    let (n, m, d) = (shape.size, shape.rows, shape.dim);
    keys.fill([0; BLOCK]);
    let (mut over, mut most) = ([0; BLOCK], [0.0; BLOCK]);
    for i in 0..n {
        for j in 0..=i {
            let mut d2 = [0.0; BLOCK];
            for x in 0..d {
                let (a, b) = (&z[i * d + x], &z[j * d + x]);
                for l in 0..BLOCK {
                    let difference = if i == j { a[l] } else { a[l] - b[l] };
                    d2[l] += difference * difference;
                }
            }
            for (row, column) in [(i, j), (j, i)] {
                let bit = row * n + column;
                if row < m {
                    for l in 0..BLOCK {
                        keys[bit / 64][l] |= u64::from(d2[l] <= sight[row][l]) << (bit % 64);
                    }
                }
            }
            if i == j {
                for l in 0..BLOCK {
                    over[l] |= u32::from(d2[l] <= capture[i][l]) << l;
                    most[l] = if i == 0 || most[l] < d2[l] { d2[l] } else { most[l] };
                }
            }
        }
    }
    for l in 0..BLOCK {
        let near = most[l] <= far[l];
        over[l] |= u32::from(!near) << l;
    }
    over.into_iter().fold(0, |all, bit| all | bit)
}
