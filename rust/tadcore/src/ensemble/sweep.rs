//! One step of eight trials at a time: who is caught, who sees whom, and the product, in vector registers.
//!
//! Every sum runs in the order of [`crate::simulation::simulate`] and no product is fused with a sum, so that a trial
//! ends as it would alone, to the bit, at every [`Width`].
//!
//! Memory is what a step waits for, so nothing is asked for when it is needed: a block of strips is looked at before any
//! of them moves, which puts independent work between a lookup and the product that needs it, and every strip fetches a
//! part of the next instant's shelf.

use super::anysize::sweep_any;
use super::strip::{Keys, LANES, Lane, Shape, Stop, Strips, Sweep};
use super::vector::{Plain, Vector};
#[cfg(target_arch = "x86_64")]
use super::vector::{Wide256, Wide512};
use crate::policy::shelf::{DIRECT_BITS, Shelf};
use crate::width::Width;

/// Strips that are looked at before any of them moves: their states, 8 KiB for four rows in the plane, stay in the first
/// cache in between.
const BLOCK: usize = 16;

/// Lines of the next instant's shelf that a strip fetches at most: few strips need few entries.
const MOST_LINES: usize = 8;

/// An index that knows no topology.
static NOTHING: [u16; 1 << DIRECT_BITS] = [0; 1 << DIRECT_BITS];

/// Repeats a block for the constants 0…7 that lie below a limit known to the compiler.
macro_rules! unrolled {
    ($i:ident < $limit:expr, $body:block) => {
        unrolled!(@ $i $limit, $body, 0 1 2 3 4 5 6 7)
    };
    (@ $i:ident $limit:expr, $body:block, $($value:literal)*) => {
        $({
            const $i: usize = $value;
            if $i < $limit $body
        })*
    };
}

// No closures below: they are functions of their own, and the compiler would not inline the wide instructions into them.

/// ‖z_i‖² of eight trials, the axes added in order.
#[inline(always)]
fn norm<V: Vector, const D: usize>(z: &[Lane], i: usize) -> V::Eight {
    let first = V::load(&z[i * D]);
    let mut sum = V::mul(first, first);
    for x in 1..D {
        let a = V::load(&z[i * D + x]);
        sum = V::add(sum, V::mul(a, a));
    }
    sum
}

/// ‖z_i − z_j‖² of eight trials.
#[inline(always)]
fn distance<V: Vector, const D: usize>(z: &[Lane], i: usize, j: usize) -> V::Eight {
    let first = V::sub(V::load(&z[i * D]), V::load(&z[j * D]));
    let mut sum = V::mul(first, first);
    for x in 1..D {
        let a = V::sub(V::load(&z[i * D + x]), V::load(&z[j * D + x]));
        sum = V::add(sum, V::mul(a, a));
    }
    sum
}

/// The keys of one strip, and a bit for each trial in which somebody is caught.
#[inline(always)]
fn observe<V: Vector, const N: usize, const M: usize, const D: usize>(
    z: &[Lane],
    sight: &[Lane],
    capture: &[Lane],
) -> ([u64; LANES], u8) {
    let mut keys = V::no_keys();
    let mut caught = 0;
    unrolled!(I < N, {
        let d2 = norm::<V, D>(z, I);
        caught |= V::within(d2, V::load(&capture[I]));
        if I < M {
            keys = V::see(keys, 1 << (I * N + I), d2, V::load(&sight[I]));
        }
        unrolled!(J < I, {
            let d2 = distance::<V, D>(z, I, J);
            if I < M {
                keys = V::see(keys, 1 << (I * N + J), d2, V::load(&sight[I]));
            }
            keys = V::see(keys, 1 << (J * N + I), d2, V::load(&sight[J]));
        });
    });
    (V::keys(keys), caught)
}

