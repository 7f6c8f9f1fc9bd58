//! `_core.Series`.

use std::sync::Arc;

use numpy::{PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::door::{self, Computation, Computed};
use super::failure::argument_error;
use super::number::{self, is_number};
use super::release::attached;
use super::threads::{Asked, threads};
use crate::error::Error;
use crate::kernel::{Batch, Evaluator, Quantity, Real, Route, Sample, Stretch, TOLERANCE};
use crate::readings::Argument;
use crate::series::{HarmonicSeries, Shaft};

/// A harmonic series made ready; see `trueangle.HarmonicModel`.
#[pyclass(name = "Series", module = "trueangle._core", frozen)]
pub struct PySeries {
    pub(super) evaluator: Arc<Evaluator>,
    tolerance: f64,
}

/// A quantity of a series, as the caller wants it.
struct Wish<'e> {
    evaluator: &'e Evaluator,
    quantity: Quantity,
    route: Option<Route>,
    threads: Option<usize>,
    stretch: Option<Stretch>,
}

impl Computation for Wish<'_> {
    fn run<X: Sample, Y: Real>(&mut self, batch: Batch<'_, X, Y>) -> Result<usize, Error> {
        let stretch = self.stretch.as_ref();
        self.evaluator
            .run_watched(self.quantity, self.route, self.threads, batch, stretch)
    }

    fn prepare(&self) -> Result<(), Error> {
        self.evaluator.room()
    }

    fn is_ready(&self) -> bool {
        self.evaluator.is_ready(self.quantity)
    }
}

/// The constructor's arguments, in its order.
type Parts = (
    f64,
    f64,
    Vec<f64>,
    Vec<Vec<u32>>,
    Vec<Vec<f64>>,
    Vec<Vec<f64>>,
    &'static str,
    f64,
);

impl PySeries {
    /// A series made ready.
    pub(super) fn of(
        py: Python<'_>,
        series: HarmonicSeries,
        argument: Argument,
        tolerance: f64,
    ) -> PyResult<Self> {
        let evaluator = attached(py, || Evaluator::new(series, argument))?;
        Ok(Self {
            evaluator: Arc::new(evaluator.with_tolerance(tolerance)?),
            tolerance,
        })
    }
}

#[pymethods]
impl PySeries {
    #[new]
    #[allow(clippy::too_many_arguments)] // the keywords of the Python constructor
    #[pyo3(signature = (period, constant, cycles, orders, cosine, sine, argument="reference", tolerance=TOLERANCE))]
    fn new(
        py: Python<'_>,
        period: f64,
        constant: f64,
        cycles: Vec<f64>,
        orders: &Bound<'_, PyAny>,
        cosine: Vec<Vec<f64>>,
        sine: Vec<Vec<f64>>,
        argument: &str,
        tolerance: f64,
    ) -> PyResult<Self> {
        let orders = number::orders(orders)?;
        let shafts = cycles.len();
        for (what, got) in [
            ("orders", orders.len()),
            ("cosine", cosine.len()),
            ("sine", sine.len()),
        ] {
            if got != shafts {
                return Err(argument_error(
                    py,
                    format!("{what} has {got} lists, cycles has {shafts}: one list per shaft"),
                ));
            }
        }
        let argument = argument_named(py, argument)?;
        let shafts = cycles
            .into_iter()
            .zip(orders)
            .zip(cosine.into_iter().zip(sine))
            .map(|((cycles, orders), (cosine, sine))| Shaft {
                cycles,
                orders,
                cosine,
                sine,
            })
            .collect();
        let series = HarmonicSeries::new(period, constant, shafts)?;
        Self::of(py, series, argument, tolerance)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Parts)> {
        let Self {
            evaluator,
            tolerance,
        } = slf.get();
        let series = evaluator.series();
        let of_shafts = |of: fn(&Shaft) -> Vec<f64>| series.shafts().iter().map(of).collect();
        let parts = (
            series.period().value(),
            series.constant(),
            series.shafts().iter().map(|s| s.cycles).collect(),
            series.shafts().iter().map(|s| s.orders.clone()).collect(),
            of_shafts(|s| s.cosine.clone()),
            of_shafts(|s| s.sine.clone()),
            evaluator.argument().name(),
            *tolerance,
        );
        Ok((slf.get_type().into_any(), parts))
    }

