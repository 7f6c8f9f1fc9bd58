//! Statistics of angles on the circle.

use numpy::{PyReadonlyArray1, PyReadwriteArray1};
use pyo3::prelude::*;

use crate::circle;
use crate::error::Error;

fn same_length(what: &'static str, got: usize, wanted: usize) -> Result<(), Error> {
    if got == wanted {
        return Ok(());
    }
    Err(Error::Length {
        what,
        got,
        other: "indicated",
        wanted,
    })
}

/// Length of the mean unit vector at indicated - reference.
#[pyfunction]
pub fn resultant(
    indicated: PyReadonlyArray1<'_, f64>,
    reference: PyReadonlyArray1<'_, f64>,
    period: f64,
) -> PyResult<f64> {
    let (indicated, reference) = (indicated.as_slice()?, reference.as_slice()?);
    same_length("reference", reference.len(), indicated.len())?;
    Ok(circle::resultant(indicated, reference, period))
}

/// Turns fitted errors into residuals, in place.
#[pyfunction]
pub fn residuals(
    indicated: PyReadonlyArray1<'_, f64>,
    reference: PyReadonlyArray1<'_, f64>,
    offset: f64,
    period: f64,
    mut fitted: PyReadwriteArray1<'_, f64>,
) -> PyResult<()> {
    let (indicated, reference) = (indicated.as_slice()?, reference.as_slice()?);
    let fitted = fitted.as_slice_mut()?;
    same_length("reference", reference.len(), indicated.len())?;
    same_length("fitted", fitted.len(), indicated.len())?;
    circle::residuals(indicated, reference, offset, period, fitted);
    Ok(())
}

/// Start and stop of the stretch travelled, and whether that is the whole turn.
#[pyfunction]
pub fn covered_span(
    angles: Vec<PyReadonlyArray1<'_, f64>>,
    period: f64,
) -> PyResult<(f64, f64, bool)> {
    let slices = angles
        .iter()
        .map(|array| array.as_slice())
        .collect::<Result<Vec<_>, _>>()?;
    let span = circle::covered_span(&slices, period);
    Ok((span.start, span.stop, span.full))
}
