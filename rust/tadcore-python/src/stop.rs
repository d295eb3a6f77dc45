//! `Stop`: how one thread ends what others compute, where Ctrl-C reaches the main thread alone.

use pyo3::prelude::*;
use tadcore::cancel::CancelToken;

/// A flag that computations in other threads look at.
#[pyclass(frozen, module = "tadcore._core")]
pub(crate) struct Stop {
    pub(crate) token: CancelToken,
}

#[pymethods]
impl Stop {
    #[new]
    fn new() -> Self {
        Self { token: CancelToken::new() }
    }

    /// Ends every computation that was given this flag: each raises KeyboardInterrupt.
    fn set(&self) {
        self.token.cancel();
    }

    /// Whether it was set.
    fn is_set(&self) -> bool {
        self.token.is_cancelled()
    }
}
