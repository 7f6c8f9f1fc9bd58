//! `_core.Moments`: the sums of one run, and `_core.fit_moments`.

use numpy::{Complex64, PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;

use super::array::vector;
use super::failure::argument_error;
use super::fit::{Solution, design, sizes};
use super::release::{attached, detached};
use super::threads::{self, Asked};
use crate::angle::Period;
use crate::check;
use crate::error::Error;
use crate::fit::fit_moments as core_fit;
use crate::moments::accumulator::Accumulator;
use crate::moments::spectrum::Spectrum;
use crate::moments::stream::add_known;
use crate::readings::Readings;
use crate::readings::{Argument, Run};

type Array<'py> = Bound<'py, PyArray1<f64>>;
type Complexes<'py> = Bound<'py, PyArray1<Complex64>>;

/// One-pass sums of one run; see `trueangle.Moments`.
#[pyclass(module = "trueangle._core", name = "Moments")]
pub struct PyMoments {
    period: f64,
    cycles: f64,
    highest: u32,
    sums: Option<Accumulator>,
}

impl PyMoments {
    fn fresh(&self, centre: f64) -> Result<Accumulator, Error> {
        let period = Period::new(self.period)?;
        Accumulator::room(self.highest)?;
        Ok(Accumulator::new(period, self.cycles, self.highest, centre))
    }
}

#[pymethods]
impl PyMoments {
    #[new]
    fn new(period: f64, cycles: Vec<f64>, orders: &Bound<'_, PyAny>) -> PyResult<Self> {
        let design = design(period, cycles, orders)?;
        let turn = design.common_turn();
        let turn = turn.and_then(|(cycles, orders)| Some((cycles, orders.into_iter().max()?)));
        let (cycles, highest) = turn.ok_or(Error::Method)?;
        Accumulator::room(highest)?;
        Ok(Self {
            period,
            cycles,
            highest,
            sums: None,
        })
    }

    /// Cycles per turn of the shaft that the orders of the spectrum belong to.
    #[getter]
    fn cycles(&self) -> f64 {
        self.cycles
    }

    #[getter]
    fn count(&self) -> usize {
        self.sums.as_ref().map_or(0, Accumulator::count)
    }

    #[pyo3(signature = (theta, error, weights=None, threads=None))]
    fn update(
        &mut self,
        py: Python<'_>,
        theta: PyReadonlyArray1<'_, f64>,
        error: PyReadonlyArray1<'_, f64>,
        weights: Option<PyReadonlyArray1<'_, f64>>,
        threads: Asked<'_>,
    ) -> PyResult<()> {
        let readings = Readings {
            angle: theta.as_slice()?,
            error: error.as_slice()?,
            reference: None,
            weights: match &weights {
                Some(weights) => Some(weights.as_slice()?),
                None => None,
            },
        };
        let len = readings.angle.len();
        check::same_length("error", readings.error.len(), "theta", len)?;
        check::finite("theta", readings.angle)?;
        check::finite("error", readings.error)?;
        if let Some(weights) = readings.weights {
            check::same_length("weights", weights.len(), "theta", len)?;
            check::not_negative("weights", weights)?;
        }
        if readings.count() == 0 {
            return Ok(());
        }
        let threads = threads::count(py, threads.as_ref(), len)?;
        // Work that is called off has changed nothing (`Accumulator::update`).
        match &mut self.sums {
            Some(sums) => detached(py, || sums.update(readings, threads))?,
            None => {
                let mut sums = self.fresh(readings.centre(Period::new(self.period)?))?;
                detached(py, || sums.update(readings, threads))?;
                self.sums = Some(sums);
            }
        }
        Ok(())
    }

    /// Adds the readings of which both angles are known; returns how many those are.
    fn update_known(
        &mut self,
        py: Python<'_>,
        reference: PyReadonlyArray1<'_, f64>,
        indicated: PyReadonlyArray1<'_, f64>,
        of_indicated: bool,
    ) -> PyResult<usize> {
        let run = Run {
            reference: reference.as_slice()?,
            indicated: indicated.as_slice()?,
            weights: None,
        };
        let argument = if of_indicated {
            Argument::Indicated
        } else {
            Argument::Reference
        };
        let wanted = run.reference.len();
        check::same_length("indicated", run.indicated.len(), "reference", wanted)?;
        let period = Period::new(self.period)?;
        let (cycles, highest) = (self.cycles, self.highest);
        if self.sums.is_none() {
            Accumulator::room(highest)?;
        }
        let fresh = |centre| Accumulator::new(period, cycles, highest, centre);
        let sums = &mut self.sums;
        detached(py, || add_known(sums, fresh, period, run, argument))
    }

    /// Sums of their own with the same readings.
    fn copy(&self) -> PyResult<Self> {
        if self.sums.is_some() {
            Accumulator::room(self.highest)?;
        }
        Ok(Self {
            sums: self.sums.clone(),
            ..*self
        })
    }

    /// Every reading so far so many times as heavy.
    fn scale(&mut self, factor: f64) {
        if let Some(sums) = &mut self.sums {
            sums.scale(factor);
        }
    }

    /// Takes away readings that were added before.
    fn subtract(&mut self, other: &Self) -> PyResult<()> {
        if (self.period, self.cycles, self.highest) != (other.period, other.cycles, other.highest) {
            return Err(Error::Merge("period or orders").into());
        }
        Accumulator::room(self.highest)?;
        if let (Some(sums), Some(other)) = (&mut self.sums, &other.sums) {
            sums.subtract(other);
        }
        Ok(())
    }

    fn merge(&mut self, other: &Self) -> PyResult<()> {
        if (self.period, self.cycles, self.highest) != (other.period, other.cycles, other.highest) {
            return Err(Error::Merge("period or orders").into());
        }
        Accumulator::room(self.highest)?;
        match (&mut self.sums, &other.sums) {
            (Some(sums), Some(other)) => sums.merge(other),
            (sums @ None, Some(other)) => *sums = Some(other.clone()),
            _ => {}
        }
        Ok(())
    }

    /// Greatest and least angle and error of every segment of the turn in which `update_known`
    /// found readings, four numbers each.
    fn extremes<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        let found = self.sums.as_ref().map_or(vec![], Accumulator::extremes);
        vector(py, found.as_flattened())
    }

    /// `sum w e^(ikx)`, `sum w y e^(ikx)`, `sum w y^2`, readings, and what `y` is counted from.
    #[pyo3(signature = (highest=None))]
    fn spectrum<'py>(
        &self,
        py: Python<'py>,
        highest: Option<u32>,
    ) -> PyResult<(Complexes<'py>, Complexes<'py>, f64, usize, f64)> {
        Accumulator::room(self.highest)?;
        let empty = self.fresh(0.0)?;
        let sums = self.sums.as_ref().unwrap_or(&empty);
        let highest = highest.unwrap_or(self.highest).min(sums.reach());
        let spectrum = attached(py, || Spectrum::new(sums, highest))?;
        Ok((
            vector(py, &spectrum.weight)?,
            vector(py, &spectrum.error)?,
            spectrum.squares,
            spectrum.count,
            spectrum.centre,
        ))
    }

    /// All sums as numbers, for pickling.
    fn store<'py>(&self, py: Python<'py>) -> PyResult<Option<Array<'py>>> {
        Accumulator::room(self.highest)?;
        let sums = self.sums.as_ref();
        sums.map(|sums| vector(py, &sums.store())).transpose()
    }

    fn restore(&mut self, py: Python<'_>, numbers: PyReadonlyArray1<'_, f64>) -> PyResult<()> {
        let sums = self.fresh(0.0)?.restore(numbers.as_slice()?);
        let failure = || argument_error(py, "these are not the sums of such moments".to_owned());
        self.sums = Some(sums.ok_or_else(failure)?);
        Ok(())
    }
}

/// Least squares from the moments of several runs.
#[pyfunction]
pub fn fit_moments(
    py: Python<'_>,
    runs: Vec<PyRef<'_, PyMoments>>,
    period: f64,
    cycles: Vec<f64>,
    orders: &Bound<'_, PyAny>,
) -> PyResult<Solution> {
    let design = design(period, cycles, orders)?;
    let sizes = sizes(&design);
    let sums: Vec<_> = runs.iter().filter_map(|run| run.sums.as_ref()).collect();
    design.room()?;
    let inner = detached(py, || core_fit(&design, &sums))??;
    Ok(Solution { inner, sizes })
}
