//! Synthesis: the gains of the constrained players at one instant, min Θ₁ (I1) or min Θ₂ (I2) over what each may use.
//!
//! $$\Theta_1 = \gamma_1\|\Delta Q_d\|^2 + \gamma_2\|\Delta Q_\tau\|^2 + \gamma_3\|\Delta Q_a\|^2 + \gamma_4\|S_1\|^2, \qquad
//! \Theta_2 = \gamma_1\|\Delta Q\|^2 + \gamma_2\|S_2\|^2 + \gamma_3\|S_3\|^2,$$
//!
//! where ΔQ and S say by how much the gains fail the equilibrium's Riccati equations and its feedback.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | G | [`Gains::rows`] | stacked rows g_i, u_i = g_i z: the reduced factors of K_i 𝓘_i |
//! | K_i | [`Gains::paper_gains`] | the paper's gain blocks, reduced: K_i 𝓘_i = g_i |
//! | Θ | [`Gains::theta`] | Θ₁ (eq:errfun1) or Θ₂ (eq:errfun2), in reduced norms: a block norm is `dim` times as large |
//! | γ | weights of Θ's terms | |
//!
//! Θ is non-convex. The answer is the global minimiser as far as [`search`] can find it, and `certified` says when it is
//! proved to be. It is a function of the instant and the topology alone: never of the state, of a previous gain or of
//! the way the game got there, so that it can be tabulated and shared.
//!
//! Three modules, each using only those above it (asserted by a test):
//!
//! | module | what it knows |
//! |---|---|
//! | `newton` | many small descents side by side; no game and no network |
//! | `theta` | Θ of one instant, its gradient and its Hessian; no network |
//! | [`search`] | which descents are made for a network, and when no more are needed |
//!
//! Sizes N ≤ 8 are compiled with constant loop bounds (measured at n = 3: 2.6 times as fast as with bounds known at run
//! time); larger ones share one version whose factorisations go to faer.

pub mod search;
mod theta;

pub use newton::Status;
pub(crate) use search::SIDE_BY_SIDE_UP_TO;
pub use search::Start;
pub(crate) use tadcore_kernels::synthesis::newton;
pub use theta::Problem;
pub(crate) use theta::TABULATED_UP_TO;

use crate::cancel::CancelToken;
use crate::error::Stopped;
use crate::memory::zeros;
use crate::network::Topology;
use newton::{Limits, Tasks, Workspace};
use search::{Candidate, Dispatcher, Search};

/// How the gains are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// Exact-Hessian Newton with restarts: the method the policy uses.
    #[default]
    Newton,
    /// The paper's gradient descent from the canonical start, without restarts.
    Descent,
}

/// How to solve, and when to stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// The method.
    pub method: Method,
    /// Iterations of one descent.
    pub max_iterations: usize,
}

impl Options {
    /// The options of a method: 2,000 iterations for Newton (a narrow valley just before an escape took 600), 100,000 for descent.
    #[must_use]
    pub fn new(method: Method) -> Self {
        let max_iterations = match method {
            Method::Newton => 2_000,
            Method::Descent => 100_000,
        };
        Self { method, max_iterations }
    }
}

impl Default for Options {
    fn default() -> Self {
        Self::new(Method::Newton)
    }
}

/// Relative gradient norm aimed at, and the one that counts as converged when rounding stops the progress.
const TOLERANCE: (f64, f64) = (1e-12, 1e-10);

/// The gains at one (instant, topology).
#[derive(Debug, Clone, PartialEq)]
pub struct Gains {
    /// g_i, m × N; zero on players that i does not see.
    pub rows: Vec<f64>,
    /// The imaginary parts of gains that turn, m × N: u_i = g_i z + h_i Jz with these rows h_i and J a quarter turn of the
    /// plane. Empty for scalar gains.
    pub turn: Vec<f64>,
    /// Θ, reduced.
    pub theta: f64,
    /// Norm of the gradient with respect to the variables, relative to the parts that cancel in it. Where these parts
    /// differ more than a hundredfold from player to player, or S has next to no weight, the largest of a player,
    /// relative to that player's parts.
    pub gradient_norm: f64,
    /// Iterations of all descents together.
    pub iterations: usize,
    /// How the descent that won ended.
    pub status: Status,
    /// Whether the minimum is proved to be global among scalar gains.
    pub certified: bool,
    /// The start whose descent won.
    pub start: Start,
    /// Restarts that promised to lead lower, beyond those made: in large games their number is limited.
    pub left_out: usize,
    /// Whether a descent met a narrow valley, whose floor was followed to its end.
    pub narrow: bool,
}

