//! A network from outside: a function of the caller's, asked at every instant of a recorded run.

use std::sync::{Mutex, PoisonError};

use numpy::{PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use tadcore::game::Game;
use tadcore::network::Topology;
use tadcore::simulation::{self, Moment};

use super::arrays::{entries, shaped};
use super::errors;
use super::inputs::topology;

/// A function (k, t, positions, seen) → adjacency, and how it failed.
pub(crate) struct Outside {
    function: Py<PyAny>,
    rows: usize,
    size: usize,
    dim: usize,
    failed: Mutex<Option<PyErr>>,
}

impl Outside {
    pub(crate) fn new(function: Py<PyAny>, game: &Game, dim: usize) -> Self {
        Self { function, rows: game.constrained(), size: game.size(), dim, failed: Mutex::new(None) }
    }

    /// As the core asks for it.
    pub(crate) fn network(&self) -> Box<simulation::Outside<'_>> {
        Box::new(|moment| {
            Python::attach(|py| match self.ask(py, moment) {
                Ok(network) => Some(network),
                Err(error) => {
                    *self.failed.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                    None
                }
            })
        })
    }

    /// What the function raised, or why its answer is none.
    pub(crate) fn error(self) -> Option<PyErr> {
        self.failed.into_inner().unwrap_or_else(PoisonError::into_inner)
    }

    fn ask(&self, py: Python<'_>, moment: &Moment) -> PyResult<Topology> {
        let (m, n) = (self.rows, self.size);
        let positions = shaped(py, moment.positions, (n + 1, self.dim))?;
        let seen = entries(py, (m, n), |e| moment.seen.sees(e / n, e % n))?;
        let answer = self.function.call1(py, (moment.step, moment.time, positions, seen)).inspect_err(|error| {
            // What it raised goes on as it is; a note says when.
            let note = format!("raised by network= at step {}, t = {}", moment.step, moment.time);
            let _ = error.value(py).call_method1("add_note", (note,));
        })?;
        match answer.extract::<PyReadonlyArray2<'_, bool>>(py) {
            Ok(network) if network.shape() == [m, n] => Ok(topology(network.as_array())),
            _ => {
                let told = |name: &str| answer.getattr(py, name).ok().map(|value| value.to_string());
                let found = match (told("shape"), told("dtype")) {
                    (Some(shape), Some(dtype)) => format!("{dtype} of shape {shape}"),
                    _ => answer.bind(py).get_type().name()?.to_string(),
                };
                let found = format!("{found} at t = {}", moment.time);
                Err(errors::value(
                    py,
                    "network",
                    found,
                    format!("a function that returns a bool array of shape ({m}, {n})"),
                ))
            }
        }
    }
}
