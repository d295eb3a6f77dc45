//! One game without a record: the same steps as [`crate::simulation::simulate`].

use crate::cancel::CancelToken;
use crate::error::Cancelled;
use crate::network::{Topology, observe, squared_reach};
use crate::policy::Policy;
use crate::simulation::{Outcome, Reach, Setup, apply, relative_state};
use crate::synthesis::Synthesizer;

/// Plays one game to its end: its outcome and the grid index of its end.
pub(super) fn play(
    policy: &Policy,
    setup: &Setup,
    solver: &mut Synthesizer,
    cancel: &CancelToken,
) -> Result<(Outcome, usize), Cancelled> {
    let game = policy.game();
    let dim = setup.dim;
    let reach = Reach::new(setup.capture);
    let sight: Vec<f64> = setup.visibility.iter().map(|&zeta| squared_reach(zeta)).collect();
    let mut z = Vec::new();
    relative_state(setup.positions, dim, &mut z);
    let mut next = vec![0.0; z.len()];
    let mut topology = Topology::empty(game.constrained(), game.size());
    let last = game.grid().steps();
    for k in 0..last {
        cancel.check()?;
        if let Some(outcome) = reach.ends(&z, dim) {
            return Ok((outcome, k));
        }
        observe(&z, dim, &sight, &mut topology);
        let step = policy.at(k, &topology, solver);
        for (row, out) in step.transition.chunks_exact(game.size()).zip(next.chunks_exact_mut(dim)) {
            apply(row, &z, dim, out);
        }
        std::mem::swap(&mut z, &mut next);
    }
    Ok((reach.ends(&z, dim).unwrap_or(Outcome::Timeout), last))
}
