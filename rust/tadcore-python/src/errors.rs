//! Core errors as the Python classes of `tadcore.errors`.

use pyo3::exceptions::{PyKeyboardInterrupt, PyValueError};
use pyo3::prelude::*;
use tadcore::error::{EquilibriumError, GameError, NoMemory, RunError, SimdError, Stopped, TableError};
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

/// `ScenarioError` for what the core does not see.
pub(crate) fn value(py: Python<'_>, field: &str, value: String, rule: String) -> PyErr {
    raise(py, "ScenarioError", (field, value, rule))
}

/// `TadcoreError`: no scenario is to blame.
pub(crate) fn simd(py: Python<'_>, error: &SimdError) -> PyErr {
    raise(py, "TadcoreError", (error.to_string(),))
}

/// `OutOfMemoryError` with what asked for it, and for how many bytes.
pub(crate) fn memory(py: Python<'_>, none: NoMemory) -> PyErr {
    raise(py, "OutOfMemoryError", (none.what, none.bytes, none.limit))
}

/// `TadcoreError`: the system has reached a limit on threads or processes.
pub(crate) fn no_thread(py: Python<'_>, error: &std::io::Error) -> PyErr {
    raise(py, "TadcoreError", (format!("the system would not start a thread to compute in: {error}"),))
}

/// Why a computation ended before its time.
pub(crate) fn stopped(py: Python<'_>, stopped: Stopped) -> PyErr {
    match stopped {
        Stopped::Cancelled(_) => PyKeyboardInterrupt::new_err(()),
        Stopped::Memory(none) => memory(py, none),
    }
}

/// `ValueError` for bytes that are no table of the game.
pub(crate) fn table(py: Python<'_>, error: TableError) -> PyErr {
    match error {
        TableError::Cancelled(_) => PyKeyboardInterrupt::new_err(()),
        TableError::Memory(none) => memory(py, none),
        _ => PyValueError::new_err(error.to_string()),
    }
}

/// `NoEquilibriumError` with its escape time.
pub(crate) fn equilibrium(py: Python<'_>, game: &Game, error: &EquilibriumError) -> PyErr {
    match error {
        EquilibriumError::FiniteEscape { escape_time, horizon } => {
            raise(py, "NoEquilibriumError", (*escape_time, *horizon, game.grid().step()))
        }
        EquilibriumError::StepBudget { .. } | EquilibriumError::Undetermined { .. } | EquilibriumError::Range => {
            raise(py, "TadcoreError", (error.to_string(),))
        }
        EquilibriumError::Memory(none) => memory(py, *none),
        EquilibriumError::Cancelled(_) => PyKeyboardInterrupt::new_err(()),
    }
}

/// Any error of a run.
pub(crate) fn run(py: Python<'_>, of: &Game, error: RunError) -> PyErr {
    match error {
        RunError::Game(error) => game(py, error),
        RunError::Equilibrium(error) => equilibrium(py, of, &error),
        RunError::Range { .. } | RunError::Cost { .. } | RunError::Turns { .. } | RunError::Network { .. } => {
            raise(py, "TadcoreError", (error.to_string(),))
        }
        RunError::Threads(threads) => raise(py, "ScenarioError", ("threads", threads, "a number the system can start")),
        RunError::Memory(none) => memory(py, none),
        RunError::Cancelled(_) => PyKeyboardInterrupt::new_err(()),
    }
}
