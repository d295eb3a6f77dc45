//! Bindings: convert, call, convert. Nothing is computed here, and nothing here may end the interpreter.

#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable)]

mod arrays;
mod cells;
mod detach;
mod equilibrium;
mod errors;
mod gains;
mod game;
mod games;
mod generation;
mod guard;
mod inputs;
mod outside;
mod record;
mod stop;
mod world;

use guard::guarded;
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use tadcore::game::Grid;
use tadcore::simulation::Setup;

/// The compiled core of tadcore.
#[pymodule]
mod _core {
    #[pymodule_export]
    use super::cells::Cells;
    #[pymodule_export]
    use super::equilibrium::Equilibrium;
    #[pymodule_export]
    use super::gains::Gains;
    #[pymodule_export]
    use super::game::Game;
    #[pymodule_export]
    use super::games::simulate_games;
    #[pymodule_export]
    use super::record::Record;
    #[pymodule_export]
    use super::stop::Stop;
    #[pymodule_export]
    use super::world::World;
    use super::*;

    /// Who sees whom at positions of shape (n + 2, dim), shape (m, N), by the arithmetic of a run.
    #[pyfunction]
    fn observe<'py>(
        py: Python<'py>,
        positions: PyReadonlyArray2<'py, f64>,
        visibility_radii: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray2<bool>>> {
        guarded(|| {
            let dim = positions.as_array().ncols();
            let (positions, visibility) = (arrays::copied(py, &positions)?, arrays::copied(py, &visibility_radii)?);
            let setup = Setup { dim, positions: &positions, visibility: &visibility, capture: &[] };
            let seen = setup.network().map_err(|error| errors::game(py, error))?;
            let n = seen.size();
            arrays::entries(py, (seen.rows(), n), |e| seen.sees(e / n, e % n))
        })
    }

    /// The vector instructions in use.
    #[pyfunction]
    fn simd(py: Python<'_>) -> PyResult<&'static str> {
        guarded(|| tadcore::simd::in_use().map_err(|error| errors::simd(py, &error)))
    }

    /// t_0 … t_K of the grid with step δ on [0, T].
    #[pyfunction]
    fn grid_times<'py>(py: Python<'py>, horizon: f64, step: f64) -> PyResult<Bound<'py, PyArray1<f64>>> {
        guarded(|| {
            let grid = Grid::new(horizon, step).map_err(|error| errors::game(py, error))?;
            arrays::entries(py, grid.steps() + 1, |k| grid.time(k))
        })
    }

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
