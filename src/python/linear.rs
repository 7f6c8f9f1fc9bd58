//! `_core.LinearModel` and what groups of readings say by their sums.

use nalgebra::{DMatrix, DVector};
use numpy::{
    PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods,
};
use pyo3::exceptions::PyValueError;
use pyo3::intern;
use pyo3::prelude::*;

use super::array::{numpy_module, vector};
use super::release::detached;
use crate::check::same_length;
use crate::interrupt;
use crate::linear::{self, Fold, LinearModel, Sums};
use crate::lstsq::{Reduction, Triangle};

type Matrix<'py> = Bound<'py, PyArray2<f64>>;

/// Rows reduced at a time: enough to hide the triangle above them, few enough for the cache.
const BLOCK_ROWS: usize = 512;

/// Least squares of one design for some targets.
#[pyclass(name = "LinearModel", module = "trueangle._core", frozen)]
pub struct PyLinearModel(LinearModel);

#[pymethods]
impl PyLinearModel {
    /// From rows of the design and of the targets, and a weight for each.
    #[staticmethod]
    #[pyo3(signature = (design, targets, weights=None))]
    fn of_rows(
        py: Python<'_>,
        design: PyReadonlyArray2<'_, f64>,
        targets: PyReadonlyArray2<'_, f64>,
        weights: Option<PyReadonlyArray1<'_, f64>>,
    ) -> PyResult<Self> {
        let (design, targets) = (design.as_array(), targets.as_array());
        let weights = weights.as_ref().map(PyReadonlyArray1::as_array);
        same_length("targets", targets.nrows(), "design", design.nrows())?;
        if let Some(weights) = &weights {
            same_length("weights", weights.len(), "design", design.nrows())?;
        }
        let columns = design.ncols() + targets.ncols();
        let found = detached(py, || {
            let mut reduction = Reduction::default();
            let mut rows = Vec::with_capacity(columns * BLOCK_ROWS.min(design.nrows()));
            for (i, (row, target)) in design.rows().into_iter().zip(targets.rows()).enumerate() {
                let root = weights.as_ref().map_or(1.0, |weights| weights[i].sqrt());
                rows.extend(row.iter().chain(target.iter()).map(|value| root * value));
                if rows.len() == columns * BLOCK_ROWS {
                    interrupt::point();
                    reduction.push(Triangle::of_rows(columns, &rows));
                    rows.clear();
                }
            }
            if columns > 0 {
                reduction.push(Triangle::of_rows(columns, &rows));
            }
            let triangle = reduction.finish().unwrap_or_else(|| Triangle::new(columns));
            LinearModel::of_rows(&triangle, targets.ncols())
        })?;
        Ok(Self(told(py, found, NOT_FINITE)?))
    }

    /// From sums of products: `X' W X`, `X' W y` and `y' W y` of every target.
    #[staticmethod]
    #[pyo3(signature = (gram, moments, squares, lengths=None, floor=None))]
    fn of_sums(
        py: Python<'_>,
        gram: PyReadonlyArray2<'_, f64>,
        moments: PyReadonlyArray2<'_, f64>,
        squares: Vec<f64>,
        lengths: Option<Vec<f64>>,
        floor: Option<f64>,
    ) -> PyResult<Self> {
        let (gram, moments) = (matrix(&gram), matrix(&moments));
        let n = gram.nrows();
        same_length("columns", gram.ncols(), "rows", n)?;
        same_length("moments", moments.nrows(), "rows", n)?;
        same_length("squares", squares.len(), "moments", moments.ncols())?;
        if let Some(lengths) = &lengths {
            same_length("lengths", lengths.len(), "rows", n)?;
        }
        let found = detached(py, || {
            LinearModel::of_sums(&gram, &moments, &squares, lengths.as_deref(), floor)
        })?;
        Ok(Self(told(py, found, NOT_FINITE)?))
    }

    #[getter]
    fn rank(&self) -> usize {
        self.0.rank()
    }

    #[getter]
    fn log_determinant(&self) -> f64 {
        self.0.log_determinant
    }

    #[getter]
    fn squares<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        vector(py, &self.0.squares)
    }

    #[getter]
    fn coefficients<'py>(&self, py: Python<'py>) -> PyResult<Matrix<'py>> {
        rows(py, &self.0.coefficients())
    }

    #[getter]
    fn root<'py>(&self, py: Python<'py>) -> PyResult<Matrix<'py>> {
        rows(py, self.0.root())
    }

    #[getter]
    fn unseen<'py>(&self, py: Python<'py>) -> PyResult<Matrix<'py>> {
        rows(py, self.0.unseen())
    }

    #[getter]
    fn inverse<'py>(&self, py: Python<'py>) -> PyResult<Matrix<'py>> {
        rows(py, &self.0.inverse())
    }
}