/// z ← exp(Cδ) z for one strip whose matrices lie in `slots`; a column is Q registers of four, a matrix E = N·Q.
#[inline(always)]
fn step<V: Vector, const N: usize, const D: usize, const Q: usize, const E: usize>(
    z: &mut [Lane],
    slots: &[u32; LANES],
    matrices: &[[[f64; 4]; E]],
) {
    for half in 0..2 {
        let mut next = [[[V::load4(&[0.0; 4]); 4]; Q]; D];
        for l in 0..4 {
            let lane = 4 * half + l;
            let t = &matrices[slots[lane] as usize];
            for q in 0..Q {
                for x in 0..D {
                    next[x][q][l] = V::scale4(V::load4(&t[q]), z[x][lane]);
                }
                for j in 1..N {
                    let column = V::load4(&t[j * Q + q]);
                    for x in 0..D {
                        next[x][q][l] = V::add_scaled4(next[x][q][l], column, z[j * D + x][lane]);
                    }
                }
            }
        }
        for x in 0..D {
            for q in 0..Q {
                let rows = V::transpose4(next[x][q]);
                for r in 0..4 {
                    if 4 * q + r < N {
                        V::store4(rows[r], &mut z[(4 * q + r) * D + x].as_chunks_mut().0[half]);
                    }
                }
            }
        }
    }
}

/// The slots of eight topologies, or `None` where one is not on the shelf.
#[inline(always)]
fn look_up<const N: usize, const M: usize>(seen: &[u64; LANES], direct: &[u16], shelf: &Shelf) -> Option<[u32; LANES]> {
    let mut slots = [0; LANES];
    for l in 0..LANES {
        slots[l] = if N * M <= DIRECT_BITS {
            // The mask changes nothing; it tells the compiler that the index lies within the slice.
            u32::from(direct[seen[l] as usize & (direct.len() - 1)])
        } else {
            shelf.find(&[seen[l]])
        };
        if slots[l] == 0 {
            return None;
        }
    }
    Some(slots)
}

/// One step of the strips from one on, as far as they can move: a [`Sweep`].
#[inline(always)]
fn sweep<V: Vector, const N: usize, const M: usize, const D: usize, const Q: usize, const E: usize>(
    strips: &mut Strips,
    from: usize,
    shelf: &Shelf,
    next: Option<&Shelf>,
    keys: &mut Keys,
) -> Stop {
    let matrices = shelf.matrices().as_chunks().0.as_chunks().0;
    let places = 1 << if N * M <= DIRECT_BITS { N * M } else { 0 };
    let direct = shelf.direct().get(..places).unwrap_or(&NOTHING[..places]);
    let end = strips.live.div_ceil(LANES);
    let share = next.map_or(0, |next| next.lines().div_ceil(end.max(1)).min(MOST_LINES));
    let mut slots = [[0; LANES]; BLOCK];
    let mut first = from;
    while first < end {
        let (mut ready, mut stop) = (0, Stop::End);
        while ready < BLOCK.min(end - first) {
            let strip = first + ready;
            if let Some(next) = next {
                for line in strip * share..(strip + 1) * share {
                    next.prefetch(line);
                }
            }
            let z = &strips.z[strip * N * D..][..N * D];
            let sight = &strips.sight[strip * strips.sight_step..][..M];
            let capture = &strips.capture[strip * strips.capture_step..][..N];
            let (seen, caught) = observe::<V, N, M, D>(z, sight, capture);
            if caught != 0 {
                let caught = u32::from(caught) & strips.playing(strip);
                if caught != 0 {
                    stop = Stop::Caught(strip, caught);
                    break;
                }
            }
            let Some(found) = look_up::<N, M>(&seen, direct, shelf) else {
                keys[0] = seen;
                stop = Stop::Missing(strip);
                break;
            };
            slots[ready] = found;
            ready += 1;
        }
        for (b, slots) in slots[..ready].iter().enumerate() {
            step::<V, N, D, Q, E>(&mut strips.z[(first + b) * N * D..][..N * D], slots, matrices);
        }
        if stop != Stop::End {
            return stop;
        }
        first += ready;
    }
    Stop::End
}

