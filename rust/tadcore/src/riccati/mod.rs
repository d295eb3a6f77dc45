//! The Riccati equations of the game, backward from the horizon: everything the feedback Nash equilibrium needs.
mod coupled;
mod dop853;
mod escape;
mod lanes;
mod tableau;

use crate::cancel::CancelToken;
use crate::error::EquilibriumError;
use crate::game::{Game, Interaction};

/// P on the grid.
#[derive(Debug, Clone, PartialEq)]
pub struct Equilibrium {
    interaction: Interaction,
    size: usize,
    steps: usize,
    groups: usize,
    integrator_steps: usize,
    nodes: Vec<f64>,
}

/// solve
pub fn solve(game: &Game, cancel: &CancelToken) -> Result<Equilibrium, EquilibriumError> {
    let (size, steps) = (game.size(), game.grid().steps());
    let groups = 3;
    let mut nodes = vec![0.0; (steps + 1) * groups * size * size];
    let integrator_steps = coupled::solve(game, cancel, &mut nodes)?;
    Ok(Equilibrium { interaction: game.interaction(), size, steps, groups, integrator_steps, nodes })
}

impl Equilibrium {
    /// whole
    #[must_use]
    pub fn as_slice(&self) -> &[f64] {
        &self.nodes
    }
    /// steps
    #[must_use]
    pub fn integrator_steps(&self) -> usize {
        self.integrator_steps
    }
}
