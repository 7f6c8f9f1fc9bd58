//! Orders, coefficients and noise of readings: the mixture over models and noises.
//!
//! The noise of most evidence with all orders in, so that no strong order is mistaken for slow
//! noise; the search under it; then both again until the set of orders stays. The mixture integrates
//! over the noise on a few points of its posterior, and over the models within Occam's window
//! (Madigan and Raftery 1994).

use nalgebra::{DMatrix, DVector};

use super::gram::Gram;
use super::model::Model;
use super::noise::NoiseFit;
use super::posterior::Posterior;
use super::prior::{NoisePrior, Prior};
use super::readings::Readings;
use super::search::{Found, Search};
use super::whitening::Noise;
use crate::threads;

/// Log probability ratio to the best model up to which a model counts.
const WINDOW: f64 = 6.0;

/// Rounds of noise and search at most.
const ROUNDS: usize = 3;

/// Strongest orders that the second search starts from.
const STRONGEST: usize = 6;

/// Weight over the greatest below which a model under a noise does not count.
const LIGHT: f64 = 1e-4;

/// Smallest variance of residuals over that of errors: sums of squares hold no less.
const EXACT: f64 = 1e-12;

/// Smallest variance of errors that is distinguished from zero.
const NOTHING: f64 = 1e-200;

/// Posterior of orders, coefficients and noise.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// Probability that each order is in.
    pub probabilities: Vec<f64>,
    /// Mean of each coefficient: cosine and sine of every order in turn.
    pub mean: DVector<f64>,
    /// Covariance of the coefficients.
    pub covariance: DMatrix<f64>,
    /// The noise of most evidence.
    pub noise: Noise,
    /// Models of the mixture, best first: weight and prior variances.
    pub models: Vec<(f64, Model)>,
}

impl Readings {
    /// The estimate under prior probabilities of each order.
    ///
    /// None where no evidence can be computed: a covariance is not positive by rounding.
    pub fn estimate(&self, probabilities: &[f64]) -> Option<Estimate> {
        let orders = self.orders().len();
        let (total, scale) = self.scales(orders)?;
        let prior = Prior::of(probabilities.to_vec(), total, self.runs().len());
        let noise_prior = NoisePrior { scale };
        let mut start = noise_prior.centre();
        let mut model = Model::of_orders(orders, total);
        let mut models = Vec::new();
        let mut active = None;
        for _ in 0..ROUNDS {
            let fit = self.noise(&model, noise_prior, start)?;
            start = fit.position;
            let mut search = Search::new(&fit.grams, &prior, WINDOW);
            let first = search.from(Model::of_orders(orders, 0.0))?;
            let second = search.from(self.strongest(&fit.grams, 0.1 * total))?;
            model = if second.score > first.score {
                second.model
            } else {
                first.model
            };
            models = search.models();
            let set = Some(model.active());
            if active == set {
                break;
            }
            active = set;
        }
        let fit = self.noise(&model, noise_prior, start)?;
        self.mixture(&fit, &prior, noise_prior, models)
    }

    /// Variances of the errors, and of what all orders leave of them.
    fn scales(&self, orders: usize) -> Option<(f64, f64)> {
        let squares = |run: &super::Run| run.error().iter().map(|e| e * e).sum::<f64>();
        let total: f64 = self.runs().iter().map(squares).sum();
        let total = (total / self.len() as f64).max(NOTHING);
        let grams = self.grams(Noise::of([total, 0.0, 0.0, 0.0, 0.0, 0.0]));
        let wide = 1e6 * total;
        let found = Model::of_orders(orders, wide).posterior(&grams)?;
        let unknowns: f64 = found
            .covariance()
            .diagonal()
            .map(|own| 1.0 - own / wide)
            .sum();
        let free = (self.len() - self.runs().len()) as f64 - unknowns;
        let left = total * found.residual[(0, 0)] / free.max(1.0);
        Some((total, left.max(EXACT * total)))
    }

