//! Harmonics of many angles, and banded systems.

use numpy::PyUntypedArrayMethods;
use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArray1, PyReadwriteArray2};
use pyo3::prelude::*;

use super::release::{attached, detached};
use crate::banded::{BAND, Factor};
use crate::check::same_length;
use crate::waves::{self, Answer};

type Vector<'py> = PyReadonlyArray1<'py, f64>;

fn answer<'a>(
    factor: &'a Option<Vector<'_>>,
    lead: &'a Option<Vector<'_>>,
) -> PyResult<Answer<'a>> {
    let slice = |values: &'a Option<Vector<'_>>| -> PyResult<Option<&'a [f64]>> {
        Ok(values
            .as_ref()
            .map(PyReadonlyArray1::as_slice)
            .transpose()?)
    };
    Ok(Answer {
        factor: slice(factor)?,
        lead: slice(lead)?,
    })
}

/// Cosine and sine of each order in turn, into the rows of `out`.
#[pyfunction]
#[pyo3(signature = (theta, orders, out, factor=None, lead=None))]
pub fn harmonic_rows(
    py: Python<'_>,
    theta: Vector<'_>,
    orders: Vec<u32>,
    mut out: PyReadwriteArray2<'_, f64>,
    factor: Option<Vector<'_>>,
    lead: Option<Vector<'_>>,
) -> PyResult<()> {
    let (theta, answer) = (theta.as_slice()?, answer(&factor, &lead)?);
    let out = out.as_slice_mut()?;
    Ok(detached(py, || waves::rows(theta, &orders, answer, out))??)
}

/// The sum of those rows, each times its coefficient, into `out`.
#[pyfunction]
#[pyo3(signature = (theta, orders, coefficients, out, factor=None, lead=None))]
pub fn harmonic_sum(
    py: Python<'_>,
    theta: Vector<'_>,
    orders: Vec<u32>,
    coefficients: Vector<'_>,
    mut out: PyReadwriteArray1<'_, f64>,
    factor: Option<Vector<'_>>,
    lead: Option<Vector<'_>>,
) -> PyResult<()> {
    let (theta, answer) = (theta.as_slice()?, answer(&factor, &lead)?);
    let (coefficients, out) = (coefficients.as_slice()?, out.as_slice_mut()?);
    Ok(detached(py, || {
        waves::sum(theta, &orders, coefficients, answer, out)
    })??)
}

/// Cholesky factor of a symmetric matrix of four diagonals.
#[pyclass(name = "Banded", module = "trueangle._core", frozen)]
pub struct PyBanded(Factor);

#[pymethods]
impl PyBanded {
    /// None where the matrix is not positive definite.
    #[staticmethod]
    fn factor(py: Python<'_>, bands: PyReadonlyArray2<'_, f64>) -> PyResult<Option<Self>> {
        same_length("bands", bands.shape()[1], "diagonals", BAND)?;
        let bands = bands.as_slice()?;
        Ok(attached(py, || Factor::new(bands))?.map(Self))
    }

    #[getter]
    fn log_determinant(&self) -> f64 {
        self.0.log_determinant
    }

    /// Right-hand sides, in columns, become their solutions.
    fn solve(&self, py: Python<'_>, mut right: PyReadwriteArray2<'_, f64>) -> PyResult<()> {
        let width = right.shape()[1];
        let right = right.as_slice_mut()?;
        Ok(attached(py, || self.0.solve(width, right))??)
    }
}
