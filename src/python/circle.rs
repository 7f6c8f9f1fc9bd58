//! Statistics of angles on the circle.

use numpy::{PyArray1, PyReadonlyArray1, PyReadwriteArray1};
use pyo3::prelude::*;

use super::array::slice;
use super::release::{detached, look};
use crate::check::same_length;
use crate::circle;

/// Length of the mean unit vector at indicated - reference.
#[pyfunction]
pub fn resultant(
    py: Python<'_>,
    indicated: PyReadonlyArray1<'_, f64>,
    reference: PyReadonlyArray1<'_, f64>,
    period: f64,
) -> PyResult<f64> {
    let (indicated, reference) = (indicated.as_slice()?, reference.as_slice()?);
    same_length("reference", reference.len(), "indicated", indicated.len())?;
    detached(py, || circle::resultant(indicated, reference, period))
}

/// The fields of `circle::Following`, in order.
type Followed = (f64, usize, f64, f64, f64, f64, f64);

/// How two angles go together.
#[pyfunction]
pub fn following(
    py: Python<'_>,
    indicated: &Bound<'_, PyArray1<f64>>,
    reference: &Bound<'_, PyArray1<f64>>,
    period: f64,
    stride: usize,
    long: f64,
) -> PyResult<Followed> {
    let (indicated, reference) = (slice(indicated)?, slice(reference)?);
    same_length("reference", reference.len(), "indicated", indicated.len())?;
    let found = look(py, reference.len() / stride.max(1), || {
        circle::following(indicated, reference, period, stride, long)
    })?;
    Ok((
        found.step,
        found.long_steps,
        found.slip,
        found.spread,
        found.travel,
        found.half,
        found.largest,
    ))
}

/// Turns fitted errors into residuals, in place.
#[pyfunction]
pub fn residuals(
    py: Python<'_>,
    indicated: PyReadonlyArray1<'_, f64>,
    reference: PyReadonlyArray1<'_, f64>,
    offset: f64,
    period: f64,
    mut fitted: PyReadwriteArray1<'_, f64>,
) -> PyResult<()> {
    let (indicated, reference) = (indicated.as_slice()?, reference.as_slice()?);
    let fitted = fitted.as_slice_mut()?;
    same_length("reference", reference.len(), "indicated", indicated.len())?;
    same_length("fitted", fitted.len(), "indicated", indicated.len())?;
    detached(py, || {
        circle::residuals(indicated, reference, offset, period, fitted)
    })
}

/// Start and stop of the stretch travelled, and whether that is the whole turn.
#[pyfunction]
pub fn covered_span(
    py: Python<'_>,
    angles: Vec<Bound<'_, PyArray1<f64>>>,
    period: f64,
    most: usize,
) -> PyResult<(f64, f64, bool)> {
    let slices = angles.iter().map(slice).collect::<PyResult<Vec<_>>>()?;
    let readings = slices.iter().map(|angles| angles.len()).sum();
    let span = look(py, readings, || circle::covered_span(&slices, period, most))?;
    Ok((span.start, span.stop, span.full))
}
