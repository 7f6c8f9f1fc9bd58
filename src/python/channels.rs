//! Two channels of a sensor: their curve, their angle, one sample of both at a time.

use std::ffi::CStr;
use std::sync::Arc;

use numpy::{PyArray2, PyReadonlyArray1, PyUntypedArray};
use pyo3::ffi;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use super::array::{columns, filled, square, values, vector};
use super::number::single;
use super::release::detached;
use super::series::PySeries;
use super::step::{Definition, check_arguments};
use crate::channels::{self, Angle, Curve, Decoder, Off, Readings};
use crate::check::same_length;
use crate::compensator::Compensator;

/// The curve of two channels, from orders and parameters of another one on: parameters, covariance,
/// phases, residuals, and shares of the cosine's noise in them; None where the readings do not settle
/// it.
#[pyfunction]
#[pyo3(signature = (sine, cosine, weights, variances, orders, start=None))]
pub fn fit_curve<'py>(
    py: Python<'py>,
    sine: PyReadonlyArray1<'_, f64>,
    cosine: PyReadonlyArray1<'_, f64>,
    weights: PyReadonlyArray1<'_, f64>,
    variances: [f64; 2],
    orders: Vec<u32>,
    start: Option<(Vec<u32>, Vec<f64>)>,
) -> PyResult<Option<Bound<'py, PyTuple>>> {
    let (sine, cosine, weights) = (values(&sine), values(&cosine), values(&weights));
    let start = start.map(|(orders, parameters)| Curve { orders, parameters });
    let readings = Readings {
        sine: &sine,
        cosine: &cosine,
        weights: &weights,
        variances,
    };
    let Some(found) = detached(py, || channels::fit(readings, &orders, start.as_ref()))?? else {
        return Ok(None);
    };
    let parameters = found.curve.parameters;
    let covariance = square(py, &found.covariance, parameters.len())?;
    let [first, phases, residuals, shares] =
        [&parameters, &found.phases, &found.residuals, &found.shares].map(|v| vector(py, v));
    let parts = (first?, covariance, phases?, residuals?, shares?);
    Ok(Some(parts.into_pyobject(py)?))
}

/// Derivatives of the decoded angle by the parameters of a curve, a column for each phase.
#[pyfunction]
pub fn curve_slopes<'py>(
    py: Python<'py>,
    orders: Vec<u32>,
    parameters: Vec<f64>,
    phases: PyReadonlyArray1<'_, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let phases = values(&phases);
    let shape = [parameters.len(), phases.len()];
    let curve = Curve { orders, parameters };
    let rows = detached(py, || channels::angle_slopes(&curve, &phases))?;
    columns(py, &rows, &shape)
}

/// Flags of every reading (1: the sine is at its rail, 2: the cosine, 4: off the curve), the codes
/// after which either channel wraps, and the ellipse of the readings without a flag.
#[pyfunction]
pub fn channel_faults<'py>(
    py: Python<'py>,
    sine: PyReadonlyArray1<'_, f64>,
    cosine: PyReadonlyArray1<'_, f64>,
) -> PyResult<Bound<'py, PyTuple>> {
    let (sine, cosine) = (values(&sine), values(&cosine));
    let (found, wraps) = detached(py, || {
        let wraps = [&sine, &cosine].map(|channel| channels::wraps_at(channel));
        (channels::faults(&sine, &cosine), wraps)
    })?;
    let (flags, curve) = found?;
    (vector(py, &flags)?, wraps, curve.map(|c| c.parameters)).into_pyobject(py)
}

/// First readings of the periods of an excitation and their number, sine and cosine over it, and their
/// phase against it in radians; None without periods.
#[pyfunction]
#[pyo3(signature = (excitation, sine, cosine, phase=None))]
pub fn demodulate<'py>(
    py: Python<'py>,
    excitation: PyReadonlyArray1<'_, f64>,
    sine: PyReadonlyArray1<'_, f64>,
    cosine: PyReadonlyArray1<'_, f64>,
    phase: Option<f64>,
) -> PyResult<Option<Bound<'py, PyTuple>>> {
    let (carrier, sine, cosine) = (values(&excitation), values(&sine), values(&cosine));
    let found = detached(py, || channels::demodulate(&carrier, &sine, &cosine, phase))??;
    let Some(found) = found else { return Ok(None) };
    let (sine, cosine) = (vector(py, &found.sine)?, vector(py, &found.cosine)?);
    let starts = vector(py, &found.starts)?;
    let parts = (starts, sine, cosine, found.phase);
    Ok(Some(parts.into_pyobject(py)?))
}

/// The angle of two channels and its correction.
#[pyclass(name = "Decoder", module = "trueangle._core", frozen)]
pub struct PyDecoder {
    inner: Decoder,
    constants: [f64; 6],
    series: Option<Py<PySeries>>,
}

