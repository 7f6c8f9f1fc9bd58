//! `_core.fit` and `_core.Solution`.

use numpy::{PyArray1, PyArray2, PyReadonlyArray1};
use pyo3::prelude::*;

use super::array::{filled, slice, square, vector};
use super::number;
use super::release::{attached, detached};
use super::series::{PySeries, argument_named, unknown};
use super::threads::{self, Asked};
use crate::check::same_length;
use crate::design::{Design, Frequencies};
use crate::fit as core;
use crate::fit::{Argument, Method, Options, Run};
use crate::kernel::TOLERANCE;
use crate::memory;

/// Columns of one run. They are not borrowed one by one: the book that `numpy` keeps of
/// borrows is searched from one end for arrays of one memory, and runs are often parts of
/// one table.
type Readings<'py> = (
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Option<Bound<'py, PyArray1<f64>>>,
);

/// Matrices of its size that are made beside a covariance.
const COVARIANCES: usize = 5;

/// What a fit found; see `trueangle.fit`.
#[pyclass(frozen, module = "trueangle._core")]
pub struct Solution {
    pub inner: core::Solution,
    /// Number of orders of each shaft.
    pub sizes: Vec<usize>,
}

#[pymethods]
impl Solution {
    #[getter]
    fn offsets<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        vector(py, &self.inner.offsets)
    }

    #[getter]
    fn offset_std<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        vector(py, &self.inner.offset_std)
    }

    #[getter]
    fn constant(&self) -> f64 {
        self.inner.constant
    }

    #[getter]
    fn cosine(&self) -> Vec<Vec<f64>> {
        self.halves(0)
    }

    #[getter]
    fn sine(&self) -> Vec<Vec<f64>> {
        self.halves(1)
    }

    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let size = 1 + self.inner.coefficients().len();
        memory::room(COVARIANCES * size_of::<f64>() * size * size)?;
        let covariance = attached(py, || self.inner.covariance())?;
        square(py, &covariance, size)
    }

    #[getter]
    fn residual_variance(&self) -> f64 {
        self.inner.residual_variance
    }

    #[getter]
    fn degrees_of_freedom(&self) -> f64 {
        self.inner.degrees_of_freedom
    }

    /// What no residual of a reading that counts exceeds; infinite where that is not known.
    #[getter]
    fn residual_bound(&self) -> f64 {
        self.inner.residual_bound
    }

    #[getter]
    fn rank(&self) -> usize {
        self.inner.rank
    }

    #[getter]
    fn condition_number(&self) -> f64 {
        self.inner.condition_number()
    }

    /// Whether the condition number is below `limit`: it is not made where a bound of it is.
    fn is_conditioned_below(&self, py: Python<'_>, limit: f64) -> PyResult<bool> {
        attached(py, || self.inner.is_conditioned_below(limit))
    }

    /// The series fitted, its constant the mean zero.
    fn series(&self, py: Python<'_>) -> PyResult<PySeries> {
        PySeries::of(py, self.inner.series()?, Argument::Reference, TOLERANCE)
    }

    /// The same readings under penalties on the squared coefficients, without another look.
    fn penalised(&self, py: Python<'_>, ridge: Vec<f64>) -> PyResult<Self> {
        let inner = detached(py, || self.inner.penalised(&ridge))??;
        let sizes = self.sizes.clone();
        Ok(Self { inner, sizes })
    }

    #[getter]
    fn method(&self) -> &'static str {
        match self.inner.method {
            Method::Plain => "plain",
            Method::Moments => "moments",
            Method::Qr => "qr",
            Method::Counts => "counts",
        }
    }
}

impl Solution {
    /// Every second coefficient, shaft by shaft: cosines from 0, sines from 1.
    fn halves(&self, first: usize) -> Vec<Vec<f64>> {
        let mut values = self.inner.coefficients().iter().skip(first).step_by(2);
        let shaft = |size: &usize| values.by_ref().take(*size).copied().collect();
        self.sizes.iter().map(shaft).collect()
    }
}

