//! One step of eight trials at a time: who is caught or far off, who sees whom, and the product, in vector registers.
//!
//! Every sum runs in the order of a run that is recorded and no product is fused with a sum, so that a trial
//! ends bitwise as it would alone, at every [`Width`].
//!
//! Memory is what a step waits for, so nothing is asked for when it is needed: the blocks of a run are read before any
//! of them moves, which puts independent work between a lookup and the product that needs it, and every run fetches a
//! part of the next instant's table.

use super::anysize::sweep_any;
use super::block::{BLOCK, Blocks, Keys, PerTrial, Shape, Stop, Sweep, playing};
use super::eight::{distance, norm};
use super::network::{Network, link};
use crate::policy::index::DIRECT_BITS;
use crate::policy::step_table::StepTable;
use crate::simd::{Number, Simd, Width, dispatch};

/// Blocks that are looked at before any of them moves: their states, 8 KiB for four rows in the plane, stay in the first
/// cache in between.
const AHEAD: usize = 16;

/// Lines of the next instant's table that a block fetches at most: few blocks need few entries.
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

/// The keys of one block, and a bit for each trial in which somebody is caught or far off. With H, links within `reach`
/// come after the edges.
#[inline(always)]
pub fn observe<V: Simd, const N: usize, const M: usize, const D: usize, const H: bool>(
    z: &[PerTrial],
    sight: &[PerTrial],
    capture: &[PerTrial],
    far: &PerTrial,
    reach: &[f64],
) -> (V::Keys, u8) {
    let mut keys = V::no_keys();
    let mut caught = 0;
    let mut most = V::Eight::splat(0.0);
    unrolled!(I < N, {
        let d2 = norm::<V, D>(z, I);
        caught |= V::Eight::bits(d2.at_most(V::Eight::load(&capture[I]))) as u8;
        // What is no number in one row is none in any row a step later: the first row alone has to show it.
        most = if I == 0 { d2 } else { most.or_larger(d2) };
        if I < M {
            keys = V::set(keys, 1 << (I * N + I), d2.at_most(V::Eight::load(&sight[I])));
        }
        unrolled!(J < I, {
            let d2 = distance::<V, D>(z, I, J);
            if I < M {
                keys = V::set(keys, 1 << (I * N + J), d2.at_most(V::Eight::load(&sight[I])));
            }
            keys = V::set(keys, 1 << (J * N + I), d2.at_most(V::Eight::load(&sight[J])));
            if H && I < M {
                keys = V::set(keys, 1 << (N * M + link(M, I, J)), d2.at_most(V::Eight::splat(reach[J])));
                keys = V::set(keys, 1 << (N * M + link(M, J, I)), d2.at_most(V::Eight::splat(reach[I])));
            }
        });
    });
    (keys, caught | !(V::Eight::bits(most.at_most(V::Eight::load(far))) as u8))
}

/// z ← exp(Cδ) z for one block whose matrices lie in `slots`; a column is Q registers of four, a matrix E = N·Q.
#[inline(always)]
fn step<V: Simd, const N: usize, const D: usize, const Q: usize, const E: usize>(
    z: &mut [PerTrial],
    slots: &[u32; BLOCK],
    matrices: &[[[f64; 4]; E]],
) {
    for half in 0..2 {
        let mut next = [[[V::Four::splat(0.0); 4]; Q]; D];
        for l in 0..4 {
            let member = 4 * half + l;
            let t = &matrices[slots[member] as usize];
            for q in 0..Q {
                for x in 0..D {
                    next[x][q][l] = V::Four::load(&t[q]) * V::Four::splat(z[x][member]);
                }
                for j in 1..N {
                    let column = V::Four::load(&t[j * Q + q]);
                    for x in 0..D {
                        // Rounded twice: no product is fused with a sum.
                        next[x][q][l] = next[x][q][l] + column * V::Four::splat(z[j * D + x][member]);
                    }
                }
            }
        }
        for x in 0..D {
            for q in 0..Q {
                let rows = V::transpose(next[x][q]);
                for r in 0..4 {
                    if 4 * q + r < N {
                        rows[r].store(&mut z[(4 * q + r) * D + x][4 * half..]);
                    }
                }
            }
        }
    }
}