impl Gains {
    /// The paper's K_i, reduced (m × N): entry j ≠ i on z_j − z_i, entry i on z_i; zero on players not seen.
    #[must_use]
    pub fn paper_gains(&self, topology: &Topology) -> Vec<f64> {
        blocks_of(&self.rows, topology)
    }

    /// The imaginary parts of these, where gains turn.
    #[must_use]
    pub fn paper_turn(&self, topology: &Topology) -> Vec<f64> {
        if self.turn.is_empty() { Vec::new() } else { blocks_of(&self.turn, topology) }
    }

    /// Whether the minimum is proved to be global among the paper's gains, blocks of dim × dim, those that turn included.
    ///
    /// # Errors
    /// [`Stopped`] when there is no memory for so many unknowns, or `cancel` was raised.
    pub fn certified_blocks(
        &self,
        problem: &Problem,
        topology: &Topology,
        cancel: &CancelToken,
    ) -> Result<bool, Stopped> {
        if !self.certified || topology.is_complete() {
            // Where everyone sees everyone, the equilibrium's own gains are a zero of Θ.
            return Ok(self.certified);
        }
        let variables = search::variables(topology, problem.criterion)?;
        search::covers_blocks(problem, &self.rows, &variables, cancel)
    }
}

/// A solver with its scratch memory; one per thread.
#[derive(Debug, Default)]
pub struct Synthesizer {
    dispatcher: Dispatcher,
    tasks: Tasks,
    doubled: Tasks,
    workspace: Workspace<f64>,
}

impl Synthesizer {
    /// A solver that has allocated nothing yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Lets `cancel` stop what it solves from now on.
    pub fn watch(&mut self, cancel: &CancelToken) {
        self.dispatcher.watch(cancel);
    }

    /// The gains for `topology` at the instant of `problem`.
    ///
    /// # Errors
    /// [`Stopped`] when there is no memory for so many unknowns, or the token that it watches was raised.
    pub fn solve(&mut self, problem: &Problem, topology: &Topology, options: Options) -> Result<Gains, Stopped> {
        let mut gains = None;
        self.solve_all(problem, std::slice::from_ref(topology), options, |_, found| {
            gains = Some(found);
            Ok(())
        })?;
        Ok(gains.unwrap_or_else(|| unreachable!("one network, one answer")))
    }

    /// The gains for each of `topologies` at the instant of `problem`, handed to `each` with the topology's index. The
    /// descents of all go side by side, and none depends on another: the gains are those that [`Self::solve`] gives.
    ///
    /// # Errors
    /// As for [`Self::solve`], and what `each` says.
    pub fn solve_all(
        &mut self,
        problem: &Problem,
        topologies: &[Topology],
        options: Options,
        mut each: impl FnMut(usize, Gains) -> Result<(), Stopped>,
    ) -> Result<(), Stopped> {
        let limits = limits(options);
        let mut candidates = candidates(problem, topologies)?;
        let Self { dispatcher, tasks, doubled, workspace } = self;
        let mut search = Search { problem, limits, dispatcher, tasks, doubled, workspace };
        match options.method {
            Method::Newton => search.run(&mut candidates)?,
            Method::Descent => {
                for (candidate, topology) in candidates.iter_mut().zip(topologies) {
                    let variables = search::paper_variables(topology, problem.criterion);
                    let cancel = search.dispatcher.cancel();
                    candidate.reached = search::descend(problem, &mut candidate.g, &variables, limits, cancel)?;
                    candidate.iterations = candidate.reached.iterations;
                }
                candidates.iter_mut().for_each(|candidate| candidate.certified = candidate.complete);
                let open: Vec<usize> = (0..candidates.len()).filter(|&e| !candidates[e].complete).collect();
                search.certify(&mut candidates, &open)?;
            }
        }
        for (index, candidate) in candidates.into_iter().enumerate() {
            each(index, gains(problem, candidate))?;
        }
        Ok(())
    }

