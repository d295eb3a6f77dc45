//! Core errors as the Python classes of `tadcore.errors`.

use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use tadcore::error::{EquilibriumError, GameError, RunError, SimdError};
use tadcore::game::Game;

fn raise(py: Python<'_>, class: &str, arguments: impl for<'py> pyo3::call::PyCallArgs<'py>) -> PyErr {
    let made =
        py.import("tadcore.errors").and_then(|module| module.getattr(class)).and_then(|class| class.call1(arguments));
    match made {
        Ok(instance) => PyErr::from_value(instance),
        Err(error) => error,
    }
}

/// `ScenarioError` naming field, value and rule; `TadcoreError` if it is the environment's fault.
pub(crate) fn game(py: Python<'_>, error: GameError) -> PyErr {
    match error {
        GameError::Value { field, value, rule } => raise(py, "ScenarioError", (field, value, rule)),
        GameError::Length { field, found, expected } => {
            raise(py, "ScenarioError", (field, format!("{found} entries"), format!("of {expected} entries")))
        }
        GameError::Size { players, steps, gib } => {
            let rule =
                "such that P at all instants fits into 16 GiB: a larger step, a shorter horizon, fewer defenders";
            raise(py, "ScenarioError", ("step", format!("{steps} steps of {players} players, {gib} GiB"), rule))
        }
        GameError::Grid { horizon, step } => {
            let rule = format!("a divisor of the horizon {horizon}");
            raise(py, "ScenarioError", ("step", step, rule))
        }
        GameError::Simd(error) => simd(py, &error),
    }
}

/// `TadcoreError`: no scenario is to blame.
pub(crate) fn simd(py: Python<'_>, error: &SimdError) -> PyErr {
    raise(py, "TadcoreError", (error.to_string(),))
}

/// `NoEquilibriumError` with its escape time.
pub(crate) fn equilibrium(py: Python<'_>, game: &Game, error: &EquilibriumError) -> PyErr {
    match error {
        EquilibriumError::FiniteEscape { escape_time, horizon } => {
            raise(py, "NoEquilibriumError", (*escape_time, *horizon, game.grid().step()))
        }
        EquilibriumError::StepBudget { .. } | EquilibriumError::Range | EquilibriumError::Memory { .. } => {
            raise(py, "TadcoreError", (error.to_string(),))
        }
        EquilibriumError::Cancelled(_) => PyKeyboardInterrupt::new_err(()),
    }
}

/// Any error of a run.
pub(crate) fn run(py: Python<'_>, of: &Game, error: RunError) -> PyErr {
    match error {
        RunError::Game(error) => game(py, error),
        RunError::Equilibrium(error) => equilibrium(py, of, &error),
        RunError::Range { .. } | RunError::Cost { .. } => raise(py, "TadcoreError", (error.to_string(),)),
        RunError::Threads(threads) => raise(py, "ScenarioError", ("threads", threads, "a number the system can start")),
        RunError::Cancelled(_) => PyKeyboardInterrupt::new_err(()),
    }
}
