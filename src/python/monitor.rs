//! `_core.Monitor`: windows of a running joint against its model.

use numpy::PyReadonlyArray1;
use pyo3::prelude::*;

use super::release::detached;
use crate::angle::Period;
use crate::check::same_length;
use crate::monitor::watch::{FIRST, Limits};
use crate::monitor::window::Window;
use crate::monitor::{Closed, Monitor, Moved};

/// A joint against its model; see `trueangle.Monitor`.
#[pyclass(module = "trueangle._core", name = "Monitor")]
pub struct PyMonitor(Monitor);

/// What a window said, by name.
#[pyclass(module = "trueangle._core", name = "ClosedWindow", frozen, get_all)]
pub struct PyClosedWindow {
    reading: usize,
    window: u64,
    readings: f64,
    coefficients: Vec<f64>,
    statistics: Vec<f64>,
    moved: Vec<(usize, f64, f64, f64)>,
    unlike: Vec<(usize, f64, f64, f64)>,
}

impl From<Closed> for PyClosedWindow {
    fn from(closed: Closed) -> Self {
        Self {
            reading: closed.reading,
            window: closed.window,
            readings: closed.readings,
            coefficients: closed.coefficients,
            statistics: closed.statistics,
            moved: closed.moved.into_iter().map(plain).collect(),
            unlike: closed.unlike.into_iter().map(plain).collect(),
        }
    }
}

fn plain(moved: Moved) -> (usize, f64, f64, f64) {
    (moved.order, moved.size, moved.std, moved.since)
}

#[pymethods]
impl PyMonitor {
    /// Windows of the baseline.
    #[classattr]
    const BASELINE: u64 = FIRST as u64;

    #[new]
    fn new(
        period: f64,
        orders: Vec<u32>,
        cosine: Vec<f64>,
        sine: Vec<f64>,
        known: Vec<f64>,
        every: f64,
        limits: (f64, f64, f64, f64),
    ) -> PyResult<Self> {
        let count = orders.len();
        same_length("cosine", cosine.len(), "orders", count)?;
        same_length("sine", sine.len(), "orders", count)?;
        same_length("known", known.len(), "coefficients", 2 * count)?;
        let (allowance, sum, step, mean) = limits;
        let limits = Limits {
            allowance,
            sum,
            step,
            mean,
        };
        let window = Window::new(&orders, &cosine, &sine);
        let period = Period::new(period)?.value();
        Ok(Self(Monitor::new(period, window, known, every, limits)))
    }

    fn update(
        &mut self,
        py: Python<'_>,
        angle: PyReadonlyArray1<'_, f64>,
        error: PyReadonlyArray1<'_, f64>,
        alarms: bool,
    ) -> PyResult<Vec<PyClosedWindow>> {
        let (angle, error) = (angle.as_slice()?, error.as_slice()?);
        same_length("error", error.len(), "angle", angle.len())?;
        let monitor = &mut self.0;
        let closed = detached(py, || monitor.update(angle, error, alarms))?;
        Ok(closed.into_iter().map(PyClosedWindow::from).collect())
    }

    #[getter]
    fn windows(&self) -> u64 {
        self.0.windows()
    }

    #[getter]
    fn bytes(&self) -> usize {
        self.0.bytes()
    }

    #[getter]
    fn state(&self) -> Vec<[f64; 4]> {
        self.0.state()
    }
}
