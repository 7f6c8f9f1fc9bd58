//! `_core.Corrector`.

use std::sync::Arc;

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;

use super::failure::argument_error;
use super::series::PySeries;
use super::threads::threads;
use crate::kernel::Quantity;
use crate::terms::{Columns, Corrector, Line, Signals, Term, Terms};

type Column<'py> = Option<PyReadonlyArray1<'py, f64>>;

/// Correction by a series and its terms, in the order the samples were taken.
#[pyclass(name = "Corrector", module = "trueangle._core")]
pub struct PyCorrector(Corrector);

#[pymethods]
impl PyCorrector {
    #[new]
    fn new(series: &PySeries, terms: Vec<Bound<'_, PyAny>>) -> PyResult<Self> {
        let terms = terms.iter().map(term).collect::<PyResult<Vec<_>>>()?;
        let terms = Terms::new(Arc::clone(&series.evaluator), &terms)?;
        Ok(Self(Corrector::new(Arc::new(terms))))
    }

    #[pyo3(signature = (indicated, /, velocity=None, temperature=None, torque=None, direction=None))]
    fn step(
        &mut self,
        indicated: f64,
        velocity: Option<f64>,
        temperature: Option<f64>,
        torque: Option<f64>,
        direction: Option<f64>,
    ) -> PyResult<f64> {
        let signals = Signals {
            direction,
            velocity,
            temperature,
            torque,
        };
        Ok(self.0.correct(indicated, &signals)?)
    }

    fn reset(&mut self) {
        self.0.reset();
    }

    fn store(&self) -> Vec<f64> {
        self.0.store()
    }

    fn restore(&mut self, py: Python<'_>, numbers: Vec<f64>) -> PyResult<()> {
        if self.0.restore(&numbers) {
            return Ok(());
        }
        let problem = "this is not the state of a corrector with such terms";
        Err(argument_error(py, problem.to_owned()))
    }

    #[pyo3(signature = (indicated, velocity, temperature, torque, direction, threads))]
    fn correct<'py>(
        &mut self,
        py: Python<'py>,
        indicated: PyReadonlyArray1<'py, f64>,
        velocity: Column<'py>,
        temperature: Column<'py>,
        torque: Column<'py>,
        direction: Column<'py>,
        threads: Option<i64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let columns = [direction, velocity, temperature, torque];
        self.run(py, Quantity::Correction, &indicated, &columns, threads)
    }

    #[pyo3(signature = (theta, velocity, temperature, torque, direction))]
    fn error<'py>(
        &mut self,
        py: Python<'py>,
        theta: PyReadonlyArray1<'py, f64>,
        velocity: Column<'py>,
        temperature: Column<'py>,
        torque: Column<'py>,
        direction: Column<'py>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let columns = [direction, velocity, temperature, torque];
        self.run(py, Quantity::Error, &theta, &columns, None)
    }
}

impl PyCorrector {
    fn run<'py>(
        &mut self,
        py: Python<'py>,
        quantity: Quantity,
        angles: &PyReadonlyArray1<'py, f64>,
        columns: &[Column<'py>; 4],
        wanted: Option<i64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let angles = angles.as_slice()?;
        let mut slices = [None; 4];
        for (slice, column) in slices.iter_mut().zip(columns) {
            *slice = column
                .as_ref()
                .map(|column| column.as_slice())
                .transpose()?;
        }
        let [direction, velocity, temperature, torque] = slices;
        let columns = Columns {
            direction,
            velocity,
            temperature,
            torque,
        };
        let threads = threads(py, wanted, angles.len())?;
        let mut out = vec![0.0; angles.len()];
        py.detach(|| self.0.run(quantity, angles, &columns, threads, &mut out))?;
        Ok(PyArray1::from_vec(py, out))
    }
}

/// A term of `trueangle.terms`, read attribute by attribute.
fn term(object: &Bound<'_, PyAny>) -> PyResult<Term> {
    let number = |name: &str| object.getattr(name)?.extract::<f64>();
    let kind: String = object.getattr("kind")?.extract()?;
    Ok(match kind.as_str() {
        "backlash" => Term::Backlash {
            half_width: number("half_width")?,
        },
        "presliding_hysteresis" => Term::PreslidingHysteresis {
            amplitude: number("amplitude")?,
            length: number("length")?,
            start: number("start")?,
        },
        "latency" => Term::Latency {
            delay: number("delay_s")?,
        },
        "filter_lag" => Term::FilterLag {
            cutoff: number("cutoff_hz")?,
        },
        "thermal_drift" => Term::ThermalDrift {
            zero: number("zero_per_K")?,
            pattern: number("pattern_per_K")?,
            lines: lines(object)?,
            reference: number("reference_C")?,
        },
        "torsional_compliance" => Term::TorsionalCompliance {
            linear: number("per_Nm")?,
            lines: lines(object)?,
        },
        "stiffening_compliance" => Term::StiffeningCompliance {
            linear: number("per_Nm")?,
            cubic: number("per_Nm3")?,
            beyond: number("beyond_knee_per_Nm")?,
            knee: number("knee_Nm")?,
            gravity: object.getattr("gravity")?.extract()?,
        },
        "load_dependent_gear_error" => Term::LoadDependentGearError {
            lines: lines(object)?,
            absolute: object.getattr("torque")?.extract::<String>()? == "absolute",
        },
        "local_defect" => Term::LocalDefect {
            place: number("place")?,
            width: number("width")?,
            height: number("height")?,
            cycles: number("cycles_per_turn")?,
        },
        other => {
            return Err(argument_error(
                object.py(),
                format!("the core knows no term of kind {other:?}"),
            ));
        }
    })
}

fn lines(object: &Bound<'_, PyAny>) -> PyResult<Vec<Line>> {
    let list = |name: &str| object.getattr(name)?.extract::<Vec<f64>>();
    let (orders, cosine, sine) = (list("orders")?, list("cosine")?, list("sine")?);
    Ok(orders
        .into_iter()
        .zip(cosine.into_iter().zip(sine))
        .map(|(order, (cosine, sine))| Line {
            order,
            cosine,
            sine,
        })
        .collect())
}
