//! Work of the core between two moments of Python: the interpreter released, Ctrl-C heard,
//! panics turned into errors.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, PoisonError};

use pyo3::exceptions::PyMemoryError;
use pyo3::ffi;
use pyo3::prelude::*;

use super::failure::defect;
use crate::{interrupt, reserve};

/// Whether one thread at a time has the interpreter: objects of builds without its lock hold more than
/// a count and a type. A question to such a build has no firm answer: imports switch the lock on for a
/// while.
pub const HAS_LOCK: bool = size_of::<ffi::PyObject>() == 2 * size_of::<usize>();

/// Work that takes no time worth releasing the interpreter for.
pub fn attached<T>(py: Python<'_>, work: impl FnOnce() -> T) -> PyResult<T> {
    reserve::fill();
    catch_unwind(AssertUnwindSafe(work)).map_err(|payload| panicked(py, payload))
}

/// Readings below which one look at each takes less time than to release the interpreter pays for.
const FEW: usize = 4096;

/// One look at so many readings: with the interpreter where they are few.
pub fn look<T: Send>(
    py: Python<'_>,
    readings: usize,
    work: impl FnOnce() -> T + Send,
) -> PyResult<T> {
    if readings <= FEW {
        attached(py, work)
    } else {
        detached(py, work)
    }
}

/// Work without the interpreter, which Ctrl-C ends.
pub fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    reserve::fill();
    let raised = Arc::new(Mutex::new(None));
    let seen = Arc::clone(&raised);
    let check = move || {
        if reserve::is_empty() {
            return true;
        }
        Python::attach(|py| match py.check_signals() {
            Ok(()) => false,
            Err(error) => {
                *seen.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                true
            }
        })
    };
    let work = AssertUnwindSafe(|| interrupt::within(check, work));
    match py.detach(move || catch_unwind(work)) {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(interrupt::Interrupted)) => {
            let mut raised = raised.lock().unwrap_or_else(PoisonError::into_inner);
            Err(raised.take().unwrap_or_else(|| {
                PyMemoryError::new_err("memory ran short while this was computed")
            }))
        }
        Err(payload) => Err(panicked(py, payload)),
    }
}

fn panicked(py: Python<'_>, payload: Box<dyn Any + Send>) -> PyErr {
    let text = payload.downcast_ref::<String>().map(String::as_str);
    let text = text.or_else(|| payload.downcast_ref::<&str>().copied());
    defect(py, text.unwrap_or("a panic without a message"))
}
