//! The one place where a panic of the core becomes an ordinary exception: PyO3's own is no `Exception`, and what catches
//! errors would miss it.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

/// Runs `work`; what every method does that computes, converts or allocates. Nothing that a panic may leave half done is
/// used again: classes here hold what never changes, or locks that recover.
pub(crate) fn guarded<T>(work: impl FnOnce() -> PyResult<T>) -> PyResult<T> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| Err(failed(&*panic)))
}

/// `RuntimeError` for a panic: a defect, whatever the input was.
pub(crate) fn failed(panic: &(dyn Any + Send)) -> PyErr {
    let said = panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied());
    let said = said.unwrap_or("no message");
    PyRuntimeError::new_err(format!("the computation failed ({said}); please report this with the scenario"))
}