#[pymethods]
impl PyDecoder {
    #[new]
    #[pyo3(signature = (constants, series=None))]
    fn new(constants: [f64; 6], series: Option<&Bound<'_, PySeries>>) -> PyResult<Self> {
        let [
            offset_cosine,
            offset_sine,
            per_cosine,
            per_sine,
            slope,
            factor,
        ] = constants;
        let angle = Angle {
            offset_cosine,
            offset_sine,
            per_cosine,
            per_sine,
            slope,
            factor,
        };
        let correction = match series {
            Some(series) => {
                let evaluator = Arc::clone(&series.get().evaluator);
                Some(detached(series.py(), || Compensator::new(evaluator))??)
            }
            None => None,
        };
        Ok(Self {
            inner: Decoder { angle, correction },
            constants,
            series: series.map(|s| s.clone().unbind()),
        })
    }

    /// Angles of many readings, before the correction.
    fn angles<'py>(
        &self,
        py: Python<'py>,
        sine: PyReadonlyArray1<'_, f64>,
        cosine: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<Bound<'py, PyUntypedArray>> {
        let (sine, cosine) = (values(&sine), values(&cosine));
        same_length("cosine", cosine.len(), "sine", sine.len())?;
        filled(py, &[sine.len()], |out| {
            detached(py, || self.inner.angle.all(&sine, &cosine, out))
        })
    }

    /// How readings are off the circle of the constants: their count, squares of the distances in
    /// radii, the same with sine and cosine exchanged, dropouts, then sums of both channels without
    /// their offsets, of the squares and the product; and the first dropout.
    fn off(
        &self,
        sine: PyReadonlyArray1<'_, f64>,
        cosine: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<([f64; 9], Option<usize>)> {
        let (sine, cosine) = (values(&sine), values(&cosine));
        same_length("cosine", cosine.len(), "sine", sine.len())?;
        let Off {
            count,
            squares: [off, exchanged],
            sums: [a, b, c, d, e],
            far,
            first,
        } = self.inner.angle.off(&sine, &cosine);
        Ok((
            [count as f64, off, exchanged, far as f64, a, b, c, d, e],
            first,
        ))
    }

    /// A bound function of two floats, cheaper to call than a method that PyO3 wraps.
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

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> (Bound<'py, PyAny>, Parts) {
        let own = slf.get();
        let series = own.series.as_ref().map(|s| s.clone_ref(slf.py()));
        (slf.get_type().into_any(), (own.constants, series))
    }
}

/// The constructor's arguments.
type Parts = ([f64; 6], Option<Py<PySeries>>);

const DOCUMENTATION: &CStr = c"step(sine, cosine, /, velocity=None, temperature=None, torque=None, \
direction=None, current=None)\n--\n\nThe corrected angle of two channels. Signals are taken, as by every \
model, and not needed.";

static STEP: Definition<ffi::PyMethodDef> = Definition(ffi::PyMethodDef {
    ml_name: c"step".as_ptr(),
    ml_meth: ffi::PyMethodDefPointer {
        PyCFunctionFastWithKeywords: step,
    },
    ml_flags: ffi::METH_FASTCALL | ffi::METH_KEYWORDS,
    ml_doc: DOCUMENTATION.as_ptr(),
});

/// `Decoder.step`: nothing in it can panic.
///
/// # Safety
/// Called by the interpreter, attached, with the decoder the function is bound to.
unsafe extern "C" fn step(
    decoder: *mut ffi::PyObject,
    arguments: *const *mut ffi::PyObject,
    given: ffi::Py_ssize_t,
    keywords: *mut ffi::PyObject,
) -> *mut ffi::PyObject {
    unsafe {
        let py = Python::assume_attached();
        if (given != 2 || !keywords.is_null())
            && let Err(error) =
                check_arguments(py, given as usize, keywords, (2, "a sine, a cosine"))
        {
            error.restore(py);
            return std::ptr::null_mut();
        }
        let (sine, cosine) = (*arguments, *arguments.add(1));
        let are_floats = ffi::PyFloat_CheckExact(sine) != 0 && ffi::PyFloat_CheckExact(cosine) != 0;
        let (sine, cosine) = if are_floats {
            (ffi::PyFloat_AsDouble(sine), ffi::PyFloat_AsDouble(cosine))
        } else {
            let one = |value, what| single(&Bound::from_borrowed_ptr(py, value), what);
            let sine = one(sine, "the sine of a step");
            match sine.and_then(|sine| Ok((sine, one(cosine, "the cosine of a step")?))) {
                Ok(channels) => channels,
                Err(error) => {
                    error.restore(py);
                    return std::ptr::null_mut();
                }
            }
        };
        let decoder = Bound::from_borrowed_ptr(py, decoder);
        let decoder = &decoder.cast_unchecked::<PyDecoder>().get().inner;
        ffi::PyFloat_FromDouble(decoder.step(sine, cosine))
    }
}
