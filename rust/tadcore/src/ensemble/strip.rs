//! Eight trials side by side: who is caught, who sees whom, and one step, as loops over vector lanes.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | z | [`Strips::z`] | row j on axis x of eight trials lies in one [`Lane`], at strip · N·dim + j·dim + x |
//! | ζ², σ² | [`Strips::sight`], [`Strips::capture`] | squared reaches, a lane each, or one strip shared by all |
//! | 𝒜 | keys | bit i·N + j: player i sees player j (j = i: the attacker) |
//! | exp(Cδ) | [`Shelf`] | by columns, so that a column times one number is a vector operation |
//!
//! Every sum runs in the order of [`crate::simulation::simulate`] and no product is fused with a sum, so that a trial
//! ends as it would alone, to the bit, at every [`Width`].

use super::vector::{Plain, Vector};
#[cfg(target_arch = "x86_64")]
use super::vector::{Wide256, Wide512};
use crate::policy::shelf::{DIRECT_BITS, Shelf, padded};
use crate::width::Width;

/// Trials side by side.
pub(super) const LANES: usize = 8;
/// One number of each of them.
pub(super) type Lane = [f64; LANES];

/// Sizes of a game, for code that is not compiled for them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shape {
    /// N.
    pub size: usize,
    /// m.
    pub rows: usize,
    /// Axes.
    pub dim: usize,
    /// Words of a key.
    pub words: usize,
}

/// The trials of a chunk, strip after strip.
#[derive(Debug)]
pub(super) struct Strips {
    /// States.
    pub z: Vec<Lane>,
    /// Squared visibility radii, m lanes a strip.
    pub sight: Vec<Lane>,
    /// Squared capture radii, N lanes a strip: d₁…d_n, then the attacker's on the target's row.
    pub capture: Vec<Lane>,
    /// Lanes from one strip's sight to the next: 0 where all trials share one.
    pub sight_step: usize,
    /// The same for the capture radii.
    pub capture_step: usize,
    /// Trials that still play; they fill the strips from the front.
    pub live: usize,
}

/// Why a sweep stopped, and at which strip.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stop {
    /// Every strip has made its step.
    End,
    /// Some live trials of a strip are over (a bit each); the strip has not moved.
    Caught(usize, u32),
    /// Some topologies of a strip are not on the shelf; the strip has not moved.
    Missing(usize),
}

/// The topologies of one strip, a lane for each word.
pub(super) type Keys = Vec<[u64; LANES]>;

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

