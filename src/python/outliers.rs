//! Readings that are off those beside them.

use numpy::PyReadonlyArray1;
use pyo3::prelude::*;

use super::release::detached;
use crate::check::same_length;
use crate::outliers as core;

/// Rows of the outliers among readings, and how far each is off the others beside it: more than
/// `wild` standard deviations. None with more than a `share` of them, or below `fewest` readings.
#[pyfunction]
#[pyo3(signature = (error, angle, indicated, period, *, wild, share, fewest, sample))]
#[expect(clippy::too_many_arguments, reason = "one for each of Python's")]
pub fn outliers(
    py: Python<'_>,
    error: PyReadonlyArray1<'_, f64>,
    angle: PyReadonlyArray1<'_, f64>,
    indicated: PyReadonlyArray1<'_, f64>,
    period: f64,
    wild: f64,
    share: f64,
    fewest: usize,
    sample: usize,
) -> PyResult<Vec<(usize, f64)>> {
    let (error, angle, indicated) = (error.as_slice()?, angle.as_slice()?, indicated.as_slice()?);
    same_length("angle", angle.len(), "error", error.len())?;
    same_length("indicated", indicated.len(), "error", error.len())?;
    let limits = core::Limits {
        wild,
        share,
        fewest,
        sample,
    };
    detached(py, || {
        core::outliers(error, angle, indicated, period, &limits)
    })
}

/// Count of a sensor; 0 where its readings are on no lattice, or only their places are.
#[pyfunction]
pub fn sensor_count(
    error: PyReadonlyArray1<'_, f64>,
    indicated: PyReadonlyArray1<'_, f64>,
    period: f64,
) -> PyResult<f64> {
    let (error, indicated) = (error.as_slice()?, indicated.as_slice()?);
    same_length("indicated", indicated.len(), "error", error.len())?;
    Ok(core::sensor_count(error, indicated, period))
}
