//! Noise that is not white: its filter, and errors that are drawn by the run.

use nalgebra::{DMatrix, RealField};
use numpy::{
    Element, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArray,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use super::array::{data, empty};
use super::failure::argument_error;
use super::linear::{NOT_FINITE, told};
use super::release::detached;
use crate::check::same_length;
use crate::linear::{self, Correlated, Left, RunProducts};

/// Rows of either precision.
#[derive(FromPyObject)]
pub enum Rows<'py> {
    Double(PyReadonlyArray2<'py, f64>),
    Single(PyReadonlyArray2<'py, f32>),
}

type Bounds = Vec<(usize, usize)>;

/// Rows under the filter that makes noise of first-order correlation white, or its transpose.
#[pyfunction]
#[pyo3(signature = (rows, bounds, rho, roots=None, transposed=false))]
pub fn whitened<'py>(
    py: Python<'py>,
    rows: Rows<'py>,
    bounds: Bounds,
    rho: f64,
    roots: Option<PyReadonlyArray1<'py, f64>>,
    transposed: bool,
) -> PyResult<Bound<'py, PyUntypedArray>> {
    let noise = Correlated {
        bounds: &bounds,
        rho,
        roots: roots.as_ref().map(PyReadonlyArray1::as_slice).transpose()?,
    };
    match rows {
        Rows::Double(rows) => filtered(py, &rows, noise, transposed),
        Rows::Single(rows) => filtered(py, &rows, noise, transposed),
    }
}

fn filtered<'py, T: Element + RealField + Copy>(
    py: Python<'py>,
    rows: &PyReadonlyArray2<'py, T>,
    noise: Correlated<'_>,
    transposed: bool,
) -> PyResult<Bound<'py, PyUntypedArray>> {
    let &[n, columns] = rows.shape() else {
        unreachable!("two dimensions")
    };
    consecutive(py, n, &noise)?;
    let rows = rows.as_slice()?;
    let array = empty::<T>(py, &[n, columns], false)?;
    // SAFETY: a fresh contiguous array of this type and size.
    let out = unsafe { std::slice::from_raw_parts_mut(data::<T>(&array), rows.len()) };
    detached(py, || {
        if transposed {
            noise.filtered_back(rows, columns, out);
        } else {
            noise.filtered(rows, columns, out);
        }
    })?;
    Ok(array)
}

/// Runs follow each other from the first reading to the last.
fn consecutive(py: Python<'_>, n: usize, noise: &Correlated<'_>) -> PyResult<()> {
    if let Some(roots) = noise.roots {
        same_length("roots", roots.len(), "rows", n)?;
    }
    let mut at = 0;
    for &(start, stop) in noise.bounds {
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

/// Best ratio of variances of a run effect and the deviance that it saves; see
/// `linear::best_ratio`.
#[pyfunction]
pub fn best_ratio<'py>(
    py: Python<'py>,
    grams: PyReadonlyArray3<'py, f64>,
    moments: PyReadonlyArray3<'py, f64>,
    readings: f64,
    squares: f64,
) -> PyResult<(f64, f64)> {
    let (grams, moments) = (grams.as_array(), moments.as_array());
    let (runs, k, columns) = grams.dim();
    same_length("columns", columns, "rows", k)?;
    let (count, rows, fitted) = moments.dim();
    if (count, rows) != (runs, k) || fitted == 0 {
        let problem = format!("moments must have the shape ({runs}, {k}, fitted + 1)");
        return Err(argument_error(py, problem));
    }
    let parts: Vec<_> = (0..runs)
        .map(|r| RunProducts {
            gram: DMatrix::from_fn(k, k, |i, j| grams[(r, i, j)]),
            moments: DMatrix::from_fn(k, fitted, |i, j| moments[(r, i, j)]),
        })
        .collect();
    let left = Left { readings, squares };
    let found = detached(py, || linear::best_ratio(&parts, left))?;
    told(py, found, NOT_FINITE)
}
