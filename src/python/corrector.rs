//! `_core.Corrector`.

use std::sync::Arc;

use numpy::PyUntypedArrayMethods;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use super::door::{self, Computation, Computed};
use super::failure::{argument_error, missing_other};
use super::number::{is_number, single};
use super::release::{attached, detached};
use super::series::PySeries;
use super::signals::{Taken, as_signal, broadcast, columns};
use super::terms::{OTHER, forms, signal_of};
use super::threads::{Asked, threads};
use crate::error::Error;
use crate::kernel::{Batch, Quantity, Real, Sample, Stretch};
use crate::terms::{Columns, Corrector, Signal, Signals, Terms};

/// Correction by a series and its terms, in the order the samples were taken.
#[pyclass(name = "Corrector", module = "trueangle._core")]
pub struct PyCorrector {
    inner: Corrector,
    /// What it was made of.
    parts: Py<PyTuple>,
    /// Names of the other joints' angles that it takes, in the order of [`Signal::OTHERS`].
    others: Vec<String>,
}

/// A signal as the caller gave it.
type Given<'a, 'py> = Option<&'a Bound<'py, PyAny>>;

#[pymethods]
impl PyCorrector {
    #[new]
    fn new(series: &Bound<'_, PySeries>, terms: Vec<Bound<'_, PyAny>>) -> PyResult<Self> {
        let py = series.py();
        let parts = (series, terms.clone()).into_pyobject(py)?.unbind();
        let series = series.get();
        let (terms, others) = forms(&terms)?;
        if !series.evaluator.is_ready(Quantity::Correction) {
            series.evaluator.room()?;
        }
        let evaluator = Arc::clone(&series.evaluator);
        // Tables may be made here, which takes a while.
        let terms = detached(py, || Terms::new(evaluator, &terms))??;
        Ok(Self {
            inner: Corrector::new(Arc::new(terms)),
            parts,
            others,
        })
    }

    fn __reduce__<'py>(
        slf: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>, Vec<f64>)> {
        let own = slf.borrow();
        let parts = own.parts.bind(slf.py()).clone();
        Ok((slf.get_type().into_any(), parts, own.store()))
    }

    fn __setstate__(&mut self, py: Python<'_>, numbers: Vec<f64>) -> PyResult<()> {
        self.restore(py, numbers)
    }

    #[pyo3(signature = (indicated, /, velocity=None, temperature=None, torque=None, direction=None, current=None, **others))]
    fn step(
        &mut self,
        indicated: &Bound<'_, PyAny>,
        velocity: Given<'_, '_>,
        temperature: Given<'_, '_>,
        torque: Given<'_, '_>,
        direction: Given<'_, '_>,
        current: Given<'_, '_>,
        others: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<f64> {
        let py = indicated.py();
        let angle = single(indicated, "the angle of a step")?;
        let terms = self.inner.terms();
        let mut signals = Signals::default();
        for (signal, given) in [
            (Signal::Direction, direction),
            (Signal::Velocity, velocity),
            (Signal::Temperature, temperature),
            (Signal::Torque, torque),
            (Signal::Current, current),
        ] {
            if let Some(given) = given
                && terms.takes(signal)
            {
                signals = signals.with(signal, single(given, signal.name())?);
            }
        }
        for (name, given) in others.into_iter().flatten() {
            let name: String = name.extract()?;
            if !given.is_none()
                && let Some(signal) = self.signal(&name)?
            {
                signals = signals.with(signal, single(&given, &name)?);
            }
        }
        self.check_others(py, |signal| signals.get(signal).is_some())?;
        Ok(attached(py, || self.inner.correct(angle, &signals))??)
    }

    /// Another one of the same terms that knows nothing of the past.
    fn fresh(&self, py: Python<'_>) -> Self {
        Self {
            inner: Corrector::new(Arc::clone(self.inner.terms())),
            parts: self.parts.clone_ref(py),
            others: self.others.clone(),
        }
    }

    /// Correct by another one's terms from the next step on; what is known of the past stays
    /// where they can hold it.
    fn swap(&mut self, other: &Bound<'_, Self>) -> PyResult<()> {
        let mut next = other.try_borrow()?.fresh(other.py());
        next.inner.restore(&self.inner.store());
        *self = next;
        Ok(())
    }

    fn reset(&mut self) {
        self.inner.reset();
    }

    fn store(&self) -> Vec<f64> {
        self.inner.store()
    }

    fn restore(&mut self, py: Python<'_>, numbers: Vec<f64>) -> PyResult<()> {
        if self.inner.restore(&numbers) {
            return Ok(());
        }
        let problem = "this is not the state of a corrector with such terms";
        Err(argument_error(py, problem.to_owned()))
    }

    /// True angles, and how many of them lie outside a stretch.
    #[pyo3(signature = (indicated, out=None, *, threads=None, path=None, stretch=None, **signals))]
    fn correct<'py>(
        &mut self,
        indicated: &Bound<'py, PyAny>,
        out: Option<&Bound<'py, PyAny>>,
        threads: Asked<'py>,
        path: Option<&str>,
        stretch: Option<(f64, f64, bool)>,
        signals: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Computed<'py>> {
        let quantity = Quantity::Correction;
        self.compute(quantity, indicated, out, signals, threads, path, stretch)
    }

    /// Errors; of nothing else, so none lies outside anything.
    #[pyo3(signature = (theta, out=None, *, threads=None, path=None, **signals))]
    fn error<'py>(
        &mut self,
        theta: &Bound<'py, PyAny>,
        out: Option<&Bound<'py, PyAny>>,
        threads: Asked<'py>,
        path: Option<&str>,
        signals: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let quantity = Quantity::Error;
        Ok(self
            .compute(quantity, theta, out, signals, threads, path, None)?
            .0)
    }
}

