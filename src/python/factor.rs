//! `_core.Whitener`, `_core.Factor` and the fit whose noise is that of what it leaves.

use std::borrow::Cow;
use std::sync::Arc;

use numpy::{
    PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArrayDyn,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyTuple;

use super::array::vector;
use super::beside::{PyBeside, by_columns};
use super::failure::argument_error;
use super::linear::{NOT_FINITE, told};
use super::noise::{Bounds, consecutive};
use super::release::detached;
use crate::check::same_length;
use crate::linear::{
    self, Correlated, Factor, Fitted, Neighbours, Noise, Observed, RunEffect, Settled,
};

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
    core: Arc<Noise>,
    #[pyo3(get)]
    bounds: Py<PyAny>,
    #[pyo3(get)]
    effects: Py<PyTuple>,
    #[pyo3(get)]
    weights: Option<Py<PyArray1<f64>>>,
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
        let noise = Correlated {
            bounds: &runs,
            rho,
            roots: roots.as_deref(),
        };
        consecutive(py, n, &noise)?;
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
    fn has(
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
    fn with(&self, py: Python<'_>, core: Arc<Noise>) -> Self {
        Self {
            core,
            bounds: self.bounds.clone_ref(py),
            effects: self.effects.clone_ref(py),
            weights: self.weights.as_ref().map(|weights| weights.clone_ref(py)),
        }
    }
}

/// Correlation between neighbours within runs, after wander is taken out.
#[pyclass(name = "LagCorrelation", module = "trueangle._core", frozen)]
pub struct PyLagCorrelation {
    core: Neighbours,
    readings: usize,
}

#[pymethods]
impl PyLagCorrelation {
    /// Of runs whose clock increases.
    #[new]
    fn new(py: Python<'_>, clock: PyReadonlyArray1<'_, f64>, bounds: Bounds) -> PyResult<Self> {
        let noise = Correlated {
            bounds: &bounds,
            rho: 0.0,
            roots: None,
        };
        let readings = clock.len();
        consecutive(py, readings, &noise)?;
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

/// Columns X under a noise: ``Q = M X B`` with orthonormal columns.
#[pyclass(name = "Factor", module = "trueangle._core", frozen)]
pub struct PyFactor {
    core: Arc<Factor>,
    #[pyo3(get)]
    whiten: Py<PyWhitener>,
    #[pyo3(get)]
    design: Py<PyArray2<f64>>,
    basis: PyOnceLock<Py<PyArray2<f64>>>,
}

/// Coefficients, the residual under the map, and its sum of squares.
type Told<'py> = (Vector<'py>, Vector<'py>, f64);

#[pymethods]
impl PyFactor {
    /// Of columns that nobody changes.
    #[new]
    fn new(py: Python<'_>, whiten: Py<PyWhitener>, design: Matrix<'_>) -> PyResult<Self> {
        let noise = whiten.get().core.clone();
        same_length("design", design.shape()[0], "readings", noise.readings())?;
        let design = standing(py, design)?;
        let core = {
            let columns = design.readonly();
            let columns = columns.as_slice()?;
            detached(py, || Factor::of(noise, columns))?
        };
        let core = Arc::new(told(py, core, NOT_FINITE)?);
        Ok(Self::of(core, whiten, design.unbind()))
    }

    /// Columns that are told apart.
    #[getter]
    fn rank(&self) -> usize {
        self.core.back().ncols()
    }

    /// B: coefficients are ``back @ (q.T @ M y)``, the smallest ones where columns are alike.
    #[getter]
    fn back<'py>(&self, py: Python<'py>) -> PyResult<Matrix<'py>> {
        let back = self.core.back();
        columns(py, back.as_slice(), &[back.nrows(), back.ncols()])
    }

    /// Q, shape (n, rank).
    #[getter]
    fn q<'py>(&self, py: Python<'py>) -> PyResult<Matrix<'py>> {
        let made = self.basis.get_or_try_init(py, || {
            let design = self.design.bind(py).readonly();
            let design = design.as_slice()?;
            let basis = detached(py, || self.core.basis(design))?;
            PyResult::Ok(columns(py, basis.as_slice(), &[basis.nrows(), basis.ncols()])?.unbind())
        })?;
        Ok(made.bind(py).clone())
    }

    /// Coefficients of the columns for a target.
    fn coefficients<'py>(
        &self,
        py: Python<'py>,
        target: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Vector<'py>> {
        Ok(self.project(py, target)?.0)
    }

    /// Coefficients where those at some places are held at 0, outliers clipped as in a fit of the
    /// others.
    fn without<'py>(
        &self,
        py: Python<'py>,
        held: Vec<usize>,
        readings: PyReadonlyArray1<'py, f64>,
        roots: PyReadonlyArray1<'py, f64>,
        rounding: f64,
        neighbours: &PyLagCorrelation,
    ) -> PyResult<Vector<'py>> {
        let n = self.core.noise().readings();
        same_length("readings", readings.len(), "those of the noise", n)?;
        same_length("roots", roots.len(), "readings", n)?;
        let columns = self.core.back().nrows();
        if let Some(place) = held.iter().find(|&&place| place >= columns) {
            let problem = format!("held must be places of the {columns} columns, got {place}");
            return Err(argument_error(py, problem));
        }
        let design = self.design.bind(py).readonly();
        let design = design.as_slice()?;
        let (readings, roots) = (values(&readings), values(&roots));
        let observed = Observed {
            readings: &readings,
            roots: &roots,
            rounding,
            neighbours: &neighbours.core,
        };
        let found = detached(py, || linear::without(observed, design, &self.core, &held))?;
        vector(py, &told(py, found, NOT_FINITE)?)
    }

    /// A target fitted by the columns.
    fn project<'py>(
        &self,
        py: Python<'py>,
        target: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Told<'py>> {
        let n = self.core.noise().readings();
        same_length("target", target.len(), "readings", n)?;
        let design = self.design.bind(py).readonly();
        let (design, target) = (design.as_slice()?, values(&target));
        let fitted = detached(py, || self.core.fitted(design, &target))?;
        shown(py, &fitted)
    }
}

