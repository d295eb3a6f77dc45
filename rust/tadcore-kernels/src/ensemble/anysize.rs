//! A sweep for sizes known only at run time, trial after trial.

use super::strip::{Keys, LANES, Lane, Shape, Stop, Strips, playing};
use crate::policy::step_table::{Shelf, padded};
use crate::simd::Width;

/// One step of the strips from one on; a [`Sweep`](super::strip::Sweep) that does not look ahead.
pub fn sweep_any(
    _: Width,
    shape: &Shape,
    strips: &mut Strips,
    from: usize,
    shelf: &Shelf,
    _: Option<&Shelf>,
    keys: &mut Keys,
) -> Stop {
    let (n, d) = (shape.size, shape.dim);
    let stride = n * padded(n);
    let (mut state, mut words) = (vec![0.0; n * d], vec![0; shape.words]);
    let mut next = vec![0.0; padded(n)];
    for strip in from..strips.live.div_ceil(LANES) {
        let playing = playing(strips.live, strip);
        let z = &mut strips.z[strip * n * d..][..n * d];
        let sight = &strips.sight[strip * strips.sight_step..][..shape.rows];
        let capture = &strips.capture[strip * strips.capture_step..][..n];
        let caught = observe_any(shape, z, sight, capture, keys) & playing;
        if caught != 0 {
            return Stop::Caught(strip, caught);
        }
        let mut slots = [0; LANES];
        for (l, slot) in slots.iter_mut().enumerate() {
            words.iter_mut().zip(&*keys).for_each(|(word, lanes)| *word = lanes[l]);
            *slot = shelf.find(&words) as usize;
        }
        if slots.contains(&0) {
            return Stop::Missing(strip);
        }
        for (l, slot) in slots.into_iter().enumerate() {
            state.iter_mut().zip(&*z).for_each(|(x, lane)| *x = lane[l]);
            let t = &shelf.matrices()[slot * stride..][..stride];
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

/// The keys of one strip, and a bit for each trial in which somebody is caught.
pub fn observe_any(shape: &Shape, z: &[Lane], sight: &[Lane], capture: &[Lane], keys: &mut Keys) -> u32 {
    let (n, m, d) = (shape.size, shape.rows, shape.dim);
    keys.fill([0; LANES]);
    let mut caught = [0; LANES];
    for i in 0..n {
        for j in 0..=i {
            let mut d2 = [0.0; LANES];
            for x in 0..d {
                let (a, b) = (&z[i * d + x], &z[j * d + x]);
                for l in 0..LANES {
                    let difference = if i == j { a[l] } else { a[l] - b[l] };
                    d2[l] += difference * difference;
                }
            }
            for (row, column) in [(i, j), (j, i)] {
                let bit = row * n + column;
                if row < m {
                    for l in 0..LANES {
                        keys[bit / 64][l] |= u64::from(d2[l] <= sight[row][l]) << (bit % 64);
                    }
                }
            }
            if i == j {
                for l in 0..LANES {
                    caught[l] |= u32::from(d2[l] <= capture[i][l]) << l;
                }
            }
        }
    }
    caught.into_iter().fold(0, |all, bit| all | bit)
}