/// Least squares of harmonic orders and one zero per run; see `trueangle.fit`.
#[pyfunction]
#[pyo3(signature = (runs, period, cycles, orders, argument="reference", method=None, ridge=None, threads=None, watch=false))]
#[allow(clippy::too_many_arguments)] // one Python call, its arguments by name
pub fn fit(
    py: Python<'_>,
    runs: Vec<Readings<'_>>,
    period: f64,
    cycles: Vec<f64>,
    orders: &Bound<'_, PyAny>,
    argument: &str,
    method: Option<&str>,
    ridge: Option<Vec<f64>>,
    threads: Asked<'_>,
    watch: bool,
) -> PyResult<Solution> {
    let argument = argument_named(py, argument)?;
    let method = match method {
        None => None,
        Some("plain") => Some(Method::Plain),
        Some("moments") => Some(Method::Moments),
        Some("qr") => Some(Method::Qr),
        Some("counts") => Some(Method::Counts),
        Some(other) => {
            let wanted = "\"plain\", \"moments\", \"qr\", \"counts\" or None";
            return Err(unknown(py, "method", other, wanted));
        }
    };
    let design = design(period, cycles, orders)?;
    let sizes = sizes(&design);
    let runs = runs.iter().map(slices).collect::<PyResult<Vec<_>>>()?;
    let readings = runs.iter().map(|run| run.reference.len()).sum();
    let threads = threads::count(py, threads.as_ref(), readings)?;
    let options = Options {
        argument,
        method,
        ridge: ridge.as_deref(),
        threads,
        watch,
    };
    design.room()?;
    let inner = detached(py, || core::fit(&design, &runs, options))??;
    Ok(Solution { inner, sizes })
}

/// The triangle of the weighted rows [1, harmonics | error - zero] of one run.
#[pyfunction]
#[pyo3(signature = (run, period, cycles, orders, argument, zero, threads=None))]
pub fn triangle<'py>(
    py: Python<'py>,
    run: Readings<'py>,
    period: f64,
    cycles: Vec<f64>,
    orders: &Bound<'_, PyAny>,
    argument: &str,
    zero: f64,
    threads: Asked<'_>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let argument = argument_named(py, argument)?;
    let design = design(period, cycles, orders)?;
    let size = design.columns() + 2;
    let run = slices(&run)?;
    let threads = threads::count(py, threads.as_ref(), run.reference.len())?;
    design.room()?;
    let rows = detached(py, || {
        core::triangle(&design, &run, argument, zero, threads)
    })??;
    square(py, &rows, size)
}

/// The same of every stretch of the argument that ends at one of `ends`, with its weight.
#[pyfunction]
#[pyo3(signature = (run, period, cycles, orders, argument, ends, zero, threads=None))]
#[allow(clippy::too_many_arguments)] // one Python call, its arguments by name
pub fn folds<'py>(
    py: Python<'py>,
    run: Readings<'py>,
    period: f64,
    cycles: Vec<f64>,
    orders: &Bound<'_, PyAny>,
    argument: &str,
    ends: Vec<f64>,
    zero: f64,
    threads: Asked<'_>,
) -> PyResult<Vec<(Bound<'py, PyArray2<f64>>, f64)>> {
    let argument = argument_named(py, argument)?;
    let design = design(period, cycles, orders)?;
    let size = design.columns() + 2;
    let run = slices(&run)?;
    let threads = threads::count(py, threads.as_ref(), run.reference.len())?;
    design.room()?;
    let found = detached(py, || {
        core::folds(&design, &run, argument, &ends, zero, threads)
    })??;
    let fold = |fold: core::Fold| Ok((square(py, &fold.triangle.to_rows(), size)?, fold.weight));
    found.into_iter().map(fold).collect()
}