impl PyFactor {
    fn of(core: Arc<Factor>, whiten: Py<PyWhitener>, design: Py<PyArray2<f64>>) -> Self {
        Self {
            core,
            whiten,
            design,
            basis: PyOnceLock::new(),
        }
    }
}

/// What a fit is under the noise of what it leaves: factors of the noises that it passed through,
/// its own first; coefficients, residual and sum of squares; the readings, outliers clipped, and
/// which are outliers. Noises and factors of a fit before are not made anew.
#[pyfunction]
#[pyo3(signature = (design, readings, roots, rounding, neighbours, whiten, rho, before))]
#[allow(clippy::type_complexity)]
pub fn settled<'py>(
    py: Python<'py>,
    design: Matrix<'py>,
    readings: PyReadonlyArray1<'py, f64>,
    roots: PyReadonlyArray1<'py, f64>,
    rounding: f64,
    neighbours: &PyLagCorrelation,
    whiten: Py<PyWhitener>,
    rho: Option<f64>,
    before: Vec<Py<PyFactor>>,
) -> PyResult<(
    Vec<PyFactor>,
    Told<'py>,
    Vector<'py>,
    Bound<'py, PyArray1<bool>>,
)> {
    let n = whiten.get().core.readings();
    same_length("design", design.shape()[0], "readings", n)?;
    same_length("readings", readings.len(), "those of the noise", n)?;
    same_length("roots", roots.len(), "readings", n)?;
    same_length("neighbours", neighbours.readings, "readings", n)?;
    let design = standing(py, design)?;
    let alike = |factor: &PyWhitener| {
        let effects: Vec<_> = whiten.get().effects.bind(py).iter().collect();
        let weights = whiten.get().weights.as_ref().map(|w| w.bind(py).clone());
        factor.has(py, factor.core.rho(), effects, weights.map(Bound::into_any))
    };
    let known: Vec<_> = before
        .iter()
        .map(Py::get)
        .filter(|factor| alike(factor.whiten.get()))
        .collect();
    let noises: Vec<Arc<Noise>> = known
        .iter()
        .map(|factor| factor.core.noise().clone())
        .chain([whiten.get().core.clone()])
        .collect();
    let same = known.iter().filter(|factor| factor.design.is(&design));
    let factors: Vec<Arc<Factor>> = same.map(|factor| factor.core.clone()).collect();
    let found = {
        let columns = design.readonly();
        let columns = columns.as_slice()?;
        let (readings, roots) = (values(&readings), values(&roots));
        let observed = Observed {
            readings: &readings,
            roots: &roots,
            rounding,
            neighbours: &neighbours.core,
        };
        let factor = |rho: f64| {
            if let Some(known) = factors.iter().find(|f| f.noise().rho() == rho) {
                return Some(known.clone());
            }
            let noise = match noises.iter().find(|noise| noise.rho() == rho) {
                Some(noise) => noise.clone(),
                None => Arc::new(noises[0].with_rho(rho)?),
            };
            Factor::of(noise, columns).map(Arc::new)
        };
        detached(py, || linear::settled(observed, columns, rho, factor))?
    };
    let Settled {
        fitted,
        factors,
        target,
        outlying,
    } = told(py, found, NOT_FINITE)?;
    let mut passed = Vec::with_capacity(factors.len());
    for factor in factors {
        let theirs = known.iter().map(|factor| &factor.whiten).chain([&whiten]);
        let whiten = match theirs
            .into_iter()
            .find(|whiten| Arc::ptr_eq(&whiten.get().core, factor.noise()))
        {
            Some(whiten) => whiten.clone_ref(py),
            None => Py::new(py, whiten.get().with(py, factor.noise().clone()))?,
        };
        passed.push(PyFactor::of(factor, whiten, design.clone().unbind()));
    }
    Ok((
        passed,
        shown(py, &fitted)?,
        vector(py, &target)?,
        vector(py, &outlying)?,
    ))
}

