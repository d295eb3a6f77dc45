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
//! Θ is non-convex. The answer is the global minimiser as far as [`looks`] can find it, and `certified` says when it is
//! proved to be. It is a function of the instant and the topology alone: never of the state, of a previous gain or of
//! the way the game got there, so that it can be tabulated and shared.
//!
//! Sizes N ≤ 8 are compiled with constant loop bounds (measured at n = 3: 2.6 times as fast as with bounds known at run
//! time); larger ones share one version whose factorisations go to faer.

mod dense;
mod descent;
mod doubled;
mod engine;
pub mod looks;
mod newton;
mod objective;
mod problem;
mod start;
mod tasks;

pub(crate) use engine::SIDE_BY_SIDE_UP_TO;
pub use looks::Look;
pub use problem::Problem;
pub use tasks::Status;

use crate::network::Topology;
use engine::Engine;
use looks::{Entry, Search};
use tasks::{Limits, Tasks};

/// How the gains are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// Exact-Hessian Newton with the further looks: the method the policy uses.
    #[default]
    Newton,
    /// The paper's gradient descent from the canonical start, without further looks.
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
    /// Θ, reduced.
    pub theta: f64,
    /// Norm of the gradient with respect to the variables, relative to the parts that cancel in it.
    pub gradient_norm: f64,
    /// Iterations of all descents together.
    pub iterations: usize,
    /// How the descent that won ended.
    pub status: Status,
    /// Whether the minimum is proved to be global.
    pub certified: bool,
    /// The look that won.
    pub look: Look,
}

impl Gains {
    /// The paper's K_i, reduced (m × N): entry j ≠ i on z_j − z_i, entry i on z_i; zero on players not seen.
    #[must_use]
    pub fn paper_gains(&self, topology: &Topology) -> Vec<f64> {
        let n = topology.size();
        let mut k = self.rows.clone();
        for i in 0..topology.rows() {
            let row = &self.rows[i * n..(i + 1) * n];
            k[i * n + i] = if topology.sees_attacker(i) { row.iter().sum() } else { 0.0 };
        }
        k
    }
}

/// A solver with its scratch memory; one per thread.
#[derive(Debug, Default)]
pub struct Synthesizer {
    engine: Engine,
    tasks: Tasks,
}

impl Synthesizer {
    /// A solver that has allocated nothing yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The gains for `topology` at the instant of `problem`.
    pub fn solve(&mut self, problem: &Problem, topology: &Topology, options: Options) -> Gains {
        let mut gains = None;
        self.solve_all(problem, std::slice::from_ref(topology), options, |_, found| gains = Some(found));
        gains.unwrap_or_else(|| unreachable!("one network, one answer"))
    }

    /// The gains for each of `topologies` at the instant of `problem`, handed to `each` with the topology's index. The
    /// descents of all go side by side, and none depends on another: the gains are those that [`Self::solve`] gives.
    pub fn solve_all(
        &mut self,
        problem: &Problem,
        topologies: &[Topology],
        options: Options,
        each: impl FnMut(usize, Gains),
    ) {
        match problem.size {
            2 => self.solve_sized::<2>(problem, topologies, options, each),
            3 => self.solve_sized::<3>(problem, topologies, options, each),
            4 => self.solve_sized::<4>(problem, topologies, options, each),
            5 => self.solve_sized::<5>(problem, topologies, options, each),
            6 => self.solve_sized::<6>(problem, topologies, options, each),
            7 => self.solve_sized::<7>(problem, topologies, options, each),
            8 => self.solve_sized::<8>(problem, topologies, options, each),
            _ => self.solve_sized::<0>(problem, topologies, options, each),
        }
    }

