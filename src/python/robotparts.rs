//! What a robot's step is made of: joints, couplings, results, errors by joint.

use std::sync::Arc;

use numpy::npyffi::{NpyTypes, PY_ARRAY_API, get_type_object, npy_intp};
use numpy::{PyArrayDescrMethods, PyUntypedArray, dtype};
use pyo3::prelude::*;

use super::corrector::PyCorrector;
use super::failure::argument_error;
use super::release::detached;
use super::series::PySeries;
use super::terms::OTHER;
use crate::compensator::Compensator;
use crate::robot::{Coupling, Joint, JointError};
use crate::terms::{Corrector, Signal};

/// The angles of other joints that correctors need, each in the unit of its joint.
pub fn couplings(names: &[String], parts: &[Bound<'_, PyAny>]) -> PyResult<Vec<Coupling>> {
    let mut found = Vec::new();
    let mut periods = Vec::with_capacity(parts.len());
    for part in parts {
        periods.push(match part.cast::<PySeries>() {
            Ok(series) => series.get().evaluator.series().period().value(),
            Err(_) => {
                let corrector: PyRef<'_, PyCorrector> = part.extract()?;
                corrector.terms().evaluator().series().period().value()
            }
        });
    }
    for (joint, part) in parts.iter().enumerate() {
        let Ok(corrector) = part.extract::<PyRef<'_, PyCorrector>>() else {
            continue;
        };
        for (name, &signal) in corrector.others().iter().zip(Signal::OTHERS) {
            let known = |own: &String| name.strip_prefix(OTHER) == Some(own);
            let Some(other) = names.iter().position(known) else {
                let problem = format!(
                    "joint {}: its model needs {name}, and the robot has no such joint: correct \
                     it by its own corrector",
                    names[joint]
                );
                return Err(argument_error(part.py(), problem));
            };
            let scale = periods[joint] / periods[other];
            found.push(Coupling {
                joint,
                signal,
                other,
                scale,
            });
        }
    }
    Ok(found)
}

/// The joint that a series, or a corrector without its past, is.
pub fn joint(part: &Bound<'_, PyAny>) -> PyResult<Joint> {
    if let Ok(series) = part.cast::<PySeries>() {
        let evaluator = Arc::clone(&series.get().evaluator);
        let made = detached(part.py(), || Compensator::new(evaluator))??;
        return Ok(Joint::Still(made));
    }
    let corrector: PyRef<'_, PyCorrector> = part.extract()?;
    let terms = Arc::clone(corrector.terms());
    Ok(Joint::Moving(Box::new(Corrector::new(terms))))
}

/// A fresh array of so many doubles.
pub fn fresh(py: Python<'_>, size: usize) -> PyResult<Bound<'_, PyUntypedArray>> {
    let mut length = size as npy_intp;
    // SAFETY: numpy takes over the reference to the dtype and reads one length.
    unsafe {
        let array = PY_ARRAY_API.PyArray_NewFromDescr(
            py,
            get_type_object(py, NpyTypes::PyArray_Type),
            dtype::<f64>(py).into_dtype_ptr(),
            1,
            &raw mut length,
            std::ptr::null_mut(),
            std::ptr::null_mut(),
            0,
            std::ptr::null_mut(),
        );
        Ok(Bound::from_owned_ptr_or_err(py, array)?.cast_into_unchecked())
    }
}

/// An error under the name of its joint.
pub fn named(names: &[String], error: JointError) -> PyErr {
    let JointError { joint, error } = error;
    let raised = PyErr::from(error);
    Python::attach(|py| {
        let text = format!("joint {}: {}", names[joint], raised.value(py));
        match raised.get_type(py).call1((text,)) {
            Ok(value) => PyErr::from_value(value),
            Err(_) => raised,
        }
    })
}