/// z ← exp(Cδ) z for one strip whose matrices lie in `slots`; a column is Q registers of four.
#[inline(always)]
fn step<V: Vector, const N: usize, const D: usize, const Q: usize>(
    z: &mut [Lane],
    slots: &[usize; LANES],
    quads: &[[f64; 4]],
) {
    for half in 0..2 {
        let mut next = [[[V::load4(&[0.0; 4]); 4]; Q]; D];
        for l in 0..4 {
            let lane = 4 * half + l;
            let t = &quads[slots[lane] * N * Q..][..N * Q];
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

#[inline(always)]
fn sweep<V: Vector, const N: usize, const M: usize, const D: usize, const Q: usize>(
    strips: &mut Strips,
    from: usize,
    shelf: &Shelf,
    keys: &mut Keys,
) -> Stop {
    let (quads, direct) = (shelf.matrices().as_chunks().0, shelf.direct());
    for strip in from..strips.live.div_ceil(LANES) {
        let z = &mut strips.z[strip * N * D..][..N * D];
        let sight = &strips.sight[strip * strips.sight_step..][..M];
        let capture = &strips.capture[strip * strips.capture_step..][..N];
        let (seen, caught) = observe::<V, N, M, D>(z, sight, capture);
        if caught != 0 {
            let caught = u32::from(caught) & playing(strips.live, strip);
            if caught != 0 {
                return Stop::Caught(strip, caught);
            }
        }
        let (mut slots, mut missing) = ([0; LANES], false);
        for l in 0..LANES {
            slots[l] = if N * M <= DIRECT_BITS {
                if seen[l] < direct.len() as u64 { usize::from(direct[seen[l] as usize]) } else { 0 }
            } else {
                shelf.find(&[seen[l]]) as usize
            };
            missing |= slots[l] == 0;
        }
        if missing {
            keys[0] = seen;
            return Stop::Missing(strip);
        }
        step::<V, N, D, Q>(z, &slots, quads);
    }
    Stop::End
}

/// A bit for each place of a strip in which a trial plays.
#[inline(always)]
fn playing(live: usize, strip: usize) -> u32 {
    match live - strip * LANES {
        count @ 0..LANES => (1 << count) - 1,
        _ => u32::MAX,
    }
}

/// The same for sizes known only at run time, trial after trial.
fn sweep_any(shape: &Shape, strips: &mut Strips, from: usize, shelf: &Shelf, keys: &mut Keys) -> Stop {
    let (n, d) = (shape.size, shape.dim);
    let stride = n * padded(n);
    let (mut state, mut words) = (vec![0.0; n * d], vec![0; shape.words]);
    let mut next = vec![0.0; padded(n)];
    for strip in from..strips.live.div_ceil(LANES) {
        let z = &mut strips.z[strip * n * d..][..n * d];
        let sight = &strips.sight[strip * strips.sight_step..][..shape.rows];
        let capture = &strips.capture[strip * strips.capture_step..][..n];
        let caught = observe_any(shape, z, sight, capture, keys) & playing(strips.live, strip);
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

/// [`observe`] for any size.
fn observe_any(shape: &Shape, z: &[Lane], sight: &[Lane], capture: &[Lane], keys: &mut Keys) -> u32 {
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

/// Moves the strips from one on by one step, up to the first that cannot move; its keys are left in the last argument.
pub(super) type Sweep = fn(&Shape, &mut Strips, usize, &Shelf, &mut Keys) -> Stop;

/// A sweep compiled for its sizes and for a width's registers.
fn sized<const N: usize, const M: usize, const D: usize, const Q: usize>(width: Width) -> Sweep {
    match width {
        Width::Baseline => |_, strips, from, shelf, keys| sweep::<Plain, N, M, D, Q>(strips, from, shelf, keys),
        #[cfg(target_arch = "x86_64")]
        Width::Avx2 => {
            #[target_feature(enable = "avx2")]
            fn wide<const N: usize, const M: usize, const D: usize, const Q: usize>(
                strips: &mut Strips,
                from: usize,
                shelf: &Shelf,
                keys: &mut Keys,
            ) -> Stop {
                sweep::<Wide256, N, M, D, Q>(strips, from, shelf, keys)
            }
            |_, strips, from, shelf, keys| {
                debug_assert!(std::arch::is_x86_feature_detected!("avx2"));
                // SAFETY: this width exists only where the processor said that it has AVX2.
                unsafe { wide::<N, M, D, Q>(strips, from, shelf, keys) }
            }
        }
        #[cfg(target_arch = "x86_64")]
        Width::Avx512 => {
            #[target_feature(enable = "avx2,avx512f")]
            fn wide<const N: usize, const M: usize, const D: usize, const Q: usize>(
                strips: &mut Strips,
                from: usize,
                shelf: &Shelf,
                keys: &mut Keys,
            ) -> Stop {
                sweep::<Wide512, N, M, D, Q>(strips, from, shelf, keys)
            }
            |_, strips, from, shelf, keys| {
                debug_assert!(std::arch::is_x86_feature_detected!("avx512f"));
                // SAFETY: this width exists only where the processor said that it has AVX2 and AVX-512F.
                unsafe { wide::<N, M, D, Q>(strips, from, shelf, keys) }
            }
        }
    }
}

/// The sweep for a shape: compiled for N ≤ 8 in the plane and in space, one version for all else.
pub(super) fn sweep_of(shape: &Shape, width: Width) -> Sweep {
    macro_rules! choose {
        ($($n:literal $m:literal $q:literal;)*) => {
            match (shape.size, shape.rows, shape.dim) {
                $(($n, $m, 2) => sized::<$n, $m, 2, $q>(width), ($n, $m, 3) => sized::<$n, $m, 3, $q>(width),)*
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
}
