//! `Equilibrium`: P on the grid as NumPy arrays.

use std::sync::Arc;

use numpy::{PyArray2, PyArray3, PyArray4};
use pyo3::prelude::*;
use tadcore::policy::Policy;

use super::arrays::{filled, shaped};
use super::guard::guarded;
use super::{detach, errors};

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
        guarded(|| {
            let (solution, n, nodes) = (self.policy.equilibrium(), self.policy.game().size(), self.nodes());
            let len = n * n;
            filled(py, (solution.groups(), nodes, n, n), |start, piece| {
                let mut done = 0;
                while done < piece.len() {
                    let (matrix, from) = ((start + done) / len, (start + done) % len);
                    let p = &solution.p(matrix / nodes, matrix % nodes)[from..];
                    let count = p.len().min(piece.len() - done);
                    piece[done..done + count].copy_from_slice(&p[..count]);
                    done += count;
                }
            })
        })
    }

    /// Accepted steps of the integrator.
    #[getter]
    fn steps(&self) -> usize {
        self.policy.equilibrium().integrator_steps()
    }

    /// Relative Riccati residual at each node, shape (groups, K + 1).
    fn residual<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        guarded(|| {
            let (solution, game) = (self.policy.equilibrium(), self.policy.game());
            let values = detach::interruptible(py, |cancel| solution.residual(game, cancel))?
                .map_err(|stopped| errors::stopped(py, stopped))?;
            shaped(py, &values, (solution.groups(), self.nodes()))
        })
    }

    /// FNE feedback rows d1…dn, target, attacker, shape (K + 1, N + 1, N): u = row @ z.
    fn feedback<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        guarded(|| {
            let n = self.policy.game().size();
            let mut rows = vec![0.0; (n + 1) * n];
            let mut held = None;
            filled(py, (self.nodes(), n + 1, n), |start, piece| {
                for (e, x) in piece.iter_mut().enumerate() {
                    let (k, at) = ((start + e) / rows.len(), (start + e) % rows.len());
                    if held != Some(k) {
                        self.policy.equilibrium().feedback(self.policy.game(), k, &mut rows);
                        held = Some(k);
                    }
                    *x = rows[at];
                }
            })
        })
    }
}