/// A sweep compiled for its sizes and for a width's registers.
fn sized<const N: usize, const M: usize, const D: usize, const Q: usize, const E: usize>(width: Width) -> Sweep {
    match width {
        Width::Baseline => {
            |_, strips, from, shelf, next, keys| sweep::<Plain, N, M, D, Q, E>(strips, from, shelf, next, keys)
        }
        #[cfg(target_arch = "x86_64")]
        Width::Avx2 => {
            #[target_feature(enable = "avx2")]
            fn wide<const N: usize, const M: usize, const D: usize, const Q: usize, const E: usize>(
                strips: &mut Strips,
                from: usize,
                shelf: &Shelf,
                next: Option<&Shelf>,
                keys: &mut Keys,
            ) -> Stop {
                sweep::<Wide256, N, M, D, Q, E>(strips, from, shelf, next, keys)
            }
            |_, strips, from, shelf, next, keys| {
                debug_assert!(std::arch::is_x86_feature_detected!("avx2"));
                // SAFETY: this width exists only where the processor said that it has AVX2.
                unsafe { wide::<N, M, D, Q, E>(strips, from, shelf, next, keys) }
            }
        }
        #[cfg(target_arch = "x86_64")]
        Width::Avx512 => {
            #[target_feature(enable = "avx2,avx512f,avx512vl")]
            fn wide<const N: usize, const M: usize, const D: usize, const Q: usize, const E: usize>(
                strips: &mut Strips,
                from: usize,
                shelf: &Shelf,
                next: Option<&Shelf>,
                keys: &mut Keys,
            ) -> Stop {
                sweep::<Wide512, N, M, D, Q, E>(strips, from, shelf, next, keys)
            }
            |_, strips, from, shelf, next, keys| {
                debug_assert!(std::arch::is_x86_feature_detected!("avx512vl"));
                // SAFETY: this width exists only where the processor said that it has AVX2, AVX-512F and AVX-512VL.
                unsafe { wide::<N, M, D, Q, E>(strips, from, shelf, next, keys) }
            }
        }
    }
}

