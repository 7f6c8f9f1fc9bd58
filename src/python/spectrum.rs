//! Spectra divided by their level, added up over runs.

use numpy::{PyReadonlyArray1, PyReadwriteArray1, PyReadwriteArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::failure::argument_error;
use super::release::detached;
use crate::check::same_length;
use crate::spectrum;

/// Divides a spectrum by its level between `cuts`, in place, and adds its running means over
/// `(width, weight)` to the rows of `totals`, as far as these go.
#[pyfunction]
pub fn add_relative_power(
    py: Python<'_>,
    mut power: PyReadwriteArray1<'_, f64>,
    cuts: PyReadonlyArray1<'_, i64>,
    boxes: Vec<(usize, f64)>,
    mut totals: PyReadwriteArray2<'_, f64>,
) -> PyResult<()> {
    let power = power.as_slice_mut()?;
    let rows = totals.shape()[0];
    let totals = totals.as_slice_mut()?;
    if totals.len() > power.len() * rows {
        let message = format!("totals must have {} columns at most", power.len());
        return Err(argument_error(py, message));
    }
    same_length("totals", rows, "boxes", boxes.len())?;
    let mut edges = Vec::new();
    for &cut in cuts.as_slice()? {
        let cut = usize::try_from(cut).unwrap_or(usize::MAX);
        if cut > power.len() || edges.last().is_some_and(|&last| last >= cut) {
            let message = format!("cuts must grow from 0 to {} at most", power.len());
            return Err(argument_error(py, message));
        }
        edges.push(cut);
    }
    if edges.len() < 2 {
        return Err(argument_error(
            py,
            "cuts must have two edges at least".to_owned(),
        ));
    }
    detached(py, || {
        spectrum::divide_by_level(power, &edges);
        spectrum::add_running_means(power, &boxes, totals);
    })
}
