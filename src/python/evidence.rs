//! `_core.Evidence`: orders, coefficients and noise of readings by their evidence.

use nalgebra::DMatrix;
use numpy::{PyArray1, PyArray2, PyReadonlyArray1};
use pyo3::prelude::*;

use super::array::{columns, values, vector};
use super::failure::argument_error;
use super::release::detached;
use crate::check::{not_negative, same_length};
use crate::error::Error;
use crate::evidence::{
    CORRELATION_TIMES, Model, Noise, NoisePrior, Posterior, Readings, Run, TERMS, VARIANCES,
};

type Vector<'py> = Bound<'py, PyArray1<f64>>;
type Matrix<'py> = Bound<'py, PyArray2<f64>>;
type Column<'py> = PyReadonlyArray1<'py, f64>;

/// Angles, errors, times and weights of a run.
type Given<'py> = (
    Column<'py>,
    Column<'py>,
    Option<Column<'py>>,
    Option<Column<'py>>,
);

/// Log evidence, mean and covariance of all coefficients.
pub(super) type Solution<'py> = (f64, Vector<'py>, Matrix<'py>);

/// Weight, tau and omega of a model.
type Weighted = (f64, Vec<f64>, Vec<f64>);

/// Cosine and sine of an order beside the others, and their variances.
type Alone = (f64, f64, f64, f64);

/// Probabilities, places of the orders that some model has, their mean and covariance, variances of
/// the noise, and of what of it differs within runs, models, variances of the zeros of runs, and each
/// order by itself (None where the others hold it).
type Estimated<'py> = (
    Vector<'py>,
    Vec<usize>,
    Vector<'py>,
    Matrix<'py>,
    Vector<'py>,
    Vector<'py>,
    Vec<Weighted>,
    Vector<'py>,
    Vec<Option<Alone>>,
);

pub(super) const LOST: &str =
    "no evidence can be computed: a covariance is not positive by rounding";

/// Readings of runs, and the orders that are tested.
#[pyclass(name = "Evidence", module = "trueangle._core", frozen)]
pub struct PyEvidence(Readings);

#[pymethods]
impl PyEvidence {
    #[classattr]
    const CORRELATION_TIMES: [f64; TERMS] = CORRELATION_TIMES;

    /// Of angles in radians, errors, times (None: equally spaced) and weights of each run.
    #[new]
    fn new(py: Python<'_>, runs: Vec<Given<'_>>, orders: Vec<f64>) -> PyResult<Self> {
        let given: Vec<_> = runs
            .iter()
            .map(|(theta, error, time, weights)| {
                let more = [time, weights].map(|column| column.as_ref().map(values));
                (values(theta), values(error), more)
            })
            .collect();
        let made = detached(py, || {
            let mut runs = Vec::with_capacity(given.len());
            for (run, (theta, error, [time, weights])) in given.iter().enumerate() {
                let made = Run::new(theta, error, time.as_deref());
                let made = made.and_then(|own| match weights {
                    Some(weights) => own.weighted(weights),
                    None => Ok(own),
                });
                runs.push(made.map_err(|cause| Error::InRun {
                    run,
                    cause: Box::new(cause),
                })?);
            }
            Readings::new(runs, orders)
        })?;
        Ok(Self(made?))
    }

