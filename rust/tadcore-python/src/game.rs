//! `Game`: weights and grid, and with them the equilibrium and the table that all its runs share.

use std::sync::Arc;

use numpy::ndarray::Axis;
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use tadcore::ensemble::{self, Between, End, Lineages};
use tadcore::game::{Game as CoreGame, Grid, Weights};
use tadcore::network::{EdgeRule, Topology};
use tadcore::policy::{DEFAULT_TABLE_BYTES, GainKind, Policy};
use tadcore::simulation::{self, Chances, Rules};
use tadcore::synthesis::Synthesizer;

use super::arrays::{entries, shaped};
use super::equilibrium::Equilibrium;
use super::gains::Gains;
use super::generation::Generation;
use super::guard::guarded;
use super::inputs::{Starts, numbers};
use super::outside::Outside;
use super::record::Record;
use super::stop::Stop;
use super::world::World;
use super::{detach, errors, inputs};

/// Weights, horizon and grid; owns the equilibrium and the (step, topology) table.
#[pyclass(frozen, module = "tadcore._core")]
pub(crate) struct Game {
    game: CoreGame,
    table_bytes: usize,
    generation: Generation,
}

type Ends<'py> =
    (Bound<'py, PyArray1<i8>>, Bound<'py, PyArray1<i32>>, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<bool>>);

impl Game {
    /// The policy, solving the equilibrium on first use. An error is found again, not kept: it is cheap to find.
    pub(crate) fn policy(&self, py: Python<'_>) -> PyResult<Arc<Policy>> {
        if let Some(policy) = self.generation.solved() {
            return Ok(policy);
        }
        detach::interruptible(py, |cancel| self.generation.solve(&self.game, self.table_bytes, cancel))?
            .map_err(|error| errors::equilibrium(py, &self.game, &error))
    }

    /// How runs ended, as columns: kind, defender, time, whether the game diverged.
    fn ends<'py>(&self, py: Python<'py>, ends: &[End]) -> PyResult<Ends<'py>> {
        let grid = self.game.grid();
        Ok((
            entries(py, ends.len(), |i| ends[i].outcome.code())?,
            entries(py, ends.len(), |i| ends[i].outcome.defender())?,
            entries(py, ends.len(), |i| grid.time_after(ends[i].step, ends[i].after))?,
            entries(py, ends.len(), |i| ends[i].diverged)?,
        ))
    }
}

