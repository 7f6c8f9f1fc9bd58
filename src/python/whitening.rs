//! `_core.RunEffect`, `_core.Whitener` and `_core.LagCorrelation`: noise that is not white.

use std::sync::Arc;

use numpy::{
    PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArrayDyn,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use super::array::{columns, values, vector};
use super::beside::{PyBeside, by_columns};
use super::failure::argument_error;
use super::linear::{NOT_FINITE, told};
use super::noise::{Bounds, consecutive, weighted};
use super::release::detached;
use crate::check::same_length;
use crate::linear::{Neighbours, Noise, RunEffect};

type Vector<'py> = Bound<'py, PyArray1<f64>>;
type Matrix<'py> = Bound<'py, PyArray2<f64>>;

/// An error whose size is drawn anew in every run (random effect).
#[pyclass(name = "RunEffect", module = "trueangle._core", frozen)]
pub struct PyRunEffect {
    #[pyo3(get)]
    columns: Py<PyArray2<f64>>,
    #[pyo3(get)]
    ratio: f64,
}

#[pymethods]
impl PyRunEffect {
    /// Of these shapes.
    #[new]
    #[pyo3(signature = (columns, ratio=1.0))]
    fn new(columns: Py<PyArray2<f64>>, ratio: f64) -> Self {
        Self { columns, ratio }
    }
}

/// Linear map that makes the noise of every reading independent and equal.
#[pyclass(name = "Whitener", module = "trueangle._core", frozen)]
pub struct PyWhitener {
    pub(super) core: Arc<Noise>,
    #[pyo3(get)]
    bounds: Py<PyAny>,
    #[pyo3(get)]
    pub(super) effects: Py<PyTuple>,
    #[pyo3(get)]
    pub(super) weights: Option<Py<PyArray1<f64>>>,
}

#[pymethods]
impl PyWhitener {
    /// Of runs one after the other.
    #[new]
    #[pyo3(signature = (bounds, rho=0.0, effects=None, weights=None))]
    fn new(
        py: Python<'_>,
        bounds: Bound<'_, PyAny>,
        rho: f64,
        effects: Option<Vec<Py<PyRunEffect>>>,
        weights: Option<Bound<'_, PyArray1<f64>>>,
    ) -> PyResult<Self> {
        let runs: Bounds = bounds.extract()?;
        let effects = effects.unwrap_or_default();
        let n = runs.last().map_or(0, |&(_, stop)| stop);
        let roots = weights.as_ref().map(|weights| {
            let weights = weights.readonly();
            weights.as_array().iter().map(|w| w.sqrt()).collect()
        });
        let roots: Option<Vec<f64>> = roots;
        weighted(py, n, &runs, roots.as_deref())?;
        let mut columns = Vec::with_capacity(effects.len());
        for effect in &effects {
            let own = effect.get().columns.bind(py).readonly();
            same_length("columns", own.shape()[0], "readings", n)?;
            columns.push((own, effect.get().ratio));
        }
        let shapes = columns.iter().map(|(own, _)| by_columns(own));
        let shapes = shapes.collect::<PyResult<Vec<_>>>()?;
        let ratios = columns.iter().map(|(_, ratio)| *ratio);
        let drawn: Vec<_> = shapes
            .iter()
            .zip(ratios)
            .map(|(shapes, ratio)| RunEffect { shapes, ratio })
            .collect();
        let made = detached(py, || Noise::new(runs, rho, roots, &drawn))?;
        Ok(Self {
            core: Arc::new(told(py, made, NOT_FINITE)?),
            bounds: bounds.unbind(),
            effects: PyTuple::new(py, effects)?.unbind(),
            weights: weights.map(Bound::unbind),
        })
    }

    #[getter]
    fn rho(&self) -> f64 {
        self.core.rho()
    }

    #[getter]
    fn root_weights<'py>(&self, py: Python<'py>) -> PyResult<Option<Vector<'py>>> {
        self.core.roots().map(|roots| vector(py, roots)).transpose()
    }

    #[getter]
    fn log_determinant(&self) -> f64 {
        self.core.log_determinant()
    }

    /// The part of `log_determinant` of one run, without that of the weights.
    fn log_determinant_of(&self, py: Python<'_>, run: usize) -> PyResult<f64> {
        let found = self.core.log_determinant_of(run);
        found.ok_or_else(|| argument_error(py, format!("there is no run {run}")))
    }

    /// Nothing to do: white noise, no run effects.
    #[getter]
    fn is_identity(&self) -> bool {
        self.core.correlated().is_white() && !self.core.has_effects()
    }

    /// It is the map of this noise; told without looking at the readings.
    pub(super) fn has(
        &self,
        py: Python<'_>,
        rho: f64,
        effects: Vec<Bound<'_, PyAny>>,
        weights: Option<Bound<'_, PyAny>>,
    ) -> bool {
        let own = self.effects.bind(py);
        let mut pairs = own.iter().zip(&effects);
        let is_weighted = match (&self.weights, &weights) {
            (Some(own), Some(other)) => own.bind(py).is(other),
            (own, other) => own.is_none() && other.is_none(),
        };
        let is_alike = own.len() == effects.len() && pairs.all(|(own, other)| own.is(other));
        self.core.rho() == rho && is_alike && is_weighted
    }

    /// The map applied to a column or to columns.
    fn __call__<'py>(
        &self,
        py: Python<'py>,
        x: PyReadonlyArrayDyn<'py, f64>,
    ) -> PyResult<Bound<'py, PyAny>> {
        same_length("x", x.shape()[0], "readings", self.core.readings())?;
        if x.ndim() == 1 {
            let x: PyReadonlyArray1<'py, f64> = x.as_any().extract()?;
            let x = values(&x);
            let mapped = detached(py, || self.core.map(&x))?;
            return Ok(vector(py, &mapped)?.into_any());
        }
        let x: PyReadonlyArray2<'py, f64> = x.as_any().extract()?;
        let rows = by_columns(&x)?;
        let mapped = detached(py, || self.core.map(&rows))?;
        Ok(columns(py, &mapped, x.shape())?.into_any())
    }

    /// Best guess of the run effects' own share of a raw residual, of all or some.
    #[pyo3(signature = (residual, chosen=None))]
    fn run_part<'py>(
        &self,
        py: Python<'py>,
        residual: PyReadonlyArray1<'py, f64>,
        chosen: Option<Vec<bool>>,
    ) -> PyResult<Vector<'py>> {
        same_length("residual", residual.len(), "readings", self.core.readings())?;
        let mut factors = Vec::new();
        for (effect, chosen) in self.effects.bind(py).iter().zip(chosen.iter().flatten()) {
            let effect = effect.cast_into::<PyRunEffect>()?;
            let width = effect.get().columns.bind(py).shape()[1];
            factors.extend(vec![if *chosen { 1.0 } else { 0.0 }; width]);
        }
        let (residual, factors) = (values(&residual), chosen.map(|_| factors));
        let part = detached(py, || self.core.run_part(&residual, factors.as_deref()))?;
        vector(py, &part)
    }

    /// What run effects take from products of columns, as columns w and shares c: with F the filter
    /// alone, ``map(x) @ map(y)`` is ``F x @ F y`` less, run by run, ``(w @ x) c (w @ y)``.
    fn taken<'py>(&self, py: Python<'py>) -> PyResult<(Matrix<'py>, Matrix<'py>)> {
        let (axes, shares) = detached(py, || self.core.taken())?;
        let runs = self.core.bounds().len();
        let width = shares.len() / runs.max(1);
        let shape = [self.core.readings(), width];
        let shares = vector(py, &shares)?.reshape([runs, width])?;
        Ok((columns(py, &axes, &shape)?, shares))
    }

    /// A fit's orthonormal columns and residual, as columns that are not mapped see them.
    fn beside(
        &self,
        py: Python<'_>,
        q: PyReadonlyArray2<'_, f64>,
        r: PyReadonlyArray1<'_, f64>,
        squares: f64,
        excited: f64,
    ) -> PyResult<PyBeside> {
        same_length("q", q.shape()[0], "readings", self.core.readings())?;
        same_length("r", r.len(), "readings", self.core.readings())?;
        let (q, r) = (by_columns(&q)?, values(&r));
        let made = detached(py, || self.core.beside(&q, &r, squares, excited))?;
        Ok(PyBeside(made))
    }
}

