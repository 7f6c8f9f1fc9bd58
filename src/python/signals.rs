//! Signals of a correction as the caller gives them: arrays, sequences, one value for all.

use numpy::{PyArrayDescrMethods, PyArrayDyn, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use super::angles::Angles;
use super::array::{as_array, data, numpy_module, shown};
use super::failure::{argument_error, kind_error};
use crate::terms::{Columns, Signal};

/// A signal and its values.
pub type Taken<'py> = (Signal, Bound<'py, PyUntypedArray>);

/// What signals hold, for the core.
pub fn columns<'a>(signals: &'a [Taken<'_>]) -> Columns<'a> {
    signals
        .iter()
        .fold(Columns::default(), |columns, (signal, values)| {
            columns.with(*signal, doubles(values))
        })
}

/// The values of what [`as_signal`] made.
pub fn doubles<'a>(values: &'a Bound<'_, PyUntypedArray>) -> &'a [f64] {
    // SAFETY: a contiguous array of doubles that is kept while the slice is used.
    unsafe { std::slice::from_raw_parts(data::<f64>(values), values.len()) }
}

/// A signal as doubles in the order they were taken; one value stays one.
pub fn as_signal<'py>(
    given: &Bound<'py, PyAny>,
    name: &str,
) -> PyResult<Bound<'py, PyUntypedArray>> {
    let py = given.py();
    let (array, _) = as_array(given, name)?;
    let dtype = array.dtype();
    if !matches!(dtype.kind(), b'f' | b'i' | b'u') {
        let problem = format!("{name} must be real numbers, got an array of dtype {dtype}");
        return Err(kind_error(py, problem));
    }
    in_order(&array)
}

/// Contiguous doubles in C order.
pub fn in_order<'py>(array: &Bound<'py, PyUntypedArray>) -> PyResult<Bound<'py, PyUntypedArray>> {
    let py = array.py();
    if let Ok(doubles) = array.cast::<PyArrayDyn<f64>>()
        && doubles.is_c_contiguous()
        && array.is_aligned()
    {
        return Ok(array.clone());
    }
    let made = numpy_module(py)?.call_method1(
        intern!(py, "ascontiguousarray"),
        (array, intern!(py, "float64")),
    )?;
    Ok(made.cast_into()?)
}

/// Angles and signals of one shape.
pub fn broadcast<'py>(x: &Bound<'py, PyAny>, signals: &mut [Taken<'py>]) -> PyResult<Angles<'py>> {
    let py = x.py();
    let (given, labels) = match x.cast_exact::<PyUntypedArray>() {
        Ok(array) => (array.clone(), None),
        Err(_) => as_array(x, "angles")?,
    };
    let fits = |(_, values): &Taken<'py>| {
        values.shape() == given.shape() || (values.len() == 1 && values.ndim() == 0)
    };
    if signals.iter().all(fits) {
        return Angles::of_array(given, labels, true);
    }
    let numpy = numpy_module(py)?;
    let shapes: Vec<_> = std::iter::once(&given)
        .chain(signals.iter().map(|(_, values)| values))
        .map(|array| PyTuple::new(py, array.shape()))
        .collect::<PyResult<_>>()?;
    let shape = numpy
        .call_method1(intern!(py, "broadcast_shapes"), PyTuple::new(py, &shapes)?)
        .map_err(|_| {
            let others: Vec<_> = signals
                .iter()
                .map(|(signal, values)| format!("{} {}", signal.name(), shown(values.shape())))
                .collect();
            let (own, others) = (shown(given.shape()), others.join(", "));
            let problem = format!(
                "signals must have the shape of the angles {own} or one value, got {others}"
            );
            argument_error(py, problem)
        })?;
    let spread = |array: &Bound<'py, PyUntypedArray>| -> PyResult<Bound<'py, PyUntypedArray>> {
        let spread = numpy.call_method1(intern!(py, "broadcast_to"), (array, &shape))?;
        Ok(spread.cast_into()?)
    };
    for (_, values) in signals.iter_mut() {
        if values.len() != 1 {
            *values = in_order(&spread(values)?)?;
        }
    }
    let wide = spread(&given)?;
    let labels = labels.filter(|_| wide.shape() == given.shape());
    Angles::of_array(wide, labels, true)
}