    /// The gains of lowest Θ among those that turn, from the lowest among scalar ones: these themselves where it is proved
    /// that no blocks are lower, or none are found.
    ///
    /// # Errors
    /// As for [`Self::solve`].
    pub fn turn(&mut self, problem: &Problem, topology: &Topology, scalars: &Gains) -> Result<Gains, Stopped> {
        if scalars.certified_blocks(problem, topology, self.dispatcher.cancel())? {
            return Ok(scalars.clone());
        }
        let mut candidates = candidates(problem, std::slice::from_ref(topology))?;
        let candidate = &mut candidates[0];
        if candidate.variables.is_empty() {
            return Ok(scalars.clone());
        }
        candidate.g.copy_from_slice(&scalars.rows);
        let Self { dispatcher, tasks, doubled, workspace } = self;
        let limits = limits(Options::default());
        let mut search = Search { problem, limits, dispatcher, tasks, doubled, workspace };
        let found = search.turn(candidate)?;
        let iterations = scalars.iterations + candidate.iterations;
        let Some((point, reached)) = found else {
            return Ok(Gains { iterations, ..scalars.clone() });
        };
        let (rows, turn) = point.split_at(problem.rows * problem.size);
        Ok(Gains {
            rows: rows.to_vec(),
            turn: turn.to_vec(),
            theta: problem.in_scale_of_gamma(reached.value),
            gradient_norm: reached.gradient_norm,
            iterations,
            status: reached.status,
            certified: false,
            start: Start::Complex,
            left_out: scalars.left_out,
            narrow: scalars.narrow,
        })
    }

    /// The gains for each of `topologies` that Newton's method reaches from `starts`, handed to `each` with the
    /// topology's index; none where it does not soon reach a minimum near there, which then has to be searched for.
    ///
    /// # Errors
    /// As for [`Self::solve`], and what `each` says.
    pub(crate) fn follow_all(
        &mut self,
        problem: &Problem,
        topologies: &[Topology],
        starts: &[Vec<f64>],
        mut each: impl FnMut(usize, Option<Gains>) -> Result<(), Stopped>,
    ) -> Result<(), Stopped> {
        let limits = limits(Options::default());
        let mut candidates = candidates(problem, topologies)?;
        let Self { dispatcher, tasks, doubled, workspace } = self;
        let mut search = Search { problem, limits, dispatcher, tasks, doubled, workspace };
        let reached = search.continue_from(&mut candidates, starts)?;
        for (index, (candidate, reached)) in candidates.into_iter().zip(reached).enumerate() {
            each(index, reached.then(|| gains(problem, candidate)))?;
        }
        Ok(())
    }
}

/// K_i of gain rows.
fn blocks_of(rows: &[f64], topology: &Topology) -> Vec<f64> {
    let n = topology.size();
    let mut k = rows.to_vec();
    for i in 0..topology.rows() {
        let row = &rows[i * n..(i + 1) * n];
        k[i * n + i] = if topology.sees_attacker(i) { row.iter().sum() } else { 0.0 };
    }
    k
}

fn limits(options: Options) -> Limits {
    Limits {
        iterations: options.max_iterations,
        tolerance: TOLERANCE.0,
        acceptable: TOLERANCE.1,
        longest: f64::INFINITY,
    }
}

/// The networks of one instant, each at its canonical start.
fn candidates(problem: &Problem, topologies: &[Topology]) -> Result<Vec<Candidate>, Stopped> {
    let mut candidates = Vec::with_capacity(topologies.len());
    for topology in topologies {
        let mut start = zeros("the gains of one network", problem.rows * problem.size)?;
        search::canonical(problem, topology, &mut start);
        let variables = search::variables(topology, problem.criterion)?;
        let candidate = Candidate::new(variables, start, problem.size, topology.is_complete())?;
        search::admit(&candidate)?;
        candidates.push(candidate);
    }
    Ok(candidates)
}

/// What was found for a network.
fn gains(problem: &Problem, candidate: Candidate) -> Gains {
    Gains {
        theta: problem.in_scale_of_gamma(candidate.reached.value),
        gradient_norm: candidate.reached.gradient_norm,
        iterations: candidate.iterations,
        status: candidate.reached.status,
        certified: candidate.certified && candidate.reached.status == Status::Converged,
        start: candidate.start,
        left_out: candidate.left_out,
        narrow: !candidate.quick && !candidate.complete,
        rows: candidate.g,
        turn: Vec::new(),
    }
}

#[cfg(test)]
mod tests;