    /// The orders that the error follows most.
    fn strongest(&self, grams: &[Gram], tau: f64) -> Model {
        let mut model = Model::of_orders(self.orders().len(), 0.0);
        let power = |k: usize| -> f64 {
            let moment = |c: usize| grams.iter().map(|g| g.sums.moments[(c, 0)]).sum::<f64>();
            let own = |c: usize| grams.iter().map(|g| g.sums.products[(c, c)]).sum::<f64>();
            let each = |c: usize| moment(c).powi(2) / own(c).max(f64::MIN_POSITIVE);
            each(2 * k) + each(2 * k + 1)
        };
        let powers: Vec<f64> = (0..model.tau.len()).map(power).collect();
        let mut ranked: Vec<usize> = (0..powers.len()).collect();
        ranked.sort_by(|&a, &b| powers[b].total_cmp(&powers[a]));
        for &k in ranked.iter().take(STRONGEST) {
            model.tau[k] = tau;
        }
        model
    }

    /// Over models and points of the noise's posterior.
    fn mixture(
        &self,
        fit: &NoiseFit,
        prior: &Prior,
        noise_prior: NoisePrior,
        models: Vec<Found>,
    ) -> Option<Estimate> {
        let points = fit.points();
        let models: Vec<(f64, Model)> = models
            .into_iter()
            .map(|found| (prior.log_probability(&found.model), found.model))
            .collect();
        let part = |i: usize| {
            let at = noise_prior.log_density(&points[i]);
            let grams = self.grams(noise_prior.noise(&points[i]));
            let own = |(log_prior, model): &(f64, Model)| {
                let found = model.posterior(&grams)?;
                Some((found.log_evidence + log_prior + at, found))
            };
            models.iter().map(own).collect::<Vec<_>>()
        };
        let parts: Vec<_> = threads::map_parts(points.len(), self.threads(), part).collect();
        let scores = parts.iter().flatten().flatten().map(|(score, _)| *score);
        let best = scores.clone().fold(f64::NEG_INFINITY, f64::max);
        let whole: f64 = scores.map(|score| (score - best).exp()).sum();
        let mut weights = vec![0.0; models.len()];
        let mut heavy = Vec::new();
        for part in &parts {
            for (k, found) in part.iter().enumerate() {
                let Some((score, posterior)) = found else {
                    continue;
                };
                let relative = (score - best).exp();
                weights[k] += relative / whole;
                if relative > LIGHT {
                    heavy.push((relative, posterior));
                }
            }
        }
        let (mean, covariance) = mixed(2 * self.orders().len(), &heavy);
        let probability = |k: usize| {
            let own = models
                .iter()
                .zip(&weights)
                .filter(|((_, model), _)| model.tau[k] > 0.0);
            own.map(|(_, weight)| weight).sum()
        };
        let probabilities = (0..self.orders().len()).map(probability).collect();
        let mut models: Vec<(f64, Model)> = weights
            .into_iter()
            .zip(models.into_iter().map(|(_, model)| model))
            .collect();
        models.sort_by(|a, b| b.0.total_cmp(&a.0));
        Some(Estimate {
            probabilities,
            mean,
            covariance,
            noise: fit.noise,
            models,
        })
    }
}

/// Mean and covariance of a mixture of normal distributions, the coefficients of groups that are out
/// being zero.
fn mixed(columns: usize, parts: &[(f64, &Posterior)]) -> (DVector<f64>, DMatrix<f64>) {
    let whole: f64 = parts.iter().map(|(weight, _)| weight).sum();
    let mut mean = DVector::zeros(columns);
    for (weight, posterior) in parts {
        for (i, &c) in posterior.columns.iter().enumerate() {
            mean[c] += weight / whole * posterior.mean[(i, 0)];
        }
    }
    let mut total = DMatrix::zeros(columns, columns);
    for (weight, posterior) in parts {
        let covariance = posterior.covariance();
        let mut apart = -&mean;
        for (i, &c) in posterior.columns.iter().enumerate() {
            apart[c] += posterior.mean[(i, 0)];
            for (k, &d) in posterior.columns.iter().enumerate() {
                total[(c, d)] += weight / whole * covariance[(i, k)];
            }
        }
        total.ger(weight / whole, &apart, &apart, 1.0);
    }
    (mean, total)
}
