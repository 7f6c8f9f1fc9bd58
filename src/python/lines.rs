//! Lines of any order: columns, sums, sums over units of readings.

use numpy::{PyArray1, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::array::{data, empty};
use super::failure::argument_error;
use super::release::detached;
use crate::check::same_length;
use crate::error::Error;
use crate::kernel::ladder::{self, Ladder};
use crate::kernel::lag;
use crate::kernel::lines::{self, Lines};

/// Cosines and sines of orders times angles, shape (n, 2 orders); in single precision where
/// that is enough. In double precision a column that is below `vanishing` times its order at every
/// reading is zeros.
#[pyfunction]
#[pyo3(signature = (theta, orders, single = false, vanishing = 0.0))]
pub fn line_columns<'py>(
    py: Python<'py>,
    theta: PyReadonlyArray1<'py, f64>,
    orders: PyReadonlyArray1<'py, f64>,
    single: bool,
    vanishing: f64,
) -> PyResult<Bound<'py, PyUntypedArray>> {
    let (theta, orders) = (theta.as_slice()?, orders.as_slice()?);
    let shape = [theta.len(), 2 * orders.len()];
    let size = shape[0] * shape[1];
    // SAFETY: of both, a fresh contiguous array of this type and size.
    if single {
        let array = empty::<f32>(py, &shape, false)?;
        let out = unsafe { std::slice::from_raw_parts_mut(data::<f32>(&array), size) };
        detached(py, || lines::columns(theta, orders, out))??;
        return Ok(array);
    }
    let array = empty::<f64>(py, &shape, false)?;
    let out = unsafe { std::slice::from_raw_parts_mut(data::<f64>(&array), size) };
    detached(py, || {
        lines::columns(theta, orders, out)?;
        if vanishing > 0.0 {
            lines::vanished(orders, vanishing, out);
        }
        Ok::<_, Error>(())
    })??;
    Ok(array)
}

/// Sum of lines at every angle.
#[pyfunction]
pub fn line_sum<'py>(
    py: Python<'py>,
    theta: PyReadonlyArray1<'py, f64>,
    orders: PyReadonlyArray1<'py, f64>,
    cosine: PyReadonlyArray1<'py, f64>,
    sine: PyReadonlyArray1<'py, f64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let (theta, orders) = (theta.as_slice()?, orders.as_slice()?);
    let (cosine, sine) = (cosine.as_slice()?, sine.as_slice()?);
    let array = empty::<f64>(py, &[theta.len()], false)?;
    // SAFETY: a fresh contiguous array of this type and size.
    let out = unsafe { std::slice::from_raw_parts_mut(data::<f64>(&array), theta.len()) };
    let lines = Lines {
        orders,
        cosine,
        sine,
    };
    detached(py, || lines::sum(theta, lines, out))??;
    Ok(array.into_any().cast_into()?)
}

/// `line_sum` and its derivative, shape (2, n).
#[pyfunction]
pub fn line_sum_and_slope<'py>(
    py: Python<'py>,
    theta: PyReadonlyArray1<'py, f64>,
    orders: PyReadonlyArray1<'py, f64>,
    cosine: PyReadonlyArray1<'py, f64>,
    sine: PyReadonlyArray1<'py, f64>,
) -> PyResult<Bound<'py, PyUntypedArray>> {
    let theta = theta.as_slice()?;
    let lines = Lines {
        orders: orders.as_slice()?,
        cosine: cosine.as_slice()?,
        sine: sine.as_slice()?,
    };
    let n = theta.len();
    let array = empty::<f64>(py, &[2, n], false)?;
    // SAFETY: a fresh contiguous array of this type and size.
    let out = unsafe { std::slice::from_raw_parts_mut(data::<f64>(&array), 2 * n) };
    let (value, slope) = out.split_at_mut(n);
    detached(py, || lines::sum_and_slope(theta, lines, value, slope))??;
    Ok(array)
}

/// Sums of values times `exp(-i order angle)` over units, real and imaginary parts, shape
/// (count, units, 2 columns), for orders `first`, `first + step` ...
#[pyfunction]
pub fn unit_sums<'py>(
    py: Python<'py>,
    theta: PyReadonlyArray1<'py, f64>,
    values: PyReadonlyArray2<'py, f64>,
    starts: Vec<usize>,
    first: f64,
    step: f64,
    count: usize,
) -> PyResult<Bound<'py, PyUntypedArray>> {
    let theta = theta.as_slice()?;
    let columns = values.as_array().nrows();
    let values = values.as_slice()?;
    if values.len() != columns * theta.len() {
        let got = values.len() / columns.max(1);
        return Err(argument_error(
            py,
            format!("values must have {} readings a row, got {got}", theta.len()),
        ));
    }
    let shape = [count, starts.len(), 2 * columns];
    let array = empty::<f64>(py, &shape, false)?;
    let size = shape.iter().product();
    // SAFETY: a fresh contiguous array of this type and size.
    let out = unsafe { std::slice::from_raw_parts_mut(data::<f64>(&array), size) };
    let orders = Ladder { first, step, count };
    detached(py, || {
        ladder::unit_sums(theta, values, &starts, orders, out)
    })??;
    Ok(array)
}

/// Change of lines by a low-pass of a cutoff and, of second order, a damping: of every reading.
/// `waves` are real and imaginary parts side by side, shape (n, 2 lines).
#[pyfunction]
#[pyo3(signature = (waves, frequency, cutoff, damping=None))]
pub fn lagged<'py>(
    py: Python<'py>,
    waves: PyReadonlyArray2<'py, f64>,
    frequency: PyReadonlyArray2<'py, f64>,
    cutoff: f64,
    damping: Option<f64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let n = frequency.shape()[0];
    let (waves, frequency) = (waves.as_slice()?, frequency.as_slice()?);
    same_length("waves", waves.len(), "2 * frequency", 2 * frequency.len())?;
    let array = empty::<f64>(py, &[n], false)?;
    // SAFETY: a fresh contiguous array of this type and size.
    let out = unsafe { std::slice::from_raw_parts_mut(data::<f64>(&array), n) };
    detached(py, || lag::lagged(waves, frequency, cutoff, damping, out))?;
    Ok(array.into_any().cast_into()?)
}
