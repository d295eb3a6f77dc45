//! Trials side by side in strips of eight, and what it means to move them one step.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | z | [`Strips::z`] | row j on axis x of eight trials lies in one [`Lane`], at strip · N·dim + j·dim + x |
//! | ζ², σ² | [`Strips::sight`], [`Strips::capture`] | squared reaches, a lane each, or one strip shared by all |
//! | 𝒜 | [`Keys`] | bit i·N + j: player i sees player j (j = i: the attacker) |
//! | exp(Cδ) | [`Shelf`] | by columns, so that a column times one number is a vector operation |
//!
//! A [`Sweep`] moves strips; [`super::sweep`] has it compiled for the sizes that matter, [`super::anysize`] for all others.

use crate::policy::step_table::Shelf;
use crate::simd::Width;

/// Trials side by side.
pub const LANES: usize = 8;
/// One number of each of them.
pub type Lane = [f64; LANES];

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

/// The trials of a chunk, strip after strip.
#[derive(Debug)]
pub struct Strips {
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
pub enum Stop {
    /// Every strip has made its step.
    End,
    /// Some live trials of a strip are over (a bit each); the strip has not moved.
    Caught(usize, u32),
    /// Some topologies of a strip are not on the shelf; the strip has not moved.
    Missing(usize),
}

/// The topologies of one strip, a lane for each word.
pub type Keys = Vec<[u64; LANES]>;

/// Moves the strips from one on by one step, up to the first that cannot move; its keys are left in the last argument.
///
/// The first shelf is the instant's. The second, if there is one, is the next instant's: it is fetched from memory while
/// the strips move.
pub type Sweep = fn(Width, &Shape, &mut Strips, usize, &Shelf, Option<&Shelf>, &mut Keys) -> Stop;

impl Strips {
    /// Copies a trial from one place to another.
    pub fn copy(&mut self, shape: &Shape, from: usize, to: usize) {
        let steps = [shape.size * shape.dim, self.sight_step, self.capture_step];
        for (lanes, step) in [&mut self.z, &mut self.sight, &mut self.capture].into_iter().zip(steps) {
            for e in 0..step {
                lanes[to / LANES * step + e][to % LANES] = lanes[from / LANES * step + e][from % LANES];
            }
        }
    }
}

/// A bit for each place of a strip in which one of `live` trials plays.
#[inline(always)]
pub fn playing(live: usize, strip: usize) -> u32 {
    match live - strip * LANES {
        count @ 0..LANES => (1 << count) - 1,
        _ => u32::MAX,
    }
}
