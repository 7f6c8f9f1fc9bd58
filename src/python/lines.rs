//! Lines of any order: columns, sums, sums over units of readings.

use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::array::filled;
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
    if single {
        return filled::<f32>(py, &shape, |out| {
            Ok(detached(py, || lines::columns(theta, orders, out))??)
        });
    }
    filled::<f64>(py, &shape, |out| {
        Ok(detached(py, || {
            lines::columns(theta, orders, out)?;
            if vanishing > 0.0 {
                lines::vanished(orders, vanishing, out);
            }
            Ok::<_, Error>(())
        })??)
    })
}

/// Sum of lines at every angle.
#[pyfunction]
pub fn line_sum<'py>(
    py: Python<'py>,
    theta: PyReadonlyArray1<'py, f64>,
    orders: PyReadonlyArray1<'py, f64>,
    cosine: PyReadonlyArray1<'py, f64>,
    sine: PyReadonlyArray1<'py, f64>,
) -> PyResult<Bound<'py, PyUntypedArray>> {
    let (theta, orders) = (theta.as_slice()?, orders.as_slice()?);
    let (cosine, sine) = (cosine.as_slice()?, sine.as_slice()?);
    let lines = Lines {
        orders,
        cosine,
        sine,
    };
    filled(py, &[theta.len()], |out| {
        Ok(detached(py, || lines::sum(theta, lines, out))??)
    })
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
    filled(py, &[2, n], |out| {
        let (value, slope) = out.split_at_mut(n);
        Ok(detached(py, || {
            lines::sum_and_slope(theta, lines, value, slope)
        })??)
    })
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
    let orders = Ladder { first, step, count };
    filled(py, &shape, |out| {
        Ok(detached(py, || {
            ladder::unit_sums(theta, values, &starts, orders, out)
        })??)
    })
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
) -> PyResult<Bound<'py, PyUntypedArray>> {
    let n = frequency.shape()[0];
    let (waves, frequency) = (waves.as_slice()?, frequency.as_slice()?);
    same_length("waves", waves.len(), "2 * frequency", 2 * frequency.len())?;
    filled(py, &[n], |out| {
        detached(py, || lag::lagged(waves, frequency, cutoff, damping, out))
    })
}
