//! Core errors as the classes of `trueangle.errors`.

use pyo3::exceptions::PyMemoryError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;

use crate::error::Error;

/// The Python module that defines the exception classes, imported at the first error.
static ERRORS: PyOnceLock<Py<PyModule>> = PyOnceLock::new();

impl From<Error> for PyErr {
    fn from(error: Error) -> PyErr {
        Python::attach(|py| raise(py, &error).unwrap_or_else(|failure| failure))
    }
}

/// `ArgumentError(message)`, for what only the bindings can find wrong.
pub fn argument_error(py: Python<'_>, message: String) -> PyErr {
    made(py, "ArgumentError", message)
}

/// `KindError(message)`: an argument is no number at all.
pub fn kind_error(py: Python<'_>, message: String) -> PyErr {
    made(py, "KindError", message)
}

/// What only a mistake of ours can lead to.
pub fn defect(py: Python<'_>, what: &str) -> PyErr {
    let message = format!("a defect of trueangle, please report it: {what}");
    made(py, "TrueAngleError", message)
}

fn made(py: Python<'_>, class: &str, message: String) -> PyErr {
    errors(py)
        .and_then(|module| module.getattr(class)?.call1((message,)))
        .map_or_else(|failure| failure, PyErr::from_value)
}

fn errors(py: Python<'_>) -> PyResult<&Bound<'_, PyModule>> {
    ERRORS
        .get_or_try_init(py, || {
            PyModule::import(py, "trueangle.errors").map(Bound::unbind)
        })
        .map(|module| module.bind(py))
}

fn raise(py: Python<'_>, error: &Error) -> PyResult<PyErr> {
    let message = error.to_string();
    if let Error::Memory { .. } = error {
        return Ok(PyMemoryError::new_err(message));
    }
    let module = errors(py)?;
    let instance = match error {
        Error::Rank { orders, .. } => {
            let class = module.getattr("RankError")?;
            class.call1((message, orders.clone()))?
        }
        Error::NotInvertible { slope } => module
            .getattr("NotInvertibleError")?
            .call1((message, *slope))?,
        Error::MissingSignal { .. } => module.getattr("MissingSignalError")?.call1((message,))?,
        _ => module.getattr("ArgumentError")?.call1((message,))?,
    };
    Ok(PyErr::from_value(instance))
}

/// That the angle of another joint was not given.
pub fn missing_other(py: Python<'_>, name: &str) -> PyResult<PyErr> {
    let problem = format!(
        "the model's term 'joint_coupling' needs {name}, the angle of another joint, which was \
         not given: pass {name}=, in a log the column {name}_deg"
    );
    let class = errors(py)?.getattr("MissingSignalError")?;
    Ok(PyErr::from_value(class.call1((problem,))?))
}
