//! `_core.Beside`: what columns would save beside a fit.

use std::borrow::Cow;

use numpy::{PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::array::vector;
use super::linear::{NOT_FINITE, told};
use super::release::detached;
use crate::check::same_length;
use crate::linear::{Beside, Bumps, Order};

type Vector<'py> = Bound<'py, numpy::PyArray1<f64>>;

/// Rows that are turned into columns at a time: they stay in the first cache.
const TURNED: usize = 64;

/// A fit as columns see it that are not whitened.
#[pyclass(name = "Beside", module = "trueangle._core", frozen)]
pub struct PyBeside(pub(super) Beside);

#[pymethods]
impl PyBeside {
    /// The fitted columns and what they leave, as rows.
    #[getter]
    fn seen<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let n = self.0.readings();
        let rows = self.0.seen();
        vector(py, rows)?.reshape([rows.len() / n.max(1), n])
    }

    /// Deviance that columns save together, and their coefficients.
    fn gain<'py>(
        &self,
        py: Python<'py>,
        columns: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<(f64, Vector<'py>)> {
        let rows = self.rows(&columns)?;
        let table = (rows.slice()?, columns.shape()[1]);
        let (deviance, coefficients) = detached(py, || self.0.gain(table))?;
        Ok((deviance, vector(py, &coefficients)?))
    }

    /// Powers of columns, what of them is not fitted, and products with what is left.
    fn powers<'py>(
        &self,
        py: Python<'py>,
        columns: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<(Vector<'py>, Vector<'py>, Vector<'py>)> {
        let rows = self.rows(&columns)?;
        let table = (rows.slice()?, columns.shape()[1]);
        let found = detached(py, || self.0.powers(table))?;
        Ok((
            vector(py, &found.before)?,
            vector(py, &found.after)?,
            vector(py, &found.moment)?,
        ))
    }

    /// Place and width of the bump near some, no wider than the widest, that saves most: of a shaft
    /// that stands at `phase` at every reading, all in degrees.
    fn bump(
        &self,
        py: Python<'_>,
        phase: PyReadonlyArray1<'_, f64>,
        place: f64,
        width: f64,
        widest: f64,
    ) -> PyResult<(f64, f64)> {
        same_length("phase", phase.len(), "readings", self.0.readings())?;
        let phase = phase.as_slice()?;
        detached(py, || {
            Bumps::new(&self.0, phase, widest).refined(place, width)
        })
    }

    /// Order between two, and deviance, of the line with a phase of its own in every run that saves
    /// most; see `golden_maximum` and `line_columns`.
    fn line(
        &self,
        py: Python<'_>,
        angles: PyReadonlyArray1<'_, f64>,
        low: f64,
        high: f64,
        steps: usize,
        vanishing: f64,
    ) -> PyResult<(f64, f64)> {
        same_length("angles", angles.len(), "readings", self.0.readings())?;
        let angles = angles.as_slice()?;
        let found = detached(py, || self.0.line(angles, (low, high), steps, vanishing))?;
        told(py, found, NOT_FINITE)
    }

    /// Best ratio of variances of a run effect and the deviance that it saves.
    fn ratio(&self, py: Python<'_>, columns: PyReadonlyArray2<'_, f64>) -> PyResult<(f64, f64)> {
        let k = columns.shape()[1];
        let found = if columns.is_fortran_contiguous() {
            same_length("columns", columns.shape()[0], "readings", self.0.readings())?;
            let table = (columns.as_slice()?, k);
            detached(py, || self.0.ratio(table, Order::Columns))?
        } else {
            let rows = self.rows(&columns)?;
            let table = (rows.slice()?, k);
            detached(py, || self.0.ratio(table, Order::Readings))?
        };
        told(py, found, NOT_FINITE)
    }
}

impl PyBeside {
    fn rows<'a, 'py>(&self, columns: &'a PyReadonlyArray2<'py, f64>) -> PyResult<Rows<'a, 'py>> {
        same_length("columns", columns.shape()[0], "readings", self.0.readings())?;
        Ok(if columns.is_c_contiguous() {
            Rows::There(columns)
        } else {
            Rows::Made(by_rows(columns))
        })
    }
}

/// Rows one after the other.
enum Rows<'a, 'py> {
    There(&'a PyReadonlyArray2<'py, f64>),
    Made(Vec<f64>),
}

impl Rows<'_, '_> {
    fn slice(&self) -> PyResult<&[f64]> {
        Ok(match self {
            Self::There(array) => array.as_slice()?,
            Self::Made(rows) => rows,
        })
    }
}

fn by_rows(table: &PyReadonlyArray2<'_, f64>) -> Vec<f64> {
    table.as_array().iter().copied().collect()
}

/// Columns one after the other: as they stand, or of so many rows at a time.
pub(super) fn by_columns<'a>(table: &'a PyReadonlyArray2<'_, f64>) -> PyResult<Cow<'a, [f64]>> {
    if table.is_fortran_contiguous() {
        return Ok(Cow::Borrowed(table.as_slice()?));
    }
    let table = table.as_array();
    let (n, columns) = table.dim();
    let mut turned = vec![0.0; n * columns];
    for start in (0..n).step_by(TURNED) {
        for (j, column) in table.columns().into_iter().enumerate() {
            let stop = n.min(start + TURNED);
            for i in start..stop {
                turned[j * n + i] = column[i];
            }
        }
    }
    Ok(Cow::Owned(turned))
}
