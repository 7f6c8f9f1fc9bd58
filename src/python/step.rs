//! `_core.Compensator`: corrections one at a time at the least price of a call.

use std::ffi::CStr;
use std::sync::Arc;

use arc_swap::ArcSwap;
use pyo3::exceptions::PyTypeError;
use pyo3::ffi;
use pyo3::prelude::*;
use pyo3::types::PyType;

use super::number::single;
use super::release::detached;
use super::series::PySeries;
use super::terms::OTHER;
use crate::compensator::Compensator;
use crate::kernel::Quantity;
use crate::terms::Signal;

/// Correction of one sample at a time.
#[pyclass(name = "Compensator", module = "trueangle._core", frozen)]
pub struct PyCompensator {
    /// A step reads it without a lock, and ends with the series it began with.
    held: ArcSwap<Held>,
}

struct Held {
    inner: Compensator,
    series: Py<PySeries>,
}

impl Held {
    fn new(series: &Bound<'_, PySeries>) -> PyResult<Self> {
        let evaluator = Arc::clone(&series.get().evaluator);
        let inner = detached(series.py(), || Compensator::new(evaluator))??;
        Ok(Self {
            inner,
            series: series.clone().unbind(),
        })
    }
}

#[pymethods]
impl PyCompensator {
    #[new]
    fn new(series: &Bound<'_, PySeries>) -> PyResult<Self> {
        let evaluator = &series.get().evaluator;
        if !evaluator.is_ready(Quantity::Correction) {
            evaluator.room()?;
        }
        let held = ArcSwap::from_pointee(Held::new(series)?);
        Ok(Self { held })
    }

    /// A bound function of one float, cheaper to call than a method that PyO3 wraps.
    #[getter]
    fn step<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let definition = &raw const STEP.0;
        // SAFETY: the definition is static, and the function holds a reference to `slf`.
        unsafe {
            let function =
                ffi::PyCFunction_NewEx(definition.cast_mut(), slf.as_ptr(), std::ptr::null_mut());
            Bound::from_owned_ptr_or_err(slf.py(), function)
        }
    }

    /// Correct by another series from the next step on.
    fn swap(&self, series: &Bound<'_, PySeries>) -> PyResult<()> {
        // Made whole before it takes the place of the other.
        self.held.store(Arc::new(Held::new(series)?));
        Ok(())
    }

    /// What a call costs that does nothing: the limit that benchmarks compare `step` with.
    #[pyo3(signature = (indicated, /))]
    fn _empty_step(&self, indicated: f64) -> f64 {
        indicated
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> (Bound<'py, PyType>, (Py<PySeries>,)) {
        let series = slf.get().held.load().series.clone_ref(slf.py());
        (slf.get_type(), (series,))
    }
}

/// Definitions hold pointers, but nobody writes to this one.
pub struct Definition(pub ffi::PyMethodDef);

// SAFETY: read-only.
unsafe impl Sync for Definition {}

const DOCUMENTATION: &CStr = c"step(indicated, /, velocity=None, temperature=None, torque=None, \
direction=None, current=None)\n--\n\nThe true angle of an indicated one. Signals are taken, as by every \
model, and not needed.";

static STEP: Definition = Definition(ffi::PyMethodDef {
    ml_name: c"step".as_ptr(),
    ml_meth: ffi::PyMethodDefPointer {
        PyCFunctionFastWithKeywords: step,
    },
    ml_flags: ffi::METH_FASTCALL | ffi::METH_KEYWORDS,
    ml_doc: DOCUMENTATION.as_ptr(),
});

/// `Compensator.step`: nothing in it can panic.
///
/// # Safety
/// Called by the interpreter, attached, with the compensator the function is bound to.
unsafe extern "C" fn step(
    compensator: *mut ffi::PyObject,
    arguments: *const *mut ffi::PyObject,
    given: ffi::Py_ssize_t,
    keywords: *mut ffi::PyObject,
) -> *mut ffi::PyObject {
    unsafe {
        let py = Python::assume_attached();
        if (given != 1 || !keywords.is_null())
            && let Err(error) = check_arguments(py, given, keywords)
        {
            error.restore(py);
            return std::ptr::null_mut();
        }
        let indicated = *arguments;
        let angle = if ffi::PyFloat_CheckExact(indicated) != 0 {
            ffi::PyFloat_AsDouble(indicated)
        } else {
            match single(
                &Bound::from_borrowed_ptr(py, indicated),
                "the angle of a step",
            ) {
                Ok(angle) => angle,
                Err(error) => {
                    error.restore(py);
                    return std::ptr::null_mut();
                }
            }
        };
        let compensator = Bound::from_borrowed_ptr(py, compensator);
        let corrected = compensator
            .cast_unchecked::<PyCompensator>()
            .get()
            .held
            .load()
            .inner
            .step(angle);
        ffi::PyFloat_FromDouble(corrected)
    }
}

/// That there is an angle, and beside it nothing but signals.
#[cold]
fn check_arguments(
    py: Python<'_>,
    given: ffi::Py_ssize_t,
    keywords: *mut ffi::PyObject,
) -> PyResult<()> {
    if !(1..=1 + Signal::NAMED.len() as isize).contains(&given) {
        let problem = format!(
            "step takes an angle and up to {} signals, got {given} arguments",
            Signal::NAMED.len()
        );
        return Err(PyTypeError::new_err(problem));
    }
    if keywords.is_null() {
        return Ok(());
    }
    // SAFETY: a tuple of names, as the calling convention has it.
    let names: Vec<String> = unsafe { Bound::from_borrowed_ptr(py, keywords) }.extract()?;
    let is_known = |name: &str| Signal::named(name).is_some() || name.starts_with(OTHER);
    match names.iter().find(|name| !is_known(name)) {
        Some(name) => {
            let problem = format!("step got an unexpected keyword argument '{name}'");
            Err(PyTypeError::new_err(problem))
        }
        None => Ok(()),
    }
}