/// Keys that are their own index are read as words of 16 bits.
const _: () = assert!(DIRECT_BITS <= 16);

/// Writes the slots of eight topologies; whether all are in the table.
#[inline(always)]
fn look_up<V: Simd, const N: usize, const M: usize>(
    seen: V::Keys,
    direct: &[u16],
    table: &StepTable,
    slots: &mut [u32; BLOCK],
) -> bool {
    // A branch for each slot: what is asked of all in the end, compilers gather in a register one by one.
    if N * M <= DIRECT_BITS {
        let mut low = V::low(seen);
        for half in 0..2 {
            for l in 0..BLOCK / 2 {
                // The mask changes nothing; it tells the compiler that the index lies within the slice.
                let slot = u32::from(direct[low[half] as usize & (direct.len() - 1)]);
                low[half] >>= 16;
                slots[half * BLOCK / 2 + l] = slot;
                if slot == 0 {
                    return false;
                }
            }
        }
    } else {
        for (slot, key) in slots.iter_mut().zip(V::keys(seen)) {
            *slot = table.find(&[key]);
            if *slot == 0 {
                return false;
            }
        }
    }
    true
}

/// What comes between sight and network: nothing, or what is called block by block; what stays in registers; and that with
/// distances of links.
const CALLED: usize = 0;
const IN_REGISTERS: usize = 1;
const WITH_REACHES: usize = 2;

/// One step of the blocks from one on, as far as they can move: a [`Sweep`].
#[inline(always)]
fn sweep<V: Simd, const N: usize, const M: usize, const D: usize, const Q: usize, const E: usize, const W: usize>(
    blocks: &mut Blocks,
    from: usize,
    table: &StepTable,
    next: Option<&StepTable>,
    keys: &mut Keys,
) -> Stop {
    let reach: [f64; M] = match &blocks.network {
        Some(network) if W == WITH_REACHES => *network.reach().first_chunk().unwrap_or(&[-1.0; M]),
        _ => [-1.0; M],
    };
    let matrices = table.matrices().as_chunks().0.as_chunks().0;
    let places = 1 << if N * M <= DIRECT_BITS { N * M } else { 0 };
    let direct = table.direct().get(..places).unwrap_or(&NOTHING[..places]);
    let end = blocks.live.div_ceil(BLOCK);
    let mut slots = [[0; BLOCK]; AHEAD];
    let mut first = from;
    while first < end {
        let count = AHEAD.min(end - first);
        if let Some(next) = next {
            // As many lines for each block of a step.
            let lines = next.lines();
            let share = lines.div_ceil(end).min(MOST_LINES);
            for line in first * share..((first + count) * share).min(lines) {
                next.prefetch(line);
            }
        }
        let (mut ready, mut stop) = (0, Stop::End);
        let ahead = &mut blocks.z[first * N * D..][..count * N * D];
        for (z, slots) in ahead.chunks_exact(N * D).zip(&mut slots) {
            let block = first + ready;
            let sight = &blocks.sight[block * blocks.sight_step..][..M];
            let capture = &blocks.capture[block * blocks.capture_step..][..N];
            let far = &blocks.far[block];
            let (mut seen, over) = if W == WITH_REACHES {
                observe::<V, N, M, D, true>(z, sight, capture, far, &reach)
            } else {
                observe::<V, N, M, D, false>(z, sight, capture, far, &reach)
            };
            if over != 0 {
                let over = u32::from(over) & playing(blocks.live, block);
                if over != 0 {
                    stop = Stop::Over(block, over);
                    break;
                }
            }
            if let Some(network) = &mut blocks.network {
                if W == CALLED {
                    keys[0] = V::keys(seen);
                    network.apply(block, z, keys);
                    seen = V::load_keys(&keys[0]);
                } else {
                    seen = network.in_force::<V>(block, seen);
                }
            }
            if !look_up::<V, N, M>(seen, direct, table, slots) {
                keys[0] = V::keys(seen);
                if W != CALLED {
                    Network::plain(&mut keys[0]);
                }
                stop = Stop::Missing(block);
                break;
            }
            ready += 1;
        }
        for (z, slots) in ahead.chunks_exact_mut(N * D).zip(&slots[..ready]) {
            step::<V, N, D, Q, E>(z, slots, matrices);
        }
        if stop != Stop::End {
            return stop;
        }
        first += ready;
    }
    Stop::End
}

