//! Bindings: convert, call, convert. Nothing is computed here, and nothing here may end the interpreter.

#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable)]

mod arrays;
mod detach;
mod equilibrium;
mod errors;
mod gains;
mod game;
mod record;

use numpy::PyArray1;
use pyo3::prelude::*;
use tadcore::game::Grid;

/// The compiled core of tadcore.
#[pymodule]
mod _core {
    #[pymodule_export]
    use super::equilibrium::Equilibrium;
    #[pymodule_export]
    use super::gains::Gains;
    #[pymodule_export]
    use super::game::Game;
    #[pymodule_export]
    use super::record::Record;
    use super::*;

    /// The vector instructions in use.
    #[pyfunction]
    fn simd(py: Python<'_>) -> PyResult<&'static str> {
        tadcore::simd::in_use().map_err(|error| errors::simd(py, &error))
    }

    /// t_0 … t_K of the grid with step δ on [0, T].
    #[pyfunction]
    fn grid_times<'py>(py: Python<'py>, horizon: f64, step: f64) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let grid = Grid::new(horizon, step).map_err(|error| errors::game(py, error))?;
        Ok(PyArray1::from_iter(py, (0..=grid.steps()).map(|k| grid.time(k))))
    }

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