/// A batch through a corrector, as the caller wants it.
struct Wish<'c> {
    corrector: &'c mut Corrector,
    quantity: Quantity,
    columns: Columns<'c>,
    threads: Option<usize>,
    stretch: Option<Stretch>,
}

impl Computation for Wish<'_> {
    fn run<X: Sample, Y: Real>(&mut self, batch: Batch<'_, X, Y>) -> Result<usize, Error> {
        let stretch = self.stretch.as_ref();
        let (columns, threads) = (&self.columns, self.threads);
        self.corrector
            .run(self.quantity, batch, columns, threads, stretch)
    }

    fn prepare(&self) -> Result<(), Error> {
        self.corrector.terms().evaluator().room()
    }

    fn is_ready(&self) -> bool {
        self.corrector.terms().evaluator().is_ready(self.quantity)
    }
}

impl PyCorrector {
    /// The series and its terms.
    pub fn terms(&self) -> &Arc<Terms> {
        self.inner.terms()
    }

    /// Names of the other joints' angles that it takes.
    pub fn others(&self) -> &[String] {
        &self.others
    }

    /// The signal of a keyword argument; None of the angle of a joint that no term is about.
    ///
    /// Signals that are not needed are ignored; what no correction knows is refused.
    fn signal(&self, name: &str) -> PyResult<Option<Signal>> {
        let found = signal_of(name, &self.others);
        if found.is_none() && !name.starts_with(OTHER) {
            let known: Vec<_> = Signal::NAMED.iter().map(|signal| signal.name()).collect();
            return Err(PyTypeError::new_err(format!(
                "got an unexpected keyword argument '{name}'; signals are {}",
                known.join(", ")
            )));
        }
        Ok(found)
    }

    /// The same again, with its past.
    pub fn twin(&self, py: Python<'_>) -> Self {
        Self {
            inner: self.inner.clone(),
            parts: self.parts.clone_ref(py),
            others: self.others.clone(),
        }
    }

    /// Refuses to go on without the angle of another joint, by its name.
    pub fn check_others(&self, py: Python<'_>, given: impl Fn(Signal) -> bool) -> PyResult<()> {
        let mut named = self.others.iter().zip(Signal::OTHERS);
        match named.find(|(_, signal)| !given(**signal)) {
            Some((name, _)) => Err(missing_other(py, name)?),
            None => Ok(()),
        }
    }

    fn compute<'py>(
        &mut self,
        quantity: Quantity,
        x: &Bound<'py, PyAny>,
        out: Option<&Bound<'py, PyAny>>,
        given: Option<&Bound<'py, PyDict>>,
        asked: Asked<'py>,
        path: Option<&str>,
        stretch: Option<(f64, f64, bool)>,
    ) -> PyResult<Computed<'py>> {
        let py = x.py();
        if door::route(py, path)?.is_some() {
            let problem = "path is a choice of models without terms: leave it out";
            return Err(argument_error(py, problem.to_owned()));
        }
        let terms = self.inner.terms();
        let mut signals = match given {
            Some(given) => self.taken(given)?,
            None => Vec::new(),
        };
        self.check_others(py, |signal| {
            signals.iter().any(|(known, _)| *known == signal)
        })?;
        let period = terms.evaluator().series().period().value();
        let stretch = door::stretch(period, stretch);
        let alone = signals.iter().all(|(_, values)| values.len() == 1);
        let angles = if out.is_none() && is_number(x) && alone {
            None
        } else {
            Some(broadcast(x, &mut signals)?)
        };
        let columns = columns(&signals);
        let samples = angles.as_ref().map_or(1, |angles| angles.plain.len());
        let mut wish = Wish {
            quantity,
            columns,
            threads: threads(py, asked.as_ref(), samples)?,
            stretch,
            corrector: &mut self.inner,
        };
        match &angles {
            None => door::number(x, &mut wish),
            Some(angles) => {
                let beside: Vec<_> = signals.iter().map(|(_, values)| values).collect();
                door::array(angles, out, &beside, &mut wish)
            }
        }
    }

    /// Those of the given signals that the terms take.
    pub fn taken<'py>(&self, given: &Bound<'py, PyDict>) -> PyResult<Vec<Taken<'py>>> {
        let mut taken = Vec::with_capacity(given.len());
        for (name, values) in given {
            let name: String = name.extract()?;
            if let Some(signal) = self.signal(&name)?
                && !values.is_none()
                && self.inner.terms().takes(signal)
            {
                taken.push((signal, as_signal(&values, &name)?));
            }
        }
        Ok(taken)
    }
}
