//! `Equilibrium`: P on the grid as NumPy arrays.

use std::sync::Arc;

use numpy::{PyArray2, PyArray3, PyArray4};
use pyo3::prelude::*;
use tadcore::policy::Policy;

use super::arrays::shaped;
use super::detach;

/// P on the grid: groups defenders, target, attacker in I1, team in I2.
#[pyclass(frozen, module = "tadcore._core")]
pub(crate) struct Equilibrium {
    policy: Arc<Policy>,
}

impl Equilibrium {
    pub(crate) fn new(policy: Arc<Policy>) -> Self {
        Self { policy }
    }

    fn nodes(&self) -> usize {
        self.policy.game().grid().steps() + 1
    }
}

#[pymethods]
impl Equilibrium {
    /// Names of the groups, in the order of `P`.
    #[getter]
    fn groups(&self) -> Vec<&'static str> {
        match self.policy.equilibrium().groups() {
            1 => vec!["team"],
            _ => vec!["defenders", "target", "attacker"],
        }
    }

    /// P, shape (groups, K + 1, N, N).
    #[getter]
    #[allow(non_snake_case)]
    fn P<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray4<f64>>> {
        let (solution, n) = (self.policy.equilibrium(), self.policy.game().size());
        let groups = solution.groups();
        let mut out = Vec::with_capacity(groups * self.nodes() * n * n);
        for group in 0..groups {
            for k in 0..self.nodes() {
                out.extend_from_slice(&solution.node(k)[group * n * n..(group + 1) * n * n]);
            }
        }
        shaped(py, &out, (groups, self.nodes(), n, n))
    }

    /// Accepted steps of the integrator.
    #[getter]
    fn steps(&self) -> usize {
        self.policy.equilibrium().integrator_steps()
    }

    /// Relative Riccati residual at each node, shape (groups, K + 1).
    fn residual<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let values = detach::interruptible(py, |_| self.policy.equilibrium().residual(self.policy.game()))?;
        shaped(py, &values, (self.policy.equilibrium().groups(), self.nodes()))
    }

    /// FNE feedback rows d1…dn, target, attacker, shape (K + 1, N + 1, N): u = row @ z.
    fn feedback<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let n = self.policy.game().size();
        let width = (n + 1) * n;
        let mut out = vec![0.0; self.nodes() * width];
        for (k, rows) in out.chunks_exact_mut(width).enumerate() {
            self.policy.equilibrium().feedback(self.policy.game(), k, rows);
        }
        shaped(py, &out, (self.nodes(), n + 1, n))
    }
}
