//! Noise that is not white, and readings that are wild: filter, medians, outliers clipped.

use nalgebra::RealField;
use numpy::{
    Element, PyArray1, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use super::array::{filled, vector};
use super::failure::argument_error;
use super::release::detached;
use crate::check::same_length;
use crate::linear::{self, Correlated};
use crate::mixture;
use crate::spectrum;

/// Rows of either precision.
#[derive(FromPyObject)]
pub enum Rows<'py> {
    Double(PyReadonlyArray2<'py, f64>),
    Single(PyReadonlyArray2<'py, f32>),
}

type Three<'py> = (
    Bound<'py, PyUntypedArray>,
    Bound<'py, PyUntypedArray>,
    Bound<'py, PyUntypedArray>,
);
type Values<'py, T> = Bound<'py, PyArray1<T>>;
pub(super) type Bounds = Vec<(usize, usize)>;

/// Products of columns within blocks of so many: at one reading, at those that neither begin nor
/// end a run, and with the reading before, each of shape (blocks, width, width).
#[pyfunction]
#[pyo3(signature = (columns, width, bounds, roots=None))]
pub fn block_products<'py>(
    py: Python<'py>,
    columns: Rows<'py>,
    width: usize,
    bounds: Bounds,
    roots: Option<PyReadonlyArray1<'py, f64>>,
) -> PyResult<Three<'py>> {
    let noise = Correlated {
        bounds: &bounds,
        rho: 0.0,
        roots: roots.as_ref().map(PyReadonlyArray1::as_slice).transpose()?,
    };
    match columns {
        Rows::Double(columns) => products(py, &columns, width, noise),
        Rows::Single(columns) => products(py, &columns, width, noise),
    }
}

fn products<'py, T: Element + RealField + Copy + Into<f64>>(
    py: Python<'py>,
    x: &PyReadonlyArray2<'py, T>,
    width: usize,
    noise: Correlated<'_>,
) -> PyResult<Three<'py>> {
    let &[n, columns] = x.shape() else {
        unreachable!("two dimensions")
    };
    weighted(py, n, noise.bounds, noise.roots)?;
    if width == 0 || columns % width != 0 {
        let problem = format!("width must divide the {columns} columns, got {width}");
        return Err(argument_error(py, problem));
    }
    let x = x.as_slice()?;
    let found = detached(py, || linear::block_products(noise, x, columns, width))?;
    let shaped = |values: &[f64]| -> PyResult<_> {
        filled::<f64>(py, &[columns / width, width, width], |out| {
            out.copy_from_slice(values);
            Ok(())
        })
    };
    Ok((
        shaped(&found.same)?,
        shaped(&found.inner)?,
        shaped(&found.cross)?,
    ))
}

/// A narrow and a wide normal distribution about zero by steps of expectation-maximisation from a
/// size of the wide one: log-likelihood but for `n ln(2 pi)/2`, share and relative size of the wide
/// part, scale of the narrow one.
#[pyfunction]
pub fn two_normals(
    py: Python<'_>,
    values: PyReadonlyArray1<'_, f64>,
    start: f64,
    steps: usize,
    narrowest: f64,
) -> PyResult<(f64, f64, f64, f64)> {
    let values = values.as_slice()?;
    let found = detached(py, || mixture::two_normals(values, start, steps, narrowest))?;
    Ok((found.value, found.share, found.size, found.scale))
}

/// As [`consecutive`]; the readings have a root of a weight each, if any.
pub(super) fn weighted(
    py: Python<'_>,
    n: usize,
    bounds: &[(usize, usize)],
    roots: Option<&[f64]>,
) -> PyResult<()> {
    if let Some(roots) = roots {
        same_length("roots", roots.len(), "rows", n)?;
    }
    consecutive(py, n, bounds)
}

/// Runs follow each other from the first reading to the last.
pub(super) fn consecutive(py: Python<'_>, n: usize, bounds: &[(usize, usize)]) -> PyResult<()> {
    let mut at = 0;
    for &(start, stop) in bounds {
        if start != at || stop < start {
            break;
        }
        at = stop;
    }
    if at == n {
        return Ok(());
    }
    let problem = format!("bounds must be runs one after the other, of {n} readings in all");
    Err(argument_error(py, problem))
}

/// What a fit leaves, outliers clipped at `most` standard deviations, that of a reading being
/// `least` at least; readings to match; which are outlying.
#[pyfunction]
#[pyo3(signature = (readings, left, roots, most, least = 0.0))]
pub fn clipped<'py>(
    py: Python<'py>,
    readings: PyReadonlyArray1<'py, f64>,
    left: PyReadonlyArray1<'py, f64>,
    roots: PyReadonlyArray1<'py, f64>,
    most: f64,
    least: f64,
) -> PyResult<(Values<'py, f64>, Values<'py, f64>, Values<'py, bool>)> {
    same_length("left", left.len(), "readings", readings.len())?;
    same_length("roots", roots.len(), "readings", readings.len())?;
    let (readings, left, roots) = (readings.as_slice()?, left.as_slice()?, roots.as_slice()?);
    let found = detached(py, || linear::clipped(readings, left, roots, most, least))?;
    let (kept, target) = (vector(py, &found.kept)?, vector(py, &found.target)?);
    Ok((kept, target, vector(py, &found.outlying)?))
}

/// Expected errors of readings rounded to whole steps, of which a fit leaves `left`: each, the sum
/// of their squares, and the logarithm of the likelihood.
#[pyfunction]
pub fn rounded<'py>(
    py: Python<'py>,
    left: PyReadonlyArray1<'py, f64>,
    step: f64,
    sigma: f64,
) -> PyResult<(Values<'py, f64>, f64, f64)> {
    positive(py, step, sigma)?;
    let left = left.as_slice()?;
    let found = detached(py, || crate::rounded::rounded(left, step, sigma))?;
    let error = vector(py, &found.error)?;
    Ok((error, found.squares, found.log_likelihood))
}

/// Errors drawn among those that the steps of rounded readings allow, at these shares of the chance.
#[pyfunction]
pub fn rounded_drawn<'py>(
    py: Python<'py>,
    left: PyReadonlyArray1<'py, f64>,
    step: f64,
    sigma: f64,
    shares: PyReadonlyArray1<'py, f64>,
) -> PyResult<Values<'py, f64>> {
    positive(py, step, sigma)?;
    same_length("shares", shares.len(), "left", left.len())?;
    let (left, shares) = (left.as_slice()?, shares.as_slice()?);
    let found = detached(py, || crate::rounded::drawn(left, step, sigma, shares))?;
    vector(py, &found)
}

fn positive(py: Python<'_>, step: f64, sigma: f64) -> PyResult<()> {
    if step > 0.0 && sigma > 0.0 {
        return Ok(());
    }
    let problem = format!("step and sigma must be above zero, not {step} and {sigma}");
    Err(argument_error(py, problem))
}

/// The mean of the two middle values, or the middle one; NaN where a value is.
#[pyfunction]
pub fn median(py: Python<'_>, values: PyReadonlyArray1<'_, f64>) -> PyResult<f64> {
    let mut values: Vec<f64> = values.as_array().iter().copied().collect();
    if values.iter().any(|value| value.is_nan()) {
        return Ok(f64::NAN);
    }
    detached(py, || spectrum::median(&mut values))
}