dispatch! {
    /// A sweep compiled for its sizes.
    fn sized<V, const N: usize, const M: usize, const D: usize, const Q: usize, const E: usize>(
        shape: &Shape,
        blocks: &mut Blocks,
        from: usize,
        table: &StepTable,
        next: Option<&StepTable>,
        keys: &mut Keys,
    ) -> Stop {
        if const { V::SIZED } {
            sweep::<V, N, M, D, Q, E, CALLED>(blocks, from, table, next, keys)
        } else {
            // All widths agree bitwise: where loops are slow anyway, one version for all sizes will do.
            sweep_any(Width::Baseline, shape, blocks, from, table, next, keys)
        }
    }
}

dispatch! {
    /// The same with a network in registers: a function of its own, so that the other stays as it is without worlds.
    fn sized_in_world<V, const N: usize, const M: usize, const D: usize, const Q: usize, const E: usize, const W: usize>(
        shape: &Shape,
        blocks: &mut Blocks,
        from: usize,
        table: &StepTable,
        next: Option<&StepTable>,
        keys: &mut Keys,
    ) -> Stop {
        if const { V::SIZED } {
            sweep::<V, N, M, D, Q, E, W>(blocks, from, table, next, keys)
        } else {
            sweep_any(Width::Baseline, shape, blocks, from, table, next, keys)
        }
    }
}

/// The sweep for a shape, and for what comes between sight and network: compiled for N ≤ 8 in the plane and in space, one
/// version for all else.
// Inlined, it would have every version compiled once more where it is called.
#[inline(never)]
pub fn sweep_of(shape: &Shape, network: Option<&Network>) -> Sweep {
    macro_rules! in_registers {
        ($w:ident: $($n:literal $m:literal;)*) => {
            match (shape.size, shape.rows, shape.dim) {
                $(($n, $m, 2) => return sized_in_world::<$n, $m, 2, 1, $n, $w>,
                  ($n, $m, 3) => return sized_in_world::<$n, $m, 3, 1, $n, $w>,)*
                _ => {}
            }
        };
    }
    // Keys that are their own index, of teams of more than one.
    match network.filter(|network| network.in_registers()) {
        Some(network) if network.reach().is_empty() => in_registers!(IN_REGISTERS: 2 2; 3 2; 3 3; 4 3;),
        Some(_) => in_registers!(WITH_REACHES: 2 2; 3 2; 3 3; 4 3;),
        None => {}
    }
    macro_rules! choose {
        ($($n:literal $m:literal $q:literal;)*) => {
            match (shape.size, shape.rows, shape.dim) {
                $(($n, $m, 2) => sized::<$n, $m, 2, $q, { $n * $q }>, ($n, $m, 3) => sized::<$n, $m, 3, $q, { $n * $q }>,)*
                _ => sweep_any,
            }
        };
    }
    choose! {
        2 1 1; 2 2 1; 3 2 1; 3 3 1; 4 3 1; 4 4 1; 5 4 2; 5 5 2; 6 5 2; 6 6 2; 7 6 2; 7 7 2; 8 7 2; 8 8 2;
    }
}
