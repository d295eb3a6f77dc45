//! Trials side by side in blocks of eight, and what it means to move them one step.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | z | [`Blocks::z`] | row j on axis x of eight trials lies in one [`PerTrial`], at block · N·dim + j·dim + x |
//! | ζ², σ² | [`Blocks::sight`], [`Blocks::capture`] | squared reaches, a [`PerTrial`] each, or one block shared by all |
//! | max ‖z_i‖² | [`Blocks::far`] | the squared distance from the attacker beyond which a trial is looked at |
//! | 𝒜 | [`Keys`] | bit i·N + j: player i sees player j (j = i: the attacker) |
//! | exp(Cδ) | [`StepTable`] | by columns, so that a column times one number is a vector operation |
//!
//! A [`Sweep`] moves blocks; [`super::sweep`] has it compiled for the sizes that matter, [`super::anysize`] for all
//! others.

pub use super::eight::{BLOCK, PerTrial, Shape};
use super::network::Network;
use crate::policy::step_table::StepTable;
use crate::simd::Width;

/// The trials of a chunk, block after block.
pub struct Blocks {
    /// States.
    pub z: Vec<PerTrial>,
    /// Squared visibility radii, m a block.
    pub sight: Vec<PerTrial>,
    /// Squared capture radii, N a block: d₁…d_n, then the attacker's on the target's row.
    pub capture: Vec<PerTrial>,
    /// The squared distance from the attacker that nobody passes unseen, one a block.
    pub far: Vec<PerTrial>,
    /// Entries from one block's sight to the next: 0 where all trials share one.
    pub sight_step: usize,
    /// The same for the capture radii.
    pub capture_step: usize,
    /// What comes between sight and network; nothing in the paper's game.
    pub network: Option<Box<Network>>,
    /// Trials that still play; they fill the blocks from the front.
    pub live: usize,
}

/// Why a sweep stopped, and at which block.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stop {
    /// Every block has made its step.
    End,
    /// In some live trials of a block (a bit each) somebody is caught, or far off; the block has not moved.
    Over(usize, u32),
    /// Some topologies of a block are not in the table; the block has not moved.
    Missing(usize),
}

/// The topologies of one block: each word of its eight trials.
pub type Keys = Vec<[u64; BLOCK]>;

/// Moves the blocks from one on by one step, up to the first that cannot move; its keys are left in the last argument.
///
/// The first table is the instant's. The second, if there is one, is the next instant's: it is fetched from memory
/// while the blocks move.
pub type Sweep = fn(Width, &Shape, &mut Blocks, usize, &StepTable, Option<&StepTable>, &mut Keys) -> Stop;

impl Blocks {
    /// Copies a trial from one place to another.
    pub fn copy(&mut self, shape: &Shape, from: usize, to: usize) {
        let steps = [shape.size * shape.dim, self.sight_step, self.capture_step, 1];
        let all = [&mut self.z, &mut self.sight, &mut self.capture, &mut self.far];
        for (numbers, step) in all.into_iter().zip(steps) {
            for e in 0..step {
                numbers[to / BLOCK * step + e][to % BLOCK] = numbers[from / BLOCK * step + e][from % BLOCK];
            }
        }
        if let Some(network) = &mut self.network {
            network.copy(from, to);
        }
    }
}

/// A bit for each place of a block in which one of `live` trials plays.
#[inline(always)]
pub fn playing(live: usize, block: usize) -> u32 {
    match live - block * BLOCK {
        count @ 0..BLOCK => (1 << count) - 1,
        _ => u32::MAX,
    }
}