/// Coefficients of the fit of the other groups, a row for each left out, and the squares that
/// they leave of it.
#[pyfunction]
#[pyo3(signature = (grams, moments, squares, ridge=0.0))]
pub fn left_out<'py>(
    py: Python<'py>,
    grams: PyReadonlyArray3<'py, f64>,
    moments: PyReadonlyArray2<'py, f64>,
    squares: Vec<f64>,
    ridge: f64,
) -> PyResult<(Matrix<'py>, Bound<'py, PyArray1<f64>>)> {
    let groups = sums(&grams, &moments, &squares)?;
    let found = detached(py, || linear::left_out(&groups, ridge))?;
    let (coefficients, squares) = told(py, found, NOT_FINITE)?;
    Ok((rows(py, &coefficients.transpose())?, vector(py, &squares)?))
}

/// Covariance from scores summed over clusters, and degrees of freedom.
#[pyfunction]
#[pyo3(signature = (grams, scores, penalty=0.0))]
pub fn cluster_covariance<'py>(
    py: Python<'py>,
    grams: PyReadonlyArray3<'py, f64>,
    scores: PyReadonlyArray2<'py, f64>,
    penalty: f64,
) -> PyResult<(Matrix<'py>, Bound<'py, PyArray1<f64>>)> {
    let clusters = sums(&grams, &scores, &vec![0.0; scores.shape()[0]])?;
    let found = detached(py, || linear::cluster_covariance(&clusters, penalty))?;
    let found = told(py, found, "the clusters do not determine all coefficients")?;
    Ok((rows(py, &found.covariance)?, vector(py, &found.freedom)?))
}

/// Coefficients at every penalty, one a column, and the mean squares left of folds left out.
#[pyfunction]
pub fn ridge_path<'py>(
    py: Python<'py>,
    folds: Vec<(PyReadonlyArray2<'py, f64>, f64)>,
    own_zeros: bool,
    penalties: Vec<f64>,
) -> PyResult<(Matrix<'py>, Bound<'py, PyArray1<f64>>)> {
    let mut parts = Vec::with_capacity(folds.len());
    for (triangle, weight) in &folds {
        let columns = triangle.shape()[1];
        same_length(
            "columns of a fold",
            columns,
            "others",
            folds[0].0.shape()[1],
        )?;
        parts.push(Fold {
            triangle: Triangle::of_rows(columns, triangle.as_slice()?),
            weight: *weight,
        });
    }
    let found = detached(py, || linear::ridge_path(&parts, own_zeros, &penalties))?;
    let found = told(py, found, NOT_FINITE)?;
    Ok((rows(py, &found.coefficients)?, vector(py, &found.scores)?))
}

pub const NOT_FINITE: &str = "least squares of numbers that are not finite, or of nothing";

/// What was found, or numpy's error of linear algebra.
pub fn told<T>(py: Python<'_>, found: Option<T>, problem: &'static str) -> PyResult<T> {
    if let Some(found) = found {
        return Ok(found);
    }
    let kind = numpy_module(py)?
        .getattr(intern!(py, "linalg"))?
        .getattr(intern!(py, "LinAlgError"))?;
    Err(PyErr::from_value(kind.call1((problem,))?))
}

fn matrix(values: &PyReadonlyArray2<'_, f64>) -> DMatrix<f64> {
    let values = values.as_array();
    DMatrix::from_fn(values.nrows(), values.ncols(), |i, j| values[(i, j)])
}

fn sums(
    grams: &PyReadonlyArray3<'_, f64>,
    moments: &PyReadonlyArray2<'_, f64>,
    squares: &[f64],
) -> PyResult<Vec<Sums>> {
    let (grams, moments) = (grams.as_array(), moments.as_array());
    let (count, n, columns) = grams.dim();
    same_length("columns", columns, "rows", n)?;
    if moments.dim() != (count, n) {
        let problem = format!("moments must have the shape ({count}, {n})");
        return Err(PyValueError::new_err(problem));
    }
    same_length("squares", squares.len(), "groups", count)?;
    let group = |g: usize| Sums {
        gram: DMatrix::from_fn(n, n, |i, j| grams[(g, i, j)]),
        moment: DVector::from_fn(n, |i, _| moments[(g, i)]),
        squares: squares[g],
    };
    Ok((0..count).map(group).collect())
}

/// A matrix as numpy lays it out.
fn rows<'py>(py: Python<'py>, values: &DMatrix<f64>) -> PyResult<Matrix<'py>> {
    use numpy::PyArrayMethods;
    vector(py, values.transpose().as_slice())?.reshape([values.nrows(), values.ncols()])
}
