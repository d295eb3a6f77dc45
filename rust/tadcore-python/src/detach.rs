//! The one place that leaves the interpreter: the work runs on its own thread while this one polls for Ctrl-C.

use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use pyo3::prelude::*;
use tadcore::cancel::CancelToken;

use super::{errors, guard};

/// How often signals are looked for.
const POLL: Duration = Duration::from_millis(50);

/// Runs `work` without the interpreter lock; Ctrl-C (or any signal handler that raises) raises the token and then the
/// exception, once the work has noticed. A panic in the work becomes an ordinary exception, and so does a system that
/// has no thread to give.
pub(crate) fn interruptible<T: Send>(py: Python<'_>, work: impl FnOnce(&CancelToken) -> T + Send) -> PyResult<T> {
    stoppable(py, CancelToken::new(), work)
}

/// The same with a token that somebody else may raise, too.
pub(crate) fn stoppable<T: Send>(
    py: Python<'_>,
    token: CancelToken,
    work: impl FnOnce(&CancelToken) -> T + Send,
) -> PyResult<T> {
    let (outcome, raised) = py.detach(|| {
        let polled = token.clone();
        let (sender, receiver) = channel();
        thread::scope(|scope| {
            let worker = thread::Builder::new().spawn_scoped(scope, move || {
                let result = work(&polled);
                // The receiver outlives the worker; a worker that panics drops its sender, which ends the wait too.
                let _ = sender.send(());
                result
            });
            let worker = match worker {
                Ok(worker) => worker,
                Err(error) => return (Err(error), None),
            };
            let mut raised = None;
            while let Err(RecvTimeoutError::Timeout) = receiver.recv_timeout(POLL) {
                if raised.is_none()
                    && let Err(error) = Python::attach(|py| py.check_signals())
                {
                    token.cancel();
                    raised = Some(error);
                }
            }
            (Ok(worker.join()), raised)
        })
    });
    if let Some(error) = raised {
        return Err(error);
    }
    outcome.map_err(|error| errors::no_thread(py, &error))?.map_err(|panic| guard::failed(&*panic))
}
