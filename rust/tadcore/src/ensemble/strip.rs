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
//! ends as it would alone, to the bit, at every [`Width`](crate::width::Width).

use crate::policy::shelf::Shelf;
use crate::width::widened;

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

/// ‖z_i‖² of eight trials.
#[inline(always)]
fn norms(zi: &[Lane]) -> Lane {
    let mut sum = [0.0; LANES];
    for (x, lane) in zi.iter().enumerate() {
        for l in 0..LANES {
            let square = lane[l] * lane[l];
            sum[l] = if x == 0 { square } else { sum[l] + square };
        }
    }
    sum
}

/// ‖z_i − z_j‖² of eight trials.
#[inline(always)]
fn distances(zi: &[Lane], zj: &[Lane]) -> Lane {
    let mut sum = [0.0; LANES];
    for (x, (a, b)) in zi.iter().zip(zj).enumerate() {
        for l in 0..LANES {
            let difference = a[l] - b[l];
            let square = difference * difference;
            sum[l] = if x == 0 { square } else { sum[l] + square };
        }
    }
    sum
}

/// Sets a bit in the keys of the trials whose squared distance is within reach.
#[inline(always)]
fn see(keys: &mut [[u64; LANES]], bit: usize, d2: &Lane, reach: &Lane) {
    let word = &mut keys[bit / 64];
    for l in 0..LANES {
        word[l] |= u64::from(d2[l] <= reach[l]) << (bit % 64);
    }
}

/// The keys of one strip, and a bit for each trial in which somebody is caught.
#[inline(always)]
fn observe<const N: usize, const M: usize, const D: usize>(
    shape: &Shape,
    z: &[Lane],
    sight: &[Lane],
    capture: &[Lane],
    keys: &mut [[u64; LANES]],
) -> u32 {
    let (n, m, d) = if N > 0 { (N, M, D) } else { (shape.size, shape.rows, shape.dim) };
    keys.fill([0; LANES]);
    let mut caught = [0u64; LANES];
    for i in 0..n {
        let zi = &z[i * d..(i + 1) * d];
        let d2 = norms(zi);
        for l in 0..LANES {
            caught[l] |= u64::from(d2[l] <= capture[i][l]) << l;
        }
        if i < m {
            see(keys, i * n + i, &d2, &sight[i]);
        }
        for j in 0..i {
            let d2 = distances(zi, &z[j * d..(j + 1) * d]);
            if i < m {
                see(keys, i * n + j, &d2, &sight[i]);
            }
            see(keys, j * n + i, &d2, &sight[j]);
        }
    }
    caught.iter().fold(0, |all, &bit| all | bit) as u32
}

/// z ← exp(Cδ) z for one strip whose matrices lie in `slots`. `A` is the padded N.
#[inline(always)]
fn step<const N: usize, const D: usize, const A: usize>(z: &mut [Lane], slots: &[usize; LANES], matrices: &[f64]) {
    for x in 0..D {
        let mut next = [[0.0; A]; LANES];
        for l in 0..LANES {
            let t = &matrices[slots[l] * N * A..][..N * A];
            let first = z[x][l];
            for a in 0..A {
                next[l][a] = t[a] * first;
            }
            for j in 1..N {
                let value = z[j * D + x][l];
                for a in 0..A {
                    next[l][a] += t[j * A + a] * value;
                }
            }
        }
        for a in 0..N {
            for l in 0..LANES {
                z[a * D + x][l] = next[l][a];
            }
        }
    }
}

/// The same for sizes known only at run time.
fn step_any(shape: &Shape, z: &mut [Lane], slots: &[usize; LANES], matrices: &[f64], next: &mut Vec<f64>) {
    let (n, d) = (shape.size, shape.dim);
    next.resize(n, 0.0);
    let stride = n * crate::policy::shelf::padded(n);
    for (l, slot) in slots.iter().enumerate() {
        let t = &matrices[slot * stride..][..stride];
        for x in 0..d {
            next.fill(0.0);
            for (j, column) in t.chunks_exact(stride / n).enumerate() {
                let value = z[j * d + x][l];
                for (sum, c) in next.iter_mut().zip(column) {
                    *sum += c * value;
                }
            }
            for (a, &value) in next.iter().enumerate() {
                z[a * d + x][l] = value;
            }
        }
    }
}

/// The slots of eight keys, and whether all were found.
#[inline(always)]
fn find<const N: usize>(shape: &Shape, shelf: &Shelf, keys: &[[u64; LANES]]) -> ([usize; LANES], bool) {
    let mut slots = [0; LANES];
    for l in 0..LANES {
        let slot = if N > 0 || shape.words == 1 {
            shelf.find(&[keys[0][l]])
        } else {
            let words: Vec<u64> = keys.iter().map(|word| word[l]).collect();
            shelf.find(&words)
        };
        slots[l] = slot as usize;
    }
    (slots, slots.iter().all(|&slot| slot != 0))
}

widened! {
    /// Moves the strips from `from` on by one step, up to the first that cannot move; its keys are left in `keys`.
    fn sweep<const N: usize, const M: usize, const D: usize, const A: usize>(
        shape: &Shape,
        strips: &mut Strips,
        from: usize,
        shelf: &Shelf,
        keys: &mut Keys,
    ) -> Stop {
        let (n, m, d) = if N > 0 { (N, M, D) } else { (shape.size, shape.rows, shape.dim) };
        let mut next = Vec::new();
        for strip in from..strips.live.div_ceil(LANES) {
            let z = &mut strips.z[strip * n * d..][..n * d];
            let sight = &strips.sight[strip * strips.sight_step..][..m];
            let capture = &strips.capture[strip * strips.capture_step..][..n];
            let mut word = [[0; LANES]];
            let seen = if N > 0 { &mut word[..] } else { &mut keys[..] };
            let caught = observe::<N, M, D>(shape, z, sight, capture, seen);
            if caught != 0 {
                let playing = strips.live - strip * LANES;
                let caught = if playing >= LANES { caught } else { caught & ((1 << playing) - 1) };
                if caught != 0 {
                    return Stop::Caught(strip, caught);
                }
            }
            let (slots, complete) = find::<N>(shape, shelf, seen);
            if !complete {
                if N > 0 {
                    keys[0] = word[0];
                }
                return Stop::Missing(strip);
            }
            if N > 0 {
                step::<N, D, A>(z, &slots, shelf.matrices());
            } else {
                step_any(shape, z, &slots, shelf.matrices(), &mut next);
            }
        }
        Stop::End
    }
}

/// A sweep compiled for its sizes.
pub(super) type Sweep = fn(crate::width::Width, &Shape, &mut Strips, usize, &Shelf, &mut Keys) -> Stop;

/// The sweep for a shape: compiled for N ≤ 8 in the plane and in space, one version for all else.
pub(super) fn sweep_of(shape: &Shape) -> Sweep {
    macro_rules! sized {
        ($($n:literal $m:literal $a:literal;)*) => {
            match (shape.size, shape.rows, shape.dim) {
                $(($n, $m, 2) => sweep::<$n, $m, 2, $a>, ($n, $m, 3) => sweep::<$n, $m, 3, $a>,)*
                _ => sweep::<0, 0, 0, 0>,
            }
        };
    }
    sized! {
        2 1 2; 2 2 2; 3 2 4; 3 3 4; 4 3 4; 4 4 4; 5 4 8; 5 5 8; 6 5 8; 6 6 8; 7 6 8; 7 7 8; 8 7 8; 8 8 8;
    }
}