/// Standard deviations of a fitted series at some angles, from its covariance.
#[pyfunction]
pub fn band<'py>(
    py: Python<'py>,
    theta: PyReadonlyArray1<'py, f64>,
    period: f64,
    cycles: Vec<f64>,
    orders: &Bound<'_, PyAny>,
    covariance: PyReadonlyArray1<'py, f64>,
) -> PyResult<Bound<'py, PyAny>> {
    let design = design(period, cycles, orders)?;
    let (theta, covariance) = (theta.as_slice()?, covariance.as_slice()?);
    // Each angle costs as much as a hundred samples of a series.
    let threads = threads::count(py, None, theta.len().saturating_mul(100))?;
    let found = filled(py, &[theta.len()], |values| {
        let work = || crate::band::band(&design, covariance, theta, threads, values);
        Ok(detached(py, work)??)
    })?;
    Ok(found.into_any())
}

/// A sample of the residuals of one run, and the largest.
#[pyfunction]
#[pyo3(signature = (series, run, argument, offset, stride, threads=None))]
pub fn scan_residuals<'py>(
    py: Python<'py>,
    series: &PySeries,
    run: Readings<'py>,
    argument: &str,
    offset: f64,
    stride: usize,
    threads: Asked<'_>,
) -> PyResult<(Bound<'py, PyArray1<f64>>, f64)> {
    let argument = argument_named(py, argument)?;
    let run = slices(&run)?;
    let threads = threads::count(py, threads.as_ref(), run.reference.len())?;
    let evaluator = &series.evaluator;
    let stride = stride.max(1);
    memory::room(2 * size_of::<f64>() * (run.reference.len() / stride))?;
    let look = || core::scan(evaluator, &run, argument, offset, stride, threads);
    let found = detached(py, look)??;
    Ok((vector(py, &found.sample)?, found.largest))
}

/// A sample of the residuals of one run, of every so many that count.
#[pyfunction]
#[pyo3(signature = (series, run, argument, offset, stride, threads=None))]
pub fn sample_residuals<'py>(
    py: Python<'py>,
    series: &PySeries,
    run: Readings<'py>,
    argument: &str,
    offset: f64,
    stride: usize,
    threads: Asked<'_>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let argument = argument_named(py, argument)?;
    let run = slices(&run)?;
    let threads = threads::count(py, threads.as_ref(), run.reference.len())?;
    let evaluator = &series.evaluator;
    let stride = stride.max(1);
    memory::room(4 * size_of::<f64>() * (run.reference.len() / stride))?;
    let look = || core::sample(evaluator, &run, argument, offset, stride, threads);
    vector(py, &detached(py, look)??)
}

/// The middle one of the absolute values of some residuals: of about `most`, at even strides.
#[pyfunction]
pub fn median_magnitude(values: PyReadonlyArray1<'_, f64>, most: usize) -> PyResult<f64> {
    Ok(core::median_magnitude(values.as_slice()?, most))
}

/// The harmonics of several shafts.
pub fn design(period: f64, cycles: Vec<f64>, orders: &Bound<'_, PyAny>) -> PyResult<Design> {
    let orders = number::orders(orders)?;
    same_length("orders", orders.len(), "cycles", cycles.len())?;
    let shafts = cycles.into_iter().zip(orders);
    let shafts = shafts.map(|(cycles, orders)| Frequencies { cycles, orders });
    Ok(Design::new(period, shafts.collect())?)
}

/// Number of orders of each shaft.
pub fn sizes(design: &Design) -> Vec<usize> {
    design
        .shafts()
        .iter()
        .map(|shaft| shaft.orders.len())
        .collect()
}

fn slices<'a>(run: &'a Readings<'_>) -> PyResult<Run<'a>> {
    let (reference, indicated, weights) = run;
    Ok(Run {
        reference: slice(reference)?,
        indicated: slice(indicated)?,
        weights: weights.as_ref().map(slice).transpose()?,
    })
}
