//! `Gains`: the answer of one synthesis.

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use tadcore::network::Topology;
use tadcore::synthesis::{Gains as CoreGains, Start, Status};

use super::arrays::shaped;
use super::guard::guarded;

/// The gains at one (instant, topology).
#[pyclass(frozen, module = "tadcore._core")]
pub(crate) struct Gains {
    gains: CoreGains,
    terms: Vec<f64>,
    certified_blocks: bool,
    topology: Topology,
}

impl Gains {
    pub(crate) fn new(gains: CoreGains, terms: Vec<f64>, certified_blocks: bool, topology: Topology) -> Self {
        Self { gains, terms, certified_blocks, topology }
    }

    fn part<'py>(&self, py: Python<'py>, turn: &[f64]) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let shape = (self.topology.rows(), self.topology.size());
        if turn.is_empty() { Ok(None) } else { shaped(py, turn, shape).map(Some) }
    }
}

#[pymethods]
impl Gains {
    /// Gain rows, shape (m, N): u_i = rows[i] @ z.
    #[getter]
    fn rows<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        guarded(|| shaped(py, &self.gains.rows, (self.topology.rows(), self.topology.size())))
    }

    /// The factors of Jz in gains that turn, shape (m, N): u_i = rows[i] @ z + turn[i] @ Jz; `None` for scalar gains.
    #[getter]
    fn turn<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        guarded(|| self.part(py, &self.gains.turn))
    }

    /// The factors of J in the paper's K, shape (m, N); `None` for scalar gains.
    #[getter]
    #[allow(non_snake_case)]
    fn K_turn<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        guarded(|| self.part(py, &self.gains.paper_turn(&self.topology)))
    }

    /// Scalar factors of the paper's K, shape (m, N).
    #[getter]
    #[allow(non_snake_case)]
    fn K<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        guarded(|| shaped(py, &self.gains.paper_gains(&self.topology), (self.topology.rows(), self.topology.size())))
    }

    /// Θ, reduced.
    #[getter]
    fn theta(&self) -> f64 {
        self.gains.theta
    }

    /// Unweighted squared norms, in the order of the synthesis weights.
    #[getter]
    fn terms<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        guarded(|| shaped(py, &self.terms, self.terms.len()))
    }

    /// Relative norm of the gradient at the end.
    #[getter]
    fn gradient_norm(&self) -> f64 {
        self.gains.gradient_norm
    }

    /// Iterations of all descents together.
    #[getter]
    fn iterations(&self) -> usize {
        self.gains.iterations
    }

    /// Whether the gradient fell below the tolerance.
    #[getter]
    fn converged(&self) -> bool {
        self.gains.status == Status::Converged
    }

    /// How the solver ended: converged, stalled or iteration_limit.
    #[getter]
    fn status(&self) -> &'static str {
        self.gains.status.name()
    }

    /// Whether the minimum is proved to be global among scalar gains.
    #[getter]
    fn certified(&self) -> bool {
        self.gains.certified
    }

    /// Whether it is proved to be global among the paper's gains in blocks.
    #[getter]
    fn certified_blocks(&self) -> bool {
        self.certified_blocks
    }

    /// Restarts that promised to lead lower, beyond those made: in large games their number is limited.
    #[getter]
    fn restarts_left_out(&self) -> usize {
        self.gains.left_out
    }

    /// The start that led to the minimum: canonical, complex, stacked, reversed or between.
    #[getter]
    fn start(&self) -> &'static str {
        match self.gains.start {
            Start::Canonical => "canonical",
            Start::Complex => "complex",
            Start::Stacked => "stacked",
            Start::Reversed => "reversed",
            Start::Between => "between",
        }
    }
}
