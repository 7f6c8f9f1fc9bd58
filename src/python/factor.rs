//! `_core.Factor` and the fit whose noise is that of what it leaves.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;

use super::array::{columns, values, vector};
use super::beside::by_columns;
use super::failure::argument_error;
use super::linear::{NOT_FINITE, told};
use super::noise::{Bounds, consecutive};
use super::release::detached;
use super::whitening::{PyLagCorrelation, PyWhitener};
use crate::check::same_length;
use crate::linear::{self, Factor, Fitted, Noise, Observed, Settled};

type Vector<'py> = Bound<'py, PyArray1<f64>>;
type Matrix<'py> = Bound<'py, PyArray2<f64>>;

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
    consecutive(py, flags.len(), &bounds)?;
    vector(py, &linear::short_stretches(flags.as_slice()?, &bounds))
}

fn shown<'py>(py: Python<'py>, fitted: &Fitted) -> PyResult<Told<'py>> {
    let coefficients = vector(py, &fitted.coefficients)?;
    Ok((coefficients, vector(py, &fitted.residual)?, fitted.squares))
}

/// The same columns, one after the other.
fn standing<'py>(py: Python<'py>, design: Matrix<'py>) -> PyResult<Matrix<'py>> {
    if design.is_fortran_contiguous() {
        return Ok(design);
    }
    let rows = design.readonly();
    columns(py, &by_columns(&rows)?, design.shape())
}
