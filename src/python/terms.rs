//! `_core.Corrector`.

use std::sync::Arc;

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;

use super::failure::argument_error;
use super::series::PySeries;
use super::threads::threads;
use crate::kernel::Quantity;
use crate::terms::{Columns, Corrector, Form, Line, Signal, Signals, Term, Terms};

type Column<'py> = Option<PyReadonlyArray1<'py, f64>>;

/// Correction by a series and its terms, in the order the samples were taken.
#[pyclass(name = "Corrector", module = "trueangle._core")]
pub struct PyCorrector(Corrector);

#[pymethods]
impl PyCorrector {
    #[new]
    fn new(series: &PySeries, terms: Vec<Bound<'_, PyAny>>) -> PyResult<Self> {
        let mut forms = Vec::new();
        for term in &terms {
            let name: String = term.getattr("kind")?.extract()?;
            for object in term.call_method0("forms")?.try_iter()? {
                forms.push(Term {
                    name: name.clone(),
                    form: form(&object?)?,
                });
            }
        }
        let terms = Terms::new(Arc::clone(&series.evaluator), &forms)?;
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

/// A form of `trueangle.correction.forms`, read attribute by attribute.
fn form(object: &Bound<'_, PyAny>) -> PyResult<Form> {
    let number = |name: &str| object.getattr(name)?.extract::<f64>();
    let option = |name: &str| object.getattr(name)?.extract::<Option<f64>>();
    let kind: String = object.get_type().name()?.extract()?;
    Ok(match kind.as_str() {
        "Play" => Form::Play {
            half_width: number("half_width")?,
            lines: lines(object)?,
        },
        "Friction" => Form::Friction {
            amplitude: number("amplitude")?,
            length: number("length")?,
            start: number("start")?,
        },
        "Lag" => Form::Lag {
            delay: number("delay")?,
        },
        "Filter" => Form::Filter {
            frequency: number("frequency")?,
            damping: option("damping")?,
        },
        "Scaled" => Form::Scaled {
            signal: signal(object)?,
            origin: number("origin")?,
            absolute: object.getattr("absolute")?.extract()?,
            level: number("level")?,
            relative: number("relative")?,
            lines: lines(object)?,
        },
        "Spring" => Form::Spring {
            signal: signal(object)?,
            linear: number("linear")?,
            cubic: number("cubic")?,
            beyond: number("beyond")?,
            knee: number("knee")?,
            gravity: option("gravity")?,
        },
        "Bump" => Form::Bump {
            place: number("place")?,
            width: number("width")?,
            height: number("height")?,
            cycles: number("cycles")?,
        },
        other => {
            return Err(argument_error(
                object.py(),
                format!("the core knows no form {other:?}"),
            ));
        }
    })
}

fn signal(object: &Bound<'_, PyAny>) -> PyResult<Signal> {
    let name: String = object.getattr("signal")?.extract()?;
    let found = Signal::ALL.into_iter().find(|signal| signal.name() == name);
    found.ok_or_else(|| {
        let problem = format!("a correction knows no signal {name:?}");
        argument_error(object.py(), problem)
    })
}

fn lines(object: &Bound<'_, PyAny>) -> PyResult<Vec<Line>> {
    let lines: Vec<(f64, f64, f64)> = object.getattr("lines")?.extract()?;
    Ok(lines
        .into_iter()
        .map(|(order, cosine, sine)| Line {
            order,
            cosine,
            sine,
        })
        .collect())
}
