//! The Riccati equations of the game, solved backward from the horizon: P on the grid, and with it the feedback Nash
//! equilibrium.
//!
//! In interaction I1 three coupled equations (eq:Riccati), with $A = S_d P_d + S_\tau P_\tau + S_a P_a$:
//!
//! $$\dot P_p = P_p A + A^\top P_p - P_p S_p P_p - Q_p, \quad P_p(T) = F_p, \quad p = d, \tau, a;$$
//!
//! in I2 one symmetric equation (eq:RDE), with $S = S_a - S_d - S_\tau$:
//!
//! $$\dot P = P S P - Q, \quad P(T) = F.$$
//!
//! All matrices are reduced Kronecker factors of size N × N. A solution may escape to infinity inside the horizon:
//! that is a property of the game, reported as [`EquilibriumError::FiniteEscape`] with the escape time, and no numbers
//! are returned for such a game.
//!
//! | symbol | name here | meaning |
//! |---|---|---|
//! | P_p(t_k) | [`Equilibrium::p`] | group 0, 1, 2 = d, τ, a in I1; the single group 0 in I2 |
//! | N, K | [`Equilibrium::size`], [`Equilibrium::steps`] | players relative to the attacker; steps of the grid |
//! | γ*(t_k, z) | [`Equilibrium::feedback`] | the equilibrium controls, one row of gains per player |
//!
//! | module | what it knows |
//! |---|---|
//! | `classes` | large teams with equal defenders, as smaller games |
//! | `coupled`, `large` | I1: the right-hand side for N known to the compiler, and for any N |
//! | `triangle` | how the matrices of a large game are stored |
//! | `dop853`, `stages`, `tableau` | the adaptive integrator of order 8, its loops, its coefficients |
//! | `weight` | the norm of its error |
//! | `hamiltonian`, `increment` | I2: exact steps that cannot jump over a pole, and one of them |
//! | `escape` | what counts as an escape, and when it happens |
//! | `condition` | I1: whether weights that lie far apart determine P |
//! | `residual`, `printed` | how well a stored solution satisfies the equations as printed; these equations |
//!
//! Accuracy: every P_p(t_k) to 1e-10 relative to its own norm, in both interactions, at every node; where weights lie
//! more than three decades apart, what a change of the weights by a 10⁻¹²th leaves certain, and an error below five digits.

mod classes;
mod condition;
mod coupled;
mod dop853;
mod escape;
mod hamiltonian;
mod increment;
mod large;
mod printed;
mod residual;
mod stages;
mod tableau;
mod triangle;
mod weight;

use classes::Classes;

use crate::cancel::CancelToken;
use crate::error::{EquilibriumError, Stopped};
use crate::game::{Game, Interaction};
use crate::memory::{spare, zeros};

/// The solution of a game's Riccati equations on its grid.
///
/// Every matrix is bitwise symmetric. Storage is (k, group, i, j): node after node, the groups of one node together.
#[derive(Debug, Clone, PartialEq)]
pub struct Equilibrium {
    interaction: Interaction,
    size: usize,
    steps: usize,
    integrator_steps: usize,
    /// One node, where the horizon recedes: P is the same at every instant.
    nodes: Vec<f64>,
}

/// Solves the Riccati equations of `game` backward from T to 0.
///
/// # Errors
/// [`EquilibriumError::FiniteEscape`] when the solution escapes at or before the horizon,
/// [`EquilibriumError::StepBudget`] when a game is too stiff, [`EquilibriumError::Undetermined`] when its weights lie too
/// far apart for double precision, [`EquilibriumError::Range`] and [`EquilibriumError::Memory`]
/// when its numbers or its grid are too large, [`EquilibriumError::Cancelled`] when `cancel` was raised.
pub fn solve(game: &Game, cancel: &CancelToken) -> Result<Equilibrium, EquilibriumError> {
    if let Some(predicted) = game.predicted() {
        let mut solution = solve(&predicted, cancel)?;
        solution.nodes.truncate(solution.node_len());
        return Ok(Equilibrium { steps: game.grid().steps(), ..solution });
    }
    let (interaction, size, steps) = (game.interaction(), game.size(), game.grid().steps());
    let mut nodes = zeros("P on the grid", (steps + 1) * groups(interaction) * size * size)?;
    spare("the solution of the Riccati equations")?;
    let integrator_steps = match Classes::of(game).and_then(|classes| Some((classes.game(game)?, classes))) {
        None => fill(game, &mut nodes, cancel)?,
        Some((small, classes)) => {
            let mut reduced = classes.room(&nodes, size)?;
            let integrator_steps = fill(&small, &mut reduced, cancel)?;
            classes.expand(&reduced, &mut nodes, cancel)?;
            integrator_steps
        }
    };
    Ok(Equilibrium { interaction, size, steps, integrator_steps, nodes })
}