impl PyWhitener {
    /// Of the same readings, under another noise.
    pub(super) fn with(&self, py: Python<'_>, core: Arc<Noise>) -> Self {
        Self {
            core,
            bounds: self.bounds.clone_ref(py),
            effects: self.effects.clone_ref(py),
            weights: self.weights.as_ref().map(|weights| weights.clone_ref(py)),
        }
    }
}

/// Correlation between neighbours within runs, after drift is taken out.
#[pyclass(name = "LagCorrelation", module = "trueangle._core", frozen)]
pub struct PyLagCorrelation {
    pub(super) core: Neighbours,
    pub(super) readings: usize,
}

#[pymethods]
impl PyLagCorrelation {
    /// Of runs whose clock increases.
    #[new]
    fn new(py: Python<'_>, clock: PyReadonlyArray1<'_, f64>, bounds: Bounds) -> PyResult<Self> {
        let readings = clock.len();
        consecutive(py, readings, &bounds)?;
        let clock = values(&clock);
        let core = detached(py, || Neighbours::new(&clock, &bounds))?;
        Ok(Self { core, readings })
    }

    /// Pooled over runs and at least 0; white noise stays exactly white.
    fn __call__(&self, py: Python<'_>, residual: PyReadonlyArray1<'_, f64>) -> PyResult<f64> {
        same_length("residual", residual.len(), "clock", self.readings)?;
        let residual = values(&residual);
        detached(py, || self.core.correlation(&residual))
    }
}
