//! `_core.Alike`.

use std::sync::Arc;

use numpy::{PyArray1, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::corrector::PyCorrector;
use super::failure::argument_error;
use super::release::attached;
use super::signals::{as_signal, columns, doubles};
use crate::terms::Alike;

/// Joints of the same terms, each with a past of its own.
#[pyclass(name = "Alike", module = "trueangle._core")]
pub struct PyAlike {
    inner: Alike,
    corrector: PyCorrector,
}

#[pymethods]
impl PyAlike {
    /// So many joints of a corrector's terms.
    #[new]
    fn new(corrector: &PyCorrector, count: usize, py: Python<'_>) -> Self {
        Self {
            inner: Alike::new(Arc::clone(corrector.terms()), count),
            corrector: corrector.twin(py),
        }
    }

    fn __len__(&self) -> usize {
        self.inner.len()
    }

    /// Others with the same past.
    fn copy(&self, py: Python<'_>) -> Self {
        Self {
            inner: self.inner.clone(),
            corrector: self.corrector.twin(py),
        }
    }

    /// Forget the past of some.
    fn reset(&mut self, py: Python<'_>, joints: Vec<usize>) -> PyResult<()> {
        if let Some(joint) = joints.iter().find(|&&joint| joint >= self.inner.len()) {
            let problem = format!("there is no joint {joint} among {}", self.inner.len());
            return Err(argument_error(py, problem));
        }
        for joint in joints {
            self.inner.reset(joint);
        }
        Ok(())
    }

    /// The error of every joint at its angle; signals are of the same shape or one value.
    #[pyo3(signature = (angles, /, **signals))]
    fn error<'py>(
        &mut self,
        angles: &Bound<'py, PyAny>,
        signals: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let py = angles.py();
        let signals = match signals {
            Some(given) => self.corrector.taken(given)?,
            None => Vec::new(),
        };
        let given = |signal| signals.iter().any(|(known, _)| *known == signal);
        self.corrector.check_others(py, given)?;
        let angles = as_signal(angles, "angles")?;
        let columns = columns(&signals);
        let mut errors = vec![0.0; angles.len()];
        attached(py, || {
            self.inner.errors(doubles(&angles), &columns, &mut errors)
        })??;
        Ok(PyArray1::from_vec(py, errors))
    }
}