/// The sweep for a shape: compiled for N ≤ 8 in the plane and in space, one version for all else.
pub(super) fn sweep_of(shape: &Shape, width: Width) -> Sweep {
    macro_rules! choose {
        ($($n:literal $m:literal $q:literal;)*) => {
            match (shape.size, shape.rows, shape.dim) {
                $(($n, $m, 2) => sized::<$n, $m, 2, $q, { $n * $q }>(width), ($n, $m, 3) => sized::<$n, $m, 3, $q, { $n * $q }>(width),)*
                _ => sweep_any,
            }
        };
    }
    choose! {
        2 1 1; 2 2 1; 3 2 1; 3 3 1; 4 3 1; 4 4 1; 5 4 2; 5 5 2; 6 5 2; 6 6 2; 7 6 2; 7 7 2; 8 7 2; 8 8 2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ensemble::anysize::observe_any;
    use crate::network::{self, Topology, squared_reach};
    use crate::simulation::Reach;

    /// Points whose distances are whole numbers, on the rims of whole radii: as one run sees and ends them.
    #[test]
    fn rims_belong_to_the_balls_at_every_size() {
        let points = [
            [9.0, 12.0],
            [18.0, 24.0],
            [0.0, 15.0],
            [15.0, 36.0],
            [-9.0, 12.0],
            [0.0, 30.0],
            [24.0, 45.0],
            [-15.0, 0.0],
        ];
        let radii = [15.0, 30.0, 39.0, 15.0_f64.next_down(), 9.0, 6.0, 18.0, 12.0];
        let shape = Shape { size: 3, rows: 2, dim: 2, words: 1 };
        for turn in 0..radii.len() {
            let row = |lane: usize, i: usize| points[(lane + 3 * i) % points.len()];
            let radius = |lane: usize, i: usize| squared_reach(radii[(lane + i + turn) % radii.len()]);
            let z: Vec<Lane> = (0..6).map(|e| std::array::from_fn(|l| row(l, e / 2)[e % 2])).collect();
            let sight: Vec<Lane> = (0..2).map(|i| std::array::from_fn(|l| radius(l, i))).collect();
            let capture: Vec<Lane> = (0..3).map(|i| std::array::from_fn(|l| radius(l, i + 2))).collect();
            let mut keys = vec![[0; LANES]];
            let caught = observe_any(&shape, &z, &sight, &capture, &mut keys);
            let (compiled, ends) = observe::<Plain, 3, 2, 2>(&z, &sight, &capture);
            assert_eq!((keys[0], caught), (compiled, u32::from(ends)));
            // With nothing on the shelf a sweep stops with what it saw, or with whom it caught.
            let nothing = [-1.0; LANES];
            for (capture, caught) in [(capture, caught), (vec![nothing; 3], 0)] {
                let expected = if caught == 0 { Stop::Missing(0) } else { Stop::Caught(0, caught) };
                for width in Width::all() {
                    let (z, sight, capture) = (z.clone(), sight.clone(), capture.clone());
                    let mut strips = Strips { z, sight, capture, sight_step: 0, capture_step: 0, live: LANES };
                    let mut seen = vec![[0; LANES]];
                    let stop = sweep_of(&shape, width)(&shape, &mut strips, 0, &Shelf::new(2, 3), None, &mut seen);
                    assert_eq!(stop, expected, "{width:?}");
                    assert!(caught != 0 || seen == keys, "{width:?}");
                }
            }
            for l in 0..LANES {
                let state: Vec<f64> = z.iter().map(|lane| lane[l]).collect();
                let mut topology = Topology::empty(2, 3);
                network::observe(&state, 2, &[sight[0][l], sight[1][l]], &mut topology);
                assert_eq!(topology.key(), Some(keys[0][l]));
                let reach = Reach::new(&[2, 3, 4].map(|i| radii[(l + i + turn) % radii.len()]));
                assert_eq!(reach.ends(&state, 2).is_some(), caught >> l & 1 == 1);
            }
        }
    }

    /// Stops, keys and states are those of the version that takes one strip after another, at every width.
    #[test]
    fn blocks_stop_where_single_strips_do() {
        let shape = Shape { size: 4, rows: 3, dim: 2, words: 1 };
        // In (−1, 1), without a pattern.
        let wave = |i: usize| ((12.9898 * i as f64 + 4.1).sin() * 43758.5453).fract();
        let mut shelf = Shelf::new(3, 4);
        for key in (0..1 << 12).filter(|key| key % 41 != 3) {
            let matrix: Vec<f64> = (0..16).map(|e| f64::from(e % 5 == 0) + 0.01 * wave(e + key)).collect();
            shelf.insert(&[key as u64], None, &matrix);
        }
        let strips = || Strips {
            z: (0..40 * 8).map(|e| std::array::from_fn(|l| 2.0 * wave(8 * e + l))).collect(),
            sight: vec![[4.0; LANES], [2.0; LANES], [1.0; LANES]],
            capture: vec![[0.04; LANES]; 4],
            sight_step: 0,
            capture_step: 0,
            live: 40 * LANES - 3,
        };
        for width in Width::all() {
            let (mut ours, mut single) = (strips(), strips());
            let (mut keys, mut expected) = (vec![[0; LANES]], vec![[0; LANES]]);
            let (mut from, mut counts) = (0, [0; 2]);
            loop {
                let stop = sweep_of(&shape, width)(&shape, &mut ours, from, &shelf, Some(&shelf), &mut keys);
                assert_eq!(stop, sweep_any(&shape, &mut single, from, &shelf, None, &mut expected), "{width:?}");
                assert_eq!(ours.z, single.z, "{width:?} {stop:?}");
                match stop {
                    Stop::End => break,
                    Stop::Caught(strip, _) => {
                        // All eight a long way off, where nobody sees or catches anybody.
                        for all in [&mut ours, &mut single] {
                            all.z[8 * strip..][..8]
                                .iter_mut()
                                .enumerate()
                                .for_each(|(e, z)| *z = [10.0 * (1 + e) as f64; 8]);
                        }
                        (from, counts[0]) = (strip, counts[0] + 1);
                    }
                    Stop::Missing(strip) => {
                        assert_eq!(keys, expected);
                        (from, counts[1]) = (strip + 1, counts[1] + 1);
                    }
                }
            }
            assert!(counts.iter().all(|&count| count > 3 && count < 30), "{counts:?}");
        }
    }
}