    /// Log evidence, mean and covariance of the coefficients under a noise and a model.
    fn posterior<'py>(
        &self,
        py: Python<'py>,
        noise: [f64; VARIANCES],
        tau: Vec<f64>,
        omega: Vec<f64>,
    ) -> PyResult<Solution<'py>> {
        let noise = Self::noise_of(py, noise)?;
        let model = self.model(tau, omega)?;
        let found = detached(py, || {
            let posterior = model.posterior(&self.0.grams(noise))?;
            let covariance = posterior.covariance();
            Some((posterior, covariance))
        })?;
        let (posterior, own) = found.ok_or_else(|| argument_error(py, LOST.into()))?;
        solution(py, &posterior, &own, 2 * self.0.orders().len())
    }

    /// Variances of the noise at the maximum of evidence and weak prior, whose scale is a variance.
    fn noise<'py>(
        &self,
        py: Python<'py>,
        tau: Vec<f64>,
        omega: Vec<f64>,
        scale: f64,
    ) -> PyResult<Vector<'py>> {
        if !(scale > 0.0 && scale.is_finite()) {
            return Err(argument_error(
                py,
                format!("scale must be above 0 and finite, got {scale}"),
            ));
        }
        let (model, prior) = (self.model(tau, omega)?, NoisePrior { scale, least: 0.0 });
        let found = detached(py, || self.0.noise(&model, prior, prior.centre()))?;
        let found = found.ok_or_else(|| argument_error(py, LOST.into()))?;
        vector(py, &found.noise.variances())
    }

    /// The mixture over models under a known noise, sought from a model and from none.
    fn under<'py>(
        &self,
        py: Python<'py>,
        noise: [f64; VARIANCES],
        probabilities: Vec<f64>,
        tau: Vec<f64>,
        omega: Vec<f64>,
    ) -> PyResult<(Vec<Weighted>, Vector<'py>, Matrix<'py>)> {
        let noise = Self::noise_of(py, noise)?;
        self.check_probabilities(py, &probabilities)?;
        let start = self.model(tau, omega)?;
        let found = detached(py, || self.0.under(noise, &probabilities, start))?;
        let found = found.ok_or_else(|| argument_error(py, LOST.into()))?;
        let n = found.mean.len();
        Ok((
            weighted(found.models),
            vector(py, found.mean.as_slice())?,
            columns(py, found.covariance.as_slice(), &[n, n])?,
        ))
    }

    /// The mixture over models and noises, from prior probabilities of the orders.
    fn estimate<'py>(&self, py: Python<'py>, probabilities: Vec<f64>) -> PyResult<Estimated<'py>> {
        self.check_probabilities(py, &probabilities)?;
        let found = detached(py, || self.0.estimate(&probabilities))?;
        let found = found.ok_or_else(|| argument_error(py, LOST.into()))?;
        let n = found.mean.len();
        let alone = found.alone.iter().map(|own| {
            let (b, variance) = own.alone()?;
            Some((b[0], b[1], variance[(0, 0)], variance[(1, 1)]))
        });
        Ok((
            vector(py, &found.probabilities)?,
            found.places,
            vector(py, found.mean.as_slice())?,
            columns(py, found.covariance.as_slice(), &[n, n])?,
            vector(py, &found.noise.variances())?,
            vector(py, &found.within)?,
            weighted(found.models),
            vector(py, &found.zeros)?,
            alone.collect(),
        ))
    }
}

impl PyEvidence {
    fn noise_of(py: Python<'_>, noise: [f64; VARIANCES]) -> PyResult<Noise> {
        not_negative("noise", &noise)?;
        if noise[0] == 0.0 {
            let problem = "noise[0], the white variance, must be above 0";
            return Err(argument_error(py, problem.into()));
        }
        Ok(Noise::of(noise))
    }

    fn check_probabilities(&self, py: Python<'_>, probabilities: &[f64]) -> PyResult<()> {
        let orders = self.0.orders().len();
        same_length("probabilities", probabilities.len(), "orders", orders)?;
        if let Some(wrong) = probabilities.iter().find(|p| !(**p > 0.0 && **p < 1.0)) {
            let problem = format!("probabilities must be above 0 and below 1, got {wrong}");
            return Err(argument_error(py, problem));
        }
        Ok(())
    }

    fn model(&self, tau: Vec<f64>, omega: Vec<f64>) -> PyResult<Model> {
        let orders = self.0.orders().len();
        for (name, variances) in [("tau", &tau), ("omega", &omega)] {
            same_length(name, variances.len(), "orders", orders)?;
            not_negative(name, variances)?;
        }
        let widths = vec![2; orders];
        Ok(Model { widths, tau, omega })
    }
}

/// What a posterior says of all `n` coefficients; nothing of those that are out.
pub(super) fn solution<'py>(
    py: Python<'py>,
    posterior: &Posterior,
    own: &DMatrix<f64>,
    n: usize,
) -> PyResult<Solution<'py>> {
    let (mut mean, mut covariance) = (vec![0.0; n], vec![0.0; n * n]);
    for (i, &c) in posterior.columns.iter().enumerate() {
        mean[c] = posterior.mean[(i, 0)];
        for (k, &d) in posterior.columns.iter().enumerate() {
            covariance[c * n + d] = own[(i, k)];
        }
    }
    let covariance = columns(py, &covariance, &[n, n])?;
    Ok((posterior.log_evidence, vector(py, &mean)?, covariance))
}

fn weighted(models: Vec<(f64, Model)>) -> Vec<Weighted> {
    let models = models.into_iter();
    models
        .map(|(weight, own)| (weight, own.tau, own.omega))
        .collect()
}