/// Flags that stand in stretches of few; none goes over two runs.
#[pyfunction]
pub fn short_stretches<'py>(
    py: Python<'py>,
    flags: PyReadonlyArray1<'py, bool>,
    bounds: Bounds,
) -> PyResult<Bound<'py, PyArray1<bool>>> {
    let noise = Correlated {
        bounds: &bounds,
        rho: 0.0,
        roots: None,
    };
    consecutive(py, flags.len(), &noise)?;
    vector(py, &linear::short_stretches(flags.as_slice()?, &bounds))
}

/// Numbers one after the other.
fn values<'a>(array: &'a PyReadonlyArray1<'_, f64>) -> Cow<'a, [f64]> {
    let copied = |_| Cow::Owned(array.as_array().iter().copied().collect());
    array.as_slice().map_or_else(copied, Cow::Borrowed)
}

fn shown<'py>(py: Python<'py>, fitted: &Fitted) -> PyResult<Told<'py>> {
    let coefficients = vector(py, &fitted.coefficients)?;
    Ok((coefficients, vector(py, &fitted.residual)?, fitted.squares))
}

/// Columns as numpy has them that stand one after the other.
fn columns<'py>(py: Python<'py>, values: &[f64], shape: &[usize]) -> PyResult<Matrix<'py>> {
    vector(py, values)?
        .reshape([shape[1], shape[0]])?
        .transpose()
}

/// The same columns, one after the other.
fn standing<'py>(py: Python<'py>, design: Matrix<'py>) -> PyResult<Matrix<'py>> {
    if design.is_fortran_contiguous() {
        return Ok(design);
    }
    let rows = design.readonly();
    columns(py, &by_columns(&rows)?, design.shape())
}