#[pymethods]
impl Game {
    #[new]
    #[pyo3(signature = (*, interaction, horizon, step, defender_control_weight, target_control_weight,
        attacker_control_weight, defender_running_weight=None, defender_terminal_weight=None,
        target_running_weight=1.0, target_terminal_weight=1.0, attacker_target_running_weight=1.0,
        attacker_target_terminal_weight=1.0, evasion_running_weight, evasion_terminal_weight, evasion=1.0,
        synthesis_weights, prediction_horizon=None, criterion="paper", table_bytes=None))]
    // A keyword for each weight, as the scenario names them.
    #[allow(clippy::too_many_arguments)]
    fn new(
        py: Python<'_>,
        interaction: &str,
        horizon: f64,
        step: f64,
        defender_control_weight: PyReadonlyArray1<'_, f64>,
        target_control_weight: f64,
        attacker_control_weight: f64,
        defender_running_weight: Option<PyReadonlyArray1<'_, f64>>,
        defender_terminal_weight: Option<PyReadonlyArray1<'_, f64>>,
        target_running_weight: f64,
        target_terminal_weight: f64,
        attacker_target_running_weight: f64,
        attacker_target_terminal_weight: f64,
        evasion_running_weight: PyReadonlyArray1<'_, f64>,
        evasion_terminal_weight: PyReadonlyArray1<'_, f64>,
        evasion: f64,
        synthesis_weights: PyReadonlyArray1<'_, f64>,
        prediction_horizon: Option<f64>,
        criterion: &str,
        table_bytes: Option<usize>,
    ) -> PyResult<Self> {
        guarded(|| {
            let (interaction, criterion) = (inputs::interaction(interaction)?, inputs::criterion(criterion)?);
            let optional = |array: Option<PyReadonlyArray1<'_, f64>>| array.as_ref().map(numbers).unwrap_or_default();
            let weights = Weights {
                r_d: numbers(&defender_control_weight),
                r_tau: target_control_weight,
                r_a: attacker_control_weight,
                q_da: optional(defender_running_weight),
                f_da: optional(defender_terminal_weight),
                q_ad: numbers(&evasion_running_weight),
                f_ad: numbers(&evasion_terminal_weight),
                q_atau: attacker_target_running_weight,
                f_atau: attacker_target_terminal_weight,
                q_taua: target_running_weight,
                f_taua: target_terminal_weight,
                lambda: evasion,
                gamma: numbers(&synthesis_weights),
            };
            let game = Grid::new(horizon, step)
                .and_then(|grid| CoreGame::new(interaction, weights, grid))
                .and_then(|game| match prediction_horizon {
                    Some(ahead) => game.receding(ahead),
                    None => Ok(game),
                })
                .map_err(|error| errors::game(py, error))?
                .with_criterion(criterion);
            Ok(Self { game, table_bytes: table_bytes.unwrap_or(DEFAULT_TABLE_BYTES), generation: Generation::new() })
        })
    }

    /// Number of defenders.
    #[getter]
    fn defenders(&self) -> usize {
        self.game.n()
    }

    /// K, the number of steps of the grid.
    #[getter]
    fn steps(&self) -> usize {
        self.game.grid().steps()
    }

    /// t_0 … t_K.
    #[getter]
    fn times<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let grid = self.game.grid();
        guarded(|| entries(py, grid.steps() + 1, |k| grid.time(k)))
    }

    /// The equilibrium, solved on first use.
    fn equilibrium(&self, py: Python<'_>) -> PyResult<Equilibrium> {
        guarded(|| Ok(Equilibrium::new(self.policy(py)?)))
    }

    /// The gains at t_step under an adjacency of shape (m, N); those of `gains` turning or mirror by Newton's method alone.
    #[pyo3(signature = (step, adjacency, *, method="newton", max_iterations=None, gains="scalar"))]
    fn synthesize(
        &self,
        py: Python<'_>,
        step: usize,
        adjacency: PyReadonlyArray2<'_, bool>,
        method: &str,
        max_iterations: Option<usize>,
        gains: &str,
    ) -> PyResult<Gains> {
        guarded(|| {
            let seen = adjacency.as_array();
            let (m, n) = (self.game.constrained(), self.game.size());
            if seen.dim() != (m, n) || step > self.game.grid().steps() {
                return Err(PyValueError::new_err(format!(
                    "step must be at most {} and adjacency of shape ({m}, {n})",
                    self.game.grid().steps()
                )));
            }
            let options = inputs::options(method, max_iterations)?;
            let topology = inputs::topology(seen);
            let (kind, policy) = (inputs::gain_kind(gains)?, self.policy(py)?);
            if kind != GainKind::Scalar && options.is_some() {
                return Err(PyValueError::new_err(format!(
                    "gains is {gains:?}; method must be newton, without a limit"
                )));
            }
            let (gains, terms, blocks) = detach::interruptible(py, |cancel| {
                let (mut solver, problem) = (Synthesizer::new(), policy.problem(step, cancel)?);
                let gains = match kind {
                    GainKind::Scalar => policy.gains(step, &topology, options, &mut solver, cancel)?,
                    _ => policy.turning_gains(step, &topology, &mut solver, cancel)?.of(kind),
                };
                let p = policy.equilibrium().node(step);
                let terms = problem.turning_terms(p, &gains.rows, &gains.turn, cancel)?;
                let blocks = gains.certified_blocks(&problem, &topology, cancel)?;
                Ok((gains, terms, blocks))
            })?
            .map_err(|stopped| errors::stopped(py, stopped))?;
            Ok(Gains::new(gains, terms, blocks, topology))
        })
    }

    /// Θ under the criterion "component" less Θ under "paper" at t_step for each (step, adjacency): steps (L,),
    /// adjacency (L, m, N).
    fn theta_price<'py>(
        &self,
        py: Python<'py>,
        steps: PyReadonlyArray1<'py, i64>,
        adjacency: PyReadonlyArray3<'py, bool>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        guarded(|| {
            let (steps, seen) = (steps.as_array(), adjacency.as_array());
            let (m, n, last) = (self.game.constrained(), self.game.size(), self.game.grid().steps());
            let instants: Vec<usize> = steps.iter().filter_map(|&k| usize::try_from(k).ok()).collect();
            if seen.dim() != (steps.len(), m, n) || instants.len() < steps.len() || instants.iter().any(|&k| k > last) {
                return Err(PyValueError::new_err(format!(
                    "steps must be from 0 to {last} and adjacency of shape ({}, {m}, {n})",
                    steps.len()
                )));
            }
            let networks: Vec<Topology> = seen.axis_iter(Axis(0)).map(inputs::topology).collect();
            let policy = self.policy(py)?;
            let prices = detach::interruptible(py, |cancel| {
                let mut solver = Synthesizer::new();
                let of = instants.iter().zip(&networks);
                of.map(|(&k, network)| policy.price(k, network, &mut solver, cancel)).collect::<Result<Vec<f64>, _>>()
            })?
            .map_err(|stopped| errors::stopped(py, stopped))?;
            entries(py, prices.len(), |i| prices[i])
        })
    }

    /// One recorded run; with a hysteresis, a dwell time, a world or a network from outside another game than the paper's.
    #[pyo3(signature = (positions, visibility_radii, capture_radii, *, hysteresis=0.0, dwell=0.0, continuous=false,
        world=None, seed=0, trial=0, network=None, gains="scalar"))]
    // A keyword for each rule.
    #[allow(clippy::too_many_arguments)]
    fn simulate(
        &self,
        py: Python<'_>,
        positions: PyReadonlyArray2<'_, f64>,
        visibility_radii: PyReadonlyArray1<'_, f64>,
        capture_radii: PyReadonlyArray1<'_, f64>,
        hysteresis: f64,
        dwell: f64,
        continuous: bool,
        world: Option<&Bound<'_, World>>,
        seed: u64,
        trial: u64,
        network: Option<Py<PyAny>>,
        gains: &str,
    ) -> PyResult<Record> {
        guarded(|| {
            let starts = Starts::copied(py, &positions, &visibility_radii, &capture_radii)?;
            let (kind, policy) = (inputs::gain_kind(gains)?, self.policy(py)?);
            let world = world.map(|world| world.get().core());
            let outside = network.map(|function| Outside::new(function, &self.game, starts.setup().dim));
            let record = detach::interruptible(py, |cancel| {
                let rules = Rules {
                    edges: EdgeRule { hysteresis, dwell },
                    termination: inputs::termination(continuous),
                    gains: kind,
                    chances: world.map(|world| Chances { world, seed, trial }),
                    outside: outside.as_ref().map(Outside::network),
                };
                simulation::simulate_with(&policy, &starts.setup(), rules, cancel)
            })?;
            let failed = outside.and_then(Outside::error);
            let record = record.map_err(|error| failed.unwrap_or_else(|| errors::run(py, &self.game, error)))?;
            Ok(Record::new(policy, record))
        })
    }

    /// Outcomes of many runs: kind, defender, time, whether the game diverged, and whether it passed within a radius.
    #[pyo3(signature = (positions, visibility_radii, capture_radii, *, continuous=false, passes=false, threads=None,
        stop=None, world=None, seed=0, first_trial=0))]
    // A keyword for each rule.
    #[allow(clippy::type_complexity, clippy::too_many_arguments)]
    fn simulate_batch<'py>(
        &self,
        py: Python<'py>,
        positions: PyReadonlyArray3<'py, f64>,
        visibility_radii: PyReadonlyArray2<'py, f64>,
        capture_radii: PyReadonlyArray2<'py, f64>,
        continuous: bool,
        passes: bool,
        threads: Option<usize>,
        stop: Option<&Stop>,
        world: Option<&Bound<'py, World>>,
        seed: u64,
        first_trial: u64,
    ) -> PyResult<(
        Bound<'py, PyArray1<i8>>,
        Bound<'py, PyArray1<i32>>,
        Bound<'py, PyArray1<f64>>,
        Bound<'py, PyArray1<bool>>,
        Bound<'py, PyArray1<bool>>,
    )> {
        guarded(|| {
            let starts = Starts::copied(py, &positions, &visibility_radii, &capture_radii)?;
            let policy = self.policy(py)?;
            let world = world.map(|world| world.get().core());
            let token = stop.map(|stop| stop.token.clone()).unwrap_or_default();
            let ends = detach::stoppable(py, token, |cancel| {
                let between = Between { termination: inputs::termination(continuous), passes };
                let chances = world.map(|world| Chances { world, seed, trial: first_trial });
                ensemble::run_with(&policy, &starts.batch(), between, chances, threads, cancel)
            })?
            .map_err(|error| errors::run(py, &self.game, error))?;
            let (kind, defender, time, diverged) = self.ends(py, &ends)?;
            Ok((kind, defender, time, diverged, entries(py, ends.len(), |i| ends[i].passed)?))
        })
    }

    /// Outcomes of many runs, each played to T, and how far each was from every outcome: kind, defender, time, whether
    /// the game diverged, and a row of scores (timeout, captured, intercepted, d1 … dn).
    #[pyo3(signature = (positions, visibility_radii, capture_radii, *, threads=None, stop=None, world=None, seed=0,
        first_trial=0))]
    // A keyword for each rule.
    #[allow(clippy::type_complexity, clippy::too_many_arguments)]
    fn score_batch<'py>(
        &self,
        py: Python<'py>,
        positions: PyReadonlyArray3<'py, f64>,
        visibility_radii: PyReadonlyArray2<'py, f64>,
        capture_radii: PyReadonlyArray2<'py, f64>,
        threads: Option<usize>,
        stop: Option<&Stop>,
        world: Option<&Bound<'py, World>>,
        seed: u64,
        first_trial: u64,
    ) -> PyResult<(
        Bound<'py, PyArray1<i8>>,
        Bound<'py, PyArray1<i32>>,
        Bound<'py, PyArray1<f64>>,
        Bound<'py, PyArray1<bool>>,
        Bound<'py, PyArray2<f64>>,
    )> {
        guarded(|| {
            let starts = Starts::copied(py, &positions, &visibility_radii, &capture_radii)?;
            let policy = self.policy(py)?;
            let world = world.map(|world| world.get().core());
            let token = stop.map(|stop| stop.token.clone()).unwrap_or_default();
            let (ends, scores) = detach::stoppable(py, token, |cancel| {
                let chances = world.map(|world| Chances { world, seed, trial: first_trial });
                ensemble::run_scored(&policy, &starts.batch(), chances, threads, cancel)
            })?
            .map_err(|error| errors::run(py, &self.game, error))?;
            let (kind, defender, time, diverged) = self.ends(py, &ends)?;
            let scores = shaped(py, &scores, [ends.len(), ensemble::columns(self.game.n())])?;
            Ok((kind, defender, time, diverged, scores))
        })
    }

    /// Runs that share a past and part: row r has the draws of the trials `trials[offsets[r]:offsets[r + 1]]`, of each
    /// from the step of the same place in `steps` on. The defender that intercepted, −1 where none did, and the course
    /// of one score over all instants.
    #[pyo3(signature = (positions, visibility_radii, capture_radii, *, world, seed, offsets, steps, trials, column,
        threads=None))]
    // A keyword for each rule.
    #[allow(clippy::type_complexity, clippy::too_many_arguments)]
    fn score_courses<'py>(
        &self,
        py: Python<'py>,
        positions: PyReadonlyArray3<'py, f64>,
        visibility_radii: PyReadonlyArray2<'py, f64>,
        capture_radii: PyReadonlyArray2<'py, f64>,
        world: &Bound<'py, World>,
        seed: u64,
        offsets: PyReadonlyArray1<'py, u64>,
        steps: PyReadonlyArray1<'py, u64>,
        trials: PyReadonlyArray1<'py, u64>,
        column: usize,
        threads: Option<usize>,
    ) -> PyResult<(Bound<'py, PyArray1<i32>>, Bound<'py, PyArray2<f64>>)> {
        guarded(|| {
            let starts = Starts::copied(py, &positions, &visibility_radii, &capture_radii)?;
            let whole = |array: &PyReadonlyArray1<'py, u64>| -> Vec<usize> {
                array.as_array().iter().map(|&x| usize::try_from(x).unwrap_or(usize::MAX)).collect()
            };
            let (offsets, steps) = (whole(&offsets), whole(&steps));
            let trials: Vec<u64> = trials.as_array().iter().copied().collect();
            let policy = self.policy(py)?;
            let world = world.get().core();
            let (ends, courses) = detach::interruptible(py, |cancel| {
                let lineages = Lineages { offsets: &offsets, steps: &steps, trials: &trials };
                let chances = Chances { world, seed, trial: 0 };
                ensemble::run_courses(&policy, &starts.batch(), chances, lineages, column, threads, cancel)
            })?
            .map_err(|error| errors::run(py, &self.game, error))?;
            let instants = self.game.grid().steps() + 1;
            Ok((
                entries(py, ends.len(), |i| ends[i].outcome.defender())?,
                shaped(py, &courses, [ends.len(), instants])?,
            ))
        })
    }

    /// The table of transitions as bytes.
    fn save_table<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        guarded(|| {
            let policy = self.policy(py)?;
            let bytes = detach::interruptible(py, |cancel| policy.save_transitions(cancel))?
                .map_err(|stopped| errors::stopped(py, stopped))?;
            PyBytes::new_with(py, bytes.len(), |out| {
                out.copy_from_slice(&bytes);
                Ok(())
            })
        })
    }

    /// The bytes of the saved table that begins with these.
    fn table_length(&self, py: Python<'_>, start: &[u8]) -> PyResult<u64> {
        guarded(|| self.policy(py)?.transitions_length(start).map_err(|error| errors::table(py, error)))
    }

    /// Adds the entries of a saved table; the number of entries held afterwards.
    fn load_table(&self, py: Python<'_>, table: &[u8]) -> PyResult<usize> {
        guarded(|| {
            let policy = self.policy(py)?;
            detach::interruptible(py, |cancel| policy.load_transitions(table, cancel))?
                .map_err(|error| errors::table(py, error))
        })
    }

    /// What the (step, topology) table has done so far.
    fn table<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        guarded(|| {
            let stats = self.generation.solved().map(|policy| policy.table()).unwrap_or_default();
            let out = PyDict::new(py);
            out.set_item("entries", stats.entries)?;
            out.set_item("hits", stats.hits)?;
            out.set_item("misses", stats.misses)?;
            out.set_item("bytes", stats.bytes)?;
            out.set_item("capacity", self.table_bytes)?;
            Ok(out)
        })
    }
}
