//! Many games of one policy, outcomes only.
mod play;

use rayon::prelude::*;

use crate::cancel::CancelToken;
use crate::error::RunError;
use crate::policy::Policy;
use crate::simulation::{Outcome, Setup};
use crate::synthesis::Synthesizer;

/// Positions and radii of M games; radii are M rows, or one row shared by all.
#[derive(Debug, Clone, Copy)]
pub struct Batch<'a> {
    /// Axes.
    pub dim: usize,
    /// M × (n + 2) × dim.
    pub positions: &'a [f64],
    /// M × m or 1 × m.
    pub visibility: &'a [f64],
    /// M × (n + 1) or 1 × (n + 1).
    pub capture: &'a [f64],
}

impl Batch<'_> {
    /// M.
    #[must_use]
    pub fn len(&self, players: usize) -> usize {
        self.positions.len() / (players * self.dim)
    }

    fn setup(&self, i: usize, n: usize, m: usize) -> Setup<'_> {
        let row = |all: &'_ [f64], width: usize, i: usize| -> std::ops::Range<usize> {
            let i = if all.len() == width { 0 } else { i };
            i * width..(i + 1) * width
        };
        let width = (n + 2) * self.dim;
        Setup {
            dim: self.dim,
            positions: &self.positions[i * width..(i + 1) * width],
            visibility: &self.visibility[row(self.visibility, m, i)],
            capture: &self.capture[row(self.capture, n + 1, i)],
        }
    }
}

/// Plays every game of `batch`; outcomes and final grid indices in order.
pub fn run(
    policy: &Policy,
    batch: &Batch,
    threads: Option<usize>,
    cancel: &CancelToken,
) -> Result<Vec<(Outcome, usize)>, RunError> {
    let (n, m) = (policy.game().n(), policy.game().constrained());
    let trials = batch.len(n + 2);
    for i in 0..trials {
        batch.setup(i, n, m).check(policy.game())?;
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build();
    let Ok(pool) = pool else { return Err(RunError::Cancelled(crate::error::Cancelled)) };
    pool.install(|| {
        (0..trials)
            .into_par_iter()
            .map_init(Synthesizer::new, |solver, i| Ok(play::play(policy, &batch.setup(i, n, m), solver, cancel)?))
            .collect()
    })
}