/// Solves the equations of `game` itself; the steps that it took.
fn fill(game: &Game, nodes: &mut [f64], cancel: &CancelToken) -> Result<usize, EquilibriumError> {
    if game.interaction() == Interaction::I1 {
        return condition::determined(game, nodes, |game, nodes| coupled::solve(game, cancel, nodes));
    }
    let steps = hamiltonian::solve(game, cancel, nodes)?;
    if finite(nodes) { Ok(steps) } else { Err(EquilibriumError::Range) }
}

/// Whether all numbers are.
fn finite(numbers: &[f64]) -> bool {
    // In chunks that are looked at whole, so that the loop over one needs no branch.
    numbers.chunks(256).all(|chunk| chunk.iter().fold(true, |fine, x| fine & x.is_finite()))
}

fn groups(interaction: Interaction) -> usize {
    match interaction {
        Interaction::I1 => 3,
        Interaction::I2 => 1,
    }
}

impl Equilibrium {
    /// Matrices per node: 3 in I1 (P_d, P_τ, P_a), 1 in I2.
    #[must_use]
    pub fn groups(&self) -> usize {
        groups(self.interaction)
    }

    /// N.
    #[must_use]
    pub fn size(&self) -> usize {
        self.size
    }

    /// K; there are K + 1 nodes.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// Steps that the solver took.
    #[must_use]
    pub fn integrator_steps(&self) -> usize {
        self.integrator_steps
    }

    /// Numbers of one node.
    fn node_len(&self) -> usize {
        self.groups() * self.size * self.size
    }

    /// Whether P is the same at every instant, as under a receding horizon.
    #[must_use]
    pub fn is_constant(&self) -> bool {
        self.nodes.len() == self.node_len()
    }

    /// All groups at t_k, (group, i, j).
    ///
    /// # Panics
    /// If `k` > K.
    #[must_use]
    pub fn node(&self, k: usize) -> &[f64] {
        assert!(k <= self.steps, "no instant {k} among {}", self.steps + 1);
        let (len, at) = (self.node_len(), if self.is_constant() { 0 } else { k });
        &self.nodes[at * len..(at + 1) * len]
    }

    /// P of one group at t_k, N × N.
    ///
    /// # Panics
    /// If there is no such group, or `k` > K.
    #[must_use]
    pub fn p(&self, group: usize, k: usize) -> &[f64] {
        let len = self.size * self.size;
        &self.node(k)[group * len..(group + 1) * len]
    }

    /// The whole storage, (k, group, i, j); one k where P [is constant](Self::is_constant).
    #[must_use]
    pub fn as_slice(&self) -> &[f64] {
        &self.nodes
    }

    /// Writes the rows g of the equilibrium controls u = g z at t_k into `out`, (N + 1) × N: d₁…d_n, target, attacker.
    ///
    /// I1 (eq:1d): −P_d[i, :]/r_{d_i}, −P_τ[N, :]/r_τ and 1ᵀP_a/r_a. I2 (eq:zero_sum_control2, eq:zero_sum_control1):
    /// P[i, :]/r_i for the defenders and the target, 1ᵀP/r_a for the attacker.
    ///
    /// # Panics
    /// If `k` > K, `out` is not (N + 1) · N long, or `game` is not the game that was solved.
    pub fn feedback(&self, game: &Game, k: usize, out: &mut [f64]) {
        let (n, w) = (self.size, game.weights());
        assert_eq!(out.len(), (n + 1) * n, "out must hold (N + 1) x N gains");
        let (sign, target, attacker) = match self.interaction {
            Interaction::I1 => (-1.0, 1, 2),
            Interaction::I2 => (1.0, 0, 0),
        };
        let (p_d, p_tau, p_a) = (self.p(0, k), self.p(target, k), self.p(attacker, k));
        let (rows, last) = out.split_at_mut(n * n);
        for (i, row) in rows.chunks_exact_mut(n).enumerate() {
            let (p, r) = if i + 1 < n { (p_d, w.r_d[i]) } else { (p_tau, w.r_tau) };
            for (g, p) in row.iter_mut().zip(&p[i * n..]) {
                *g = sign * p / r;
            }
        }
        for (j, g) in last.iter_mut().enumerate() {
            *g = p_a.chunks_exact(n).map(|row| row[j]).sum::<f64>() / w.r_a;
        }
    }

    /// The relative residual of the Riccati equations at every node, (group, k).
    ///
    /// Where the grid resolves the solution, the derivative is a difference of order 8 of the stored nodes, compared
    /// with the right-hand side of eq:Riccati or eq:RDE evaluated as printed, relative to the norms of its terms. Where
    /// it does not, the node is compared with a fresh integration of the printed equation over one step. At t_K the
    /// terminal condition is compared as well. About 1e-12 to 1e-9 for a good solution. Under a receding horizon P is
    /// compared with a fresh integration over that horizon, the same at every node.
    ///
    /// # Errors
    /// [`Stopped`] when there is no memory, or `cancel` was raised.
    pub fn residual(&self, game: &Game, cancel: &CancelToken) -> Result<Vec<f64>, Stopped> {
        residual::residual(self, game, cancel)
    }
}
