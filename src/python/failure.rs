//! Core errors as the classes of `trueangle.errors`.

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

fn raise(py: Python<'_>, error: &Error) -> PyResult<PyErr> {
    let module = ERRORS.get_or_try_init(py, || {
        PyModule::import(py, "trueangle.errors").map(Bound::unbind)
    })?;
    let module = module.bind(py);
    let message = error.to_string();
    let instance = match error {
        Error::Rank { orders, .. } => {
            let class = module.getattr("RankError")?;
            class.call1((message, orders.clone()))?
        }
        Error::NotInvertible { slope } => module
            .getattr("NotInvertibleError")?
            .call1((message, *slope))?,
        _ => module.getattr("ArgumentError")?.call1((message,))?,
    };
    Ok(PyErr::from_value(instance))
}