    #[pyo3(signature = (theta, out=None, threads=None, path=None))]
    fn error<'py>(
        &self,
        theta: &Bound<'py, PyAny>,
        out: Option<&Bound<'py, PyAny>>,
        threads: Asked<'py>,
        path: Option<&str>,
    ) -> PyResult<Bound<'py, PyAny>> {
        Ok(self
            .compute(Quantity::Error, theta, out, threads, path, None)?
            .0)
    }

    #[pyo3(signature = (theta, out=None, threads=None, path=None))]
    fn slope<'py>(
        &self,
        theta: &Bound<'py, PyAny>,
        out: Option<&Bound<'py, PyAny>>,
        threads: Asked<'py>,
        path: Option<&str>,
    ) -> PyResult<Bound<'py, PyAny>> {
        Ok(self
            .compute(Quantity::Slope, theta, out, threads, path, None)?
            .0)
    }

    #[pyo3(signature = (indicated, out=None, threads=None, path=None))]
    fn correct<'py>(
        &self,
        indicated: &Bound<'py, PyAny>,
        out: Option<&Bound<'py, PyAny>>,
        threads: Asked<'py>,
        path: Option<&str>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let quantity = Quantity::Correction;
        Ok(self
            .compute(quantity, indicated, out, threads, path, None)?
            .0)
    }

    /// `correct`, and how many results lie outside a stretch (start, stop, does it repeat).
    #[pyo3(signature = (indicated, stretch, out=None, threads=None, path=None))]
    fn correct_within<'py>(
        &self,
        indicated: &Bound<'py, PyAny>,
        stretch: (f64, f64, bool),
        out: Option<&Bound<'py, PyAny>>,
        threads: Asked<'py>,
        path: Option<&str>,
    ) -> PyResult<Computed<'py>> {
        let quantity = Quantity::Correction;
        self.compute(quantity, indicated, out, threads, path, Some(stretch))
    }

    #[getter]
    fn path(&self) -> String {
        let route = self.evaluator.route::<f64, f64>(Quantity::Error, 1);
        route.to_string()
    }

    #[getter]
    fn counts_path(&self) -> String {
        let route = self
            .evaluator
            .route::<u32, f64>(Quantity::Error, usize::MAX);
        route.to_string()
    }

    #[getter]
    fn float32_path(&self) -> String {
        let route = self.evaluator.route::<f32, f32>(Quantity::Error, 1);
        route.to_string()
    }

    #[getter]
    fn float32_bound(&self) -> f64 {
        self.evaluator.single_bound()
    }

    #[getter]
    fn segments(&self) -> usize {
        let table = self.evaluator.table(Quantity::Error);
        table.map_or(0, |table| table.segments())
    }

    #[getter]
    fn error_bound(&self) -> f64 {
        self.evaluator.error_bound()
    }

    #[getter]
    fn slope_bound(&self) -> f64 {
        self.evaluator.slope_bound()
    }

    #[getter]
    fn amplitude_sum(&self) -> f64 {
        self.evaluator.series().amplitude_sum()
    }

    #[getter]
    fn is_periodic(&self) -> bool {
        self.evaluator.series().is_periodic()
    }
}

impl PySeries {
    fn compute<'py>(
        &self,
        quantity: Quantity,
        x: &Bound<'py, PyAny>,
        out: Option<&Bound<'py, PyAny>>,
        asked: Asked<'py>,
        path: Option<&str>,
        stretch: Option<(f64, f64, bool)>,
    ) -> PyResult<Computed<'py>> {
        let py = x.py();
        let samples = match x.cast_exact::<PyUntypedArray>() {
            Ok(array) => array.len(),
            Err(_) if is_number(x) => 1,
            Err(_) => usize::MAX, // not known yet
        };
        let period = self.evaluator.series().period().value();
        let mut wish = Wish {
            evaluator: &self.evaluator,
            quantity,
            route: door::route(py, path)?,
            threads: threads(py, asked.as_ref(), samples)?,
            stretch: door::stretch(period, stretch),
        };
        door::anything(x, out, &mut wish)
    }
}

/// The argument of a name.
pub fn argument_named(py: Python<'_>, name: &str) -> PyResult<Argument> {
    let wanted = "'reference' or 'indicated'";
    Argument::named(name).ok_or_else(|| unknown(py, "argument", name, wanted))
}

/// An error of a word that is none of those that are known.
pub fn unknown(py: Python<'_>, what: &str, got: &str, wanted: &str) -> PyErr {
    argument_error(py, format!("{what} must be {wanted}, got {got:?}"))
}
