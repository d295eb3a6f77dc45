//! `Record`: one recorded run as NumPy arrays.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;
use tadcore::cost;
use tadcore::network::Topology;
use tadcore::policy::Policy;
use tadcore::simulation::{Pass, Record as CoreRecord, State};

use super::arrays::{entries, shaped};
use super::guard::guarded;
use super::{detach, errors};

/// One recorded run of L steps: rows 0…L, the last the terminal state.
#[pyclass(frozen, module = "tadcore._core")]
pub(crate) struct Record {
    policy: Arc<Policy>,
    record: CoreRecord,
}

impl Record {
    pub(crate) fn new(policy: Arc<Policy>, record: CoreRecord) -> Self {
        Self { policy, record }
    }

    fn rows(&self) -> usize {
        self.record.steps + 1
    }

    fn players(&self) -> usize {
        self.policy.game().n() + 2
    }

    /// What was up, row by row, in a world.
    fn states(&self) -> Option<&[State]> {
        self.record.course.as_ref().map(|course| &*course.states).filter(|states| !states.is_empty())
    }
}

/// Networks of one size, one for each row.
fn networks<'py, T>(
    py: Python<'py>,
    rows: &[T],
    network: impl Fn(&T) -> &Topology,
) -> PyResult<Bound<'py, PyArray3<bool>>> {
    let (m, n) = rows.first().map_or((0, 0), |row| (network(row).rows(), network(row).size()));
    entries(py, (rows.len(), m, n), |e| network(&rows[e / (m * n)]).sees(e / n % m, e % n))
}

#[pymethods]
impl Record {
    /// Code of the outcome: timeout 0, captured 1, intercepted 2.
    #[getter]
    fn kind(&self) -> i8 {
        self.record.outcome.code()
    }

    /// The defender that intercepted, −1 where none did.
    #[getter]
    fn defender(&self) -> i32 {
        self.record.outcome.defender()
    }

    /// Time of termination.
    #[getter]
    fn time(&self) -> f64 {
        self.record.time(self.policy.game().grid())
    }

    /// Capture radii entered between two instants: defender (-1 for the target), t_k, t_{k+1}, when it is entered, when
    /// the two are closest, how close.
    #[getter]
    fn passes(&self) -> Vec<(i32, f64, f64, f64, f64, f64)> {
        let (grid, n) = (self.policy.game().grid(), self.policy.game().n());
        let within = |pass: &Pass, s: f64| grid.time_after(pass.step, s);
        let told = |pass: &Pass| {
            let who = if pass.row < n { i32::try_from(pass.row).unwrap_or(i32::MAX) } else { -1 };
            let (start, end) = (grid.time(pass.step), grid.time(pass.step + 1));
            (who, start, end, within(pass, pass.enters), within(pass, pass.closest), pass.distance)
        };
        self.record.passes.iter().map(told).collect()
    }

    /// When the game diverged, and its largest size over that of its start; `None` where it did not.
    #[getter]
    fn diverged(&self) -> Option<(f64, f64)> {
        self.record.diverged.map(|found| (self.policy.game().grid().time(found.step), found.size))
    }

    /// Times of the rows.
    #[getter]
    fn times<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        guarded(|| entries(py, self.rows(), |i| self.record.time_of(i, self.policy.game().grid())))
    }

    /// Positions, shape (L + 1, n + 2, dim).
    #[getter]
    fn position<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        guarded(|| shaped(py, &self.record.positions, (self.rows(), self.players(), self.record.dim)))
    }

    /// Velocities, shape (L + 1, n + 2, dim).
    #[getter]
    fn control<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        guarded(|| shaped(py, &self.record.controls, (self.rows(), self.players(), self.record.dim)))
    }

    /// 𝒜, shape (L + 1, m, N).
    #[getter]
    fn adjacency<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<bool>>> {
        guarded(|| networks(py, &self.record.networks, |network| network))
    }

    /// Who saw whom, shape (L + 1, m, N); `None` but in a world or under a network from outside.
    #[getter]
    fn seen<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray3<bool>>>> {
        let Some(course) = &self.record.course else { return Ok(None) };
        guarded(|| networks(py, &course.seen, |seen| seen).map(Some))
    }

    /// Sensors that worked, shape (L + 1, m); `None` without a world.
    #[getter]
    fn sensor_up<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<bool>>>> {
        let Some(states) = self.states() else { return Ok(None) };
        let m = self.policy.game().constrained();
        guarded(|| entries(py, (self.rows(), m), |e| states[e / m].sensors.sees(0, e % m)).map(Some))
    }

    /// Edges that were detected where they were within sight, shape (L + 1, m, N); `None` without a world.
    #[getter]
    fn edge_up<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray3<bool>>>> {
        let Some(states) = self.states() else { return Ok(None) };
        guarded(|| networks(py, states, |state| &state.edges).map(Some))
    }

    /// Who heard whom, shape (L + 1, m, m), the diagonal false; `None` without a world.
    #[getter]
    fn heard<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray3<bool>>>> {
        let Some(states) = self.states() else { return Ok(None) };
        guarded(|| networks(py, states, |state| &state.heard).map(Some))
    }

    /// Displacements after the step from each row, shape (L + 1, n + 2, dim), the last row 0; `None` without a world.
    #[getter]
    fn displacement<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray3<f64>>>> {
        let Some(course) = self.record.course.as_ref().filter(|course| !course.states.is_empty()) else {
            return Ok(None);
        };
        guarded(|| shaped(py, &course.displacement, (self.rows(), self.players(), self.record.dim)).map(Some))
    }

    /// Gain rows, shape (L + 1, m, N).
    #[getter]
    fn gains<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let game = self.policy.game();
        guarded(|| shaped(py, &self.record.gains, (self.rows(), game.constrained(), game.size())))
    }

    /// The factors of Jz, shape (L + 1, m, N); `None` for scalar gains.
    #[getter]
    fn turn<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray3<f64>>>> {
        if self.record.turn.is_empty() {
            return Ok(None);
        }
        let game = self.policy.game();
        guarded(|| shaped(py, &self.record.turn, (self.rows(), game.constrained(), game.size())).map(Some))
    }

    /// Θ at each row, reduced.
    #[getter]
    fn theta<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        guarded(|| shaped(py, &self.record.theta, self.rows()))
    }

    /// Terms of Θ, unweighted and reduced, shape (L + 1, 4 or 3).
    #[getter]
    fn theta_terms<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        guarded(|| shaped(py, &self.record.terms, (self.rows(), self.policy.game().interaction().terms())))
    }

    /// J of each player: J_d, J_τ, J_a in I1, J in I2.
    #[getter]
    fn costs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        guarded(|| {
            let costs = detach::interruptible(py, |cancel| cost::costs(&self.policy, &self.record, cancel))?
                .map_err(|error| errors::run(py, self.policy.game(), error))?;
            shaped(py, &costs, costs.len())
        })
    }

    /// Iterations of all syntheses.
    #[getter]
    fn iterations(&self) -> usize {
        self.record.iterations
    }

    /// Rows whose synthesis stopped short of its tolerance.
    #[getter]
    fn unconverged(&self) -> usize {
        self.record.unconverged
    }

    /// Rows whose gains are proved to be globally optimal.
    #[getter]
    fn certified(&self) -> usize {
        self.record.certified
    }
}