    fn solve_sized<const N: usize>(
        &mut self,
        problem: &Problem,
        topologies: &[Topology],
        options: Options,
        mut each: impl FnMut(usize, Gains),
    ) {
        let limits = Limits {
            iterations: options.max_iterations,
            tolerance: TOLERANCE.0,
            acceptable: TOLERANCE.1,
            longest: f64::INFINITY,
        };
        let mut entries: Vec<Entry> = topologies
            .iter()
            .map(|topology| {
                let mut start = vec![0.0; problem.rows * problem.size];
                start::canonical(problem, topology, &mut start);
                Entry::new(start::variables(topology), start)
            })
            .collect();
        let mut search = Search { problem, limits, engine: &mut self.engine, tasks: &mut self.tasks };
        match options.method {
            Method::Newton => search.run::<N>(&mut entries),
            Method::Descent => {
                for (entry, topology) in entries.iter_mut().zip(topologies) {
                    let variables = start::paper_variables(topology);
                    entry.reached = descent::descend(problem, &mut entry.g, &variables, limits);
                    entry.iterations = entry.reached.iterations;
                }
                let all: Vec<usize> = (0..entries.len()).collect();
                search.certify::<N>(&mut entries, &all);
            }
        }
        for (index, entry) in entries.into_iter().enumerate() {
            each(
                index,
                Gains {
                    rows: entry.g,
                    theta: entry.reached.value,
                    gradient_norm: entry.reached.gradient_norm,
                    iterations: entry.iterations,
                    status: entry.reached.status,
                    certified: entry.certified && entry.reached.status == Status::Converged,
                    look: entry.look,
                },
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::doubled::Doubled;
    use super::newton::Objective;
    use super::objective::RealGains;
    use super::*;
    use crate::game::Interaction;
    use crate::width::Width;

    fn check(objective: &mut impl Objective<f64>, g: &[f64]) {
        let width = objective.width();
        let h = 1e-5;
        let (mut gradient, mut hessian) = (vec![0.0; width], vec![0.0; width * width]);
        objective.value(g);
        objective.gradient(g, &mut gradient);
        objective.keep(true);
        objective.hessian(g, &mut hessian);
        for a in 0..width {
            let mut probe = |shift: f64| {
                let mut p = g.to_vec();
                p[a] += shift;
                let mut slope = vec![0.0; width];
                let value = objective.value(&p);
                objective.gradient(&p, &mut slope);
                (value, slope)
            };
            let ((above, up), (below, down)) = (probe(h), probe(-h));
            let slope = (above - below) / (2.0 * h);
            assert!((slope - gradient[a]).abs() < 1e-6 * (1.0 + slope.abs()), "gradient {a}");
            for b in 0..=a {
                let curve = (up[b] - down[b]) / (2.0 * h);
                assert!((curve - hessian[a * width + b]).abs() < 1e-5 * (1.0 + curve.abs()), "hessian {a} {b}");
            }
        }
    }

    fn sample(interaction: Interaction) -> (Problem, Vec<f64>, Vec<f64>) {
        let (size, groups) = if interaction == Interaction::I1 { (4, 3) } else { (3, 1) };
        let mut seed = 0.3f64;
        let mut next = || {
            seed = (seed * 37.77 + 0.123).fract();
            seed - 0.5
        };
        let mut p = vec![0.0; groups * size * size];
        for matrix in p.chunks_exact_mut(size * size) {
            for a in 0..size {
                for b in 0..=a {
                    matrix[a * size + b] = 2.0 * next();
                    matrix[b * size + a] = matrix[a * size + b];
                }
            }
        }
        let gamma = [0.4, 0.3, 0.2, 0.6][..interaction.terms()].to_vec();
        let problem = Problem::from_parts(interaction, vec![0.7, 1.3, 0.9], gamma, &p);
        let g = (0..2 * 3 * size).map(|_| next()).collect();
        (problem, p, g)
    }

    #[test]
    fn derivatives_match_differences() {
        for interaction in [Interaction::I1, Interaction::I2] {
            let (problem, _, g) = sample(interaction);
            check(&mut RealGains::<f64, 0>::new(&problem), &g[..g.len() / 2]);
            for complex in [true, false] {
                let mut doubled = Doubled::<f64, 0>::new(&problem);
                doubled.set_lane(0, complex, 1.0);
                check(&mut doubled, &g);
            }
        }
    }

    /// Every width, alone and with neighbours, on networks from empty to complete: the same bits.
    #[test]
    fn neighbours_and_width_change_nothing() {
        for interaction in [Interaction::I1, Interaction::I2] {
            let (problem, _, _) = sample(interaction);
            let (m, n) = (problem.rows(), problem.size());
            let topologies: Vec<Topology> = (0..1u64 << (m * n))
                .step_by(if m * n > 9 { 29 } else { 3 })
                .map(|bits| Topology::from_words(m, n, &[bits]))
                .collect();
            let solve = |width, topologies: &[Topology]| {
                let mut solver = Synthesizer { engine: Engine::of(width), tasks: Tasks::default() };
                let mut all = Vec::new();
                solver.solve_all(&problem, topologies, Options::default(), |_, gains| all.push(gains));
                all
            };
            let alone: Vec<Gains> =
                topologies.iter().flat_map(|topology| solve(Width::Baseline, std::slice::from_ref(topology))).collect();
            assert!(alone.iter().any(|gains| !gains.certified), "no network needs a further look");
            for width in Width::all() {
                assert_eq!(solve(width, &topologies), alone, "{width:?}");
                for (topology, gains) in topologies.iter().zip(&alone) {
                    assert_eq!(&solve(width, std::slice::from_ref(topology))[0], gains, "{width:?}");
                }
            }
        }
    }

    #[test]
    fn the_value_is_the_weighted_sum_of_the_terms() {
        for interaction in [Interaction::I1, Interaction::I2] {
            let (problem, p, g) = sample(interaction);
            let g = &g[..g.len() / 2];
            let value = RealGains::<f64, 0>::new(&problem).value(g);
            let sum = problem.weigh(&problem.terms(&p, g));
            assert!((sum - value).abs() < 1e-12 * value);
        }
    }

    #[test]
    fn who_sees_no_one_has_no_gain_and_who_sees_all_plays_the_equilibrium() {
        for interaction in [Interaction::I1, Interaction::I2] {
            let (problem, _, _) = sample(interaction);
            let (m, n) = (problem.rows(), problem.size());
            let mut solver = Synthesizer::new();
            let blind = solver.solve(&problem, &Topology::empty(m, n), Options::default());
            assert!(blind.rows.iter().all(|&g| g == 0.0) && blind.certified);
            let full = solver.solve(&problem, &Topology::complete(m, n), Options::default());
            assert!(full.theta < 1e-24 && full.certified);
            for (g, f) in full.rows.iter().zip(problem.fne()) {
                assert!((g - f).abs() < 1e-12);
            }
        }
    }
}
