//! Outcome maps with proof: boxes of one player's start in the plane from which every game ends alike.
//!
//! One player starts anywhere in a box, everyone else where the setup has them. The step matrix acts on rows, alike on both
//! axes, so the states of the starts p = p₀ + s of a box are z = c + α s with *scalars* α_i: boxes stay boxes, and what is
//! within a radius is a disc in the plane of p itself. Where a radius crosses the states, both continuations are followed;
//! where two outcomes are possible, the box is cut in four.
//!
//! What is proved holds for every start in the (closed) box, played with the tabulated step matrices: by the engine's own
//! arithmetic, whose roundings are bounded at every step, and in exact arithmetic.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | p | [`Region`] | the start that varies |
//! | c, α, A r + β | `enclosure` | what encloses the states of a cell |
//! | ζ, σ | `guards` | what is certain at an instant, and what is open |
//! | cells | [`Map`] | those that are settled ([`Leaf`]), and those to come |
//!
//! A cell's fate depends on the cell alone, so a map is the same for any number of threads and any way of cutting it.

mod cell;
mod chunk;
mod enclosure;
mod guards;
mod map;
#[cfg(test)]
mod tests;

pub use map::Map;

use crate::simulation::{Outcome, Setup};

/// Whose start varies, and where.
#[derive(Debug, Clone, Copy)]
pub struct Region<'a> {
    /// The game's radii, and where everyone else starts; in the plane.
    pub setup: Setup<'a>,
    /// The row of `setup.positions` that varies.
    pub player: usize,
    /// Its least coordinates.
    pub low: [f64; 2],
    /// Its largest coordinates.
    pub high: [f64; 2],
}

/// What is known of a cell that is settled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Every start in it ends so.
    Proved(Outcome),
    /// More than one outcome may be possible, and a smaller cell was not wanted.
    Fine,
    /// The same, and the budget was used up.
    Budget,
    /// Every start in it diverges, which is not followed further.
    Diverges,
}

/// A cell that is settled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Leaf {
    /// Its least coordinates.
    pub low: [f64; 2],
    /// Its largest coordinates.
    pub high: [f64; 2],
    /// How often the cells of the first level were cut to make it.
    pub level: u32,
    /// What is known of it.
    pub verdict: Verdict,
}
