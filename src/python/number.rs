//! Numbers: what a single sample may be, and options that are numbers.

use std::ops::RangeInclusive;

use numpy::{PyUntypedArray, PyUntypedArrayMethods};
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyFloat, PyInt};

use super::array::numpy_module;
use super::failure::{argument_error, kind_error};

/// True for Python's own float and int (numpy.float64 is a float).
pub fn is_number(x: &Bound<'_, PyAny>) -> bool {
    x.is_instance_of::<PyFloat>() || (x.is_instance_of::<PyInt>() && !x.is_instance_of::<PyBool>())
}

/// The value of one.
pub fn value_of(x: &Bound<'_, PyAny>, what: &str) -> PyResult<f64> {
    x.extract::<f64>().map_err(|_| {
        let problem = format!("{what} must be within the range of doubles, got {x}");
        argument_error(x.py(), problem)
    })
}

/// One sample: a number, or what numpy takes for a single one. Arrays, truth values, text
/// and numbers of other kinds are refused, as by batches.
pub fn single(x: &Bound<'_, PyAny>, what: &str) -> PyResult<f64> {
    if is_number(x) {
        return value_of(x, what);
    }
    let py = x.py();
    let refuse = || {
        let kind = x.get_type().name()?;
        let problem = format!("{what} must be one real number, got {x} of type {kind}");
        Err(kind_error(py, problem))
    };
    if x.is_instance(&numpy_module(py)?.getattr(intern!(py, "generic"))?)?
        || x.cast::<PyUntypedArray>()
            .is_ok_and(|array| array.ndim() == 0)
    {
        let dtype = x.getattr(intern!(py, "dtype"))?;
        let kind: char = dtype.getattr(intern!(py, "kind"))?.extract()?;
        if "fiu".contains(kind) {
            return value_of(&x.call_method0(intern!(py, "item"))?, what);
        }
    }
    refuse()
}

/// Lists of orders, one per shaft.
pub fn orders(lists: &Bound<'_, PyAny>) -> PyResult<Vec<Vec<u32>>> {
    lists.extract().map_err(|_| {
        let most = u32::MAX;
        let problem =
            format!("orders must be lists of whole numbers from 1 to {most}, one per shaft");
        argument_error(lists.py(), problem)
    })
}

/// A whole number that an option may be, or an error that says what is `wanted`.
pub fn whole(x: &Bound<'_, PyAny>, limits: RangeInclusive<usize>, wanted: &str) -> PyResult<usize> {
    if let Ok(n) = x.extract::<usize>()
        && !x.is_instance_of::<PyBool>()
        && limits.contains(&n)
    {
        return Ok(n);
    }
    let error = if is_number(x) {
        argument_error
    } else {
        kind_error
    };
    Err(error(x.py(), format!("{wanted}, got {x}")))
}
