//! `_core.Groups` and `_core.GroupSums`: groups of any columns by their evidence.

use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::array::{columns, values, vector};
use super::evidence::{LOST, Solution, solution};
use super::failure::argument_error;
use super::release::detached;
use crate::check::{not_negative, same_length};
use crate::error::Error;
use crate::evidence::{GroupSums, Model, Noise, NoisePrior, Readings, Run, VARIANCES};

type Vector<'py> = Bound<'py, PyArray1<f64>>;
type Matrix<'py> = Bound<'py, PyArray2<f64>>;

/// Predicted increase of the log evidence below which a noise is the best: tests ask for more.
const CLOSE: f64 = 0.01;

/// Columns (a row for each reading), errors and times of a run.
type Given<'py> = (
    PyReadonlyArray2<'py, f64>,
    PyReadonlyArray1<'py, f64>,
    Option<PyReadonlyArray1<'py, f64>>,
);

/// Readings of runs, and groups of columns.
#[pyclass(name = "Groups", module = "trueangle._core", frozen)]
pub struct PyGroups(Readings);

#[pymethods]
impl PyGroups {
    /// Of columns, errors and times (None: equally spaced) of each run, and columns of each group.
    #[new]
    fn new(py: Python<'_>, runs: Vec<Given<'_>>, widths: Vec<usize>) -> PyResult<Self> {
        let given: Vec<_> = runs
            .iter()
            .map(|(table, error, time)| {
                let rows: Vec<f64> = table.as_array().iter().copied().collect();
                (
                    rows,
                    table.shape()[1],
                    values(error),
                    time.as_ref().map(values),
                )
            })
            .collect();
        let made = detached(py, || {
            let mut runs = Vec::with_capacity(given.len());
            for (run, (rows, width, error, time)) in given.iter().enumerate() {
                let made = Run::of_columns(rows, *width, error, time.as_deref());
                runs.push(made.map_err(|cause| Error::InRun {
                    run,
                    cause: Box::new(cause),
                })?);
            }
            Readings::of_groups(runs, widths)
        })?;
        Ok(Self(made?))
    }

    /// Variances of the noise of most evidence beside groups with these variances, each run with a
    /// zero of its own; from `start`, where given, and to a hundredth in the log evidence.
    #[pyo3(signature = (tau, scale, start=None))]
    fn noise<'py>(
        &self,
        py: Python<'py>,
        tau: Vec<f64>,
        scale: f64,
        start: Option<[f64; VARIANCES]>,
    ) -> PyResult<Vector<'py>> {
        if !(scale > 0.0 && scale.is_finite()) {
            let problem = format!("scale must be above 0 and finite, got {scale}");
            return Err(argument_error(py, problem));
        }
        let groups = self.0.widths();
        check(&tau, groups.len())?;
        let prior = NoisePrior { scale, least: 0.0 };
        let inside: Vec<usize> = (0..tau.len()).filter(|&k| tau[k] > 0.0).collect();
        let found = detached(py, || {
            let model = Model::of_groups(groups, tau).among(&inside);
            let start = start.map_or_else(|| prior.start(), |own| own.map(f64::ln));
            let own = self.0.among(&inside);
            own.noise_within(&model, prior, start, CLOSE)
        })?;
        let found = found.ok_or_else(|| argument_error(py, LOST.into()))?;
        vector(py, &found.noise.variances())
    }

    /// Sums of all runs with one zero under a noise; `total` is the variance that sizes of groups
    /// are relative to.
    fn sums(&self, py: Python<'_>, noise: [f64; VARIANCES], total: f64) -> PyResult<PyGroupSums> {
        not_negative("noise", &noise)?;
        if !(noise[0] > 0.0 && total > 0.0 && total.is_finite()) {
            let problem = "noise[0], the white variance, and total must be above 0".into();
            return Err(argument_error(py, problem));
        }
        let found = detached(py, || self.0.group_sums(Noise::of(noise), total))?;
        Ok(PyGroupSums(found))
    }
}

/// What models of groups need of readings under a noise.
#[pyclass(name = "GroupSums", module = "trueangle._core", frozen)]
pub struct PyGroupSums(GroupSums);

#[pymethods]
impl PyGroupSums {
    /// Score and variances of the best groups beside those given, from those of `start`; groups of
    /// probability 0 stay out.
    fn search(
        &self,
        py: Python<'_>,
        given: Vec<f64>,
        probabilities: Vec<f64>,
        start: Vec<f64>,
    ) -> PyResult<(f64, Vec<f64>)> {
        let groups = self.0.widths().len();
        check(&given, groups)?;
        check(&start, groups)?;
        same_length("probabilities", probabilities.len(), "widths", groups)?;
        if let Some(wrong) = probabilities.iter().find(|p| !(0.0..1.0).contains(*p)) {
            let problem = format!("probabilities must be from 0 to below 1, got {wrong}");
            return Err(argument_error(py, problem));
        }
        let found = detached(py, || self.0.search(&given, &probabilities, &start))?;
        let found = found.ok_or_else(|| argument_error(py, LOST.into()))?;
        Ok((found.score, found.model.tau))
    }

    /// Inverse covariance of the coefficients of all columns, without a zero beside them.
    fn information<'py>(&self, py: Python<'py>) -> PyResult<Matrix<'py>> {
        let found = self.0.information();
        columns(py, found.as_slice(), &[found.nrows(), found.ncols()])
    }

    /// Log evidence, mean and covariance of the coefficients under variances of the groups.
    fn posterior<'py>(&self, py: Python<'py>, tau: Vec<f64>) -> PyResult<Solution<'py>> {
        check(&tau, self.0.widths().len())?;
        let found = detached(py, || {
            let posterior = self.0.posterior(&tau)?;
            let covariance = posterior.covariance();
            Some((posterior, covariance))
        })?;
        let (posterior, own) = found.ok_or_else(|| argument_error(py, LOST.into()))?;
        solution(py, &posterior, &own, self.0.widths().iter().sum())
    }

    /// What each group's leaving takes, what its coming in gives, and that of each (columns) in
    /// place of another (rows).
    fn changes<'py>(
        &self,
        py: Python<'py>,
        tau: Vec<f64>,
    ) -> PyResult<(Vector<'py>, Vector<'py>, Matrix<'py>)> {
        let groups = self.0.widths().len();
        check(&tau, groups)?;
        let found = detached(py, || self.0.changes(&tau))?;
        let found = found.ok_or_else(|| argument_error(py, LOST.into()))?;
        Ok((
            vector(py, &found.losses)?,
            vector(py, &found.gains)?,
            columns(py, found.instead.as_slice(), &[groups, groups])?,
        ))
    }
}

fn check(tau: &[f64], groups: usize) -> Result<(), Error> {
    same_length("tau", tau.len(), "widths", groups)?;
    not_negative("tau", tau)
}
