//! Orders, coefficients and noise of readings: the mixture over models and noises.
//!
//! The noise of most evidence with all orders in, so that no strong order is mistaken for slow
//! noise; the search under it; then both again until the set of orders stays. The mixture integrates
//! over the noise on a few points of its posterior, and over the models within Occam's window
//! (Madigan and Raftery 1994).

use nalgebra::{DMatrix, DVector};

use super::candidates::Inside;
use super::gains::Candidate;
use super::gram::Gram;
use super::model::Model;
use super::noise::NoiseFit;
use super::posterior::Posterior;
use super::prior::{NoisePrior, Prior};
use super::readings::{Readings, Run};
use super::search::{Found, Search};
use super::whitening::{Noise, VARIANCES};
use crate::threads;

/// Log probability ratio to the best model up to which a model counts.
const WINDOW: f64 = 6.0;

/// Models that count at most, the best.
const MODELS: usize = 64;

/// Searches for a mode at most.
const ROUNDS: usize = 10;

/// Predicted increase of the log evidence below which noise is known well enough for a first search.
const ROUGH: f64 = 0.1;

/// Strongest orders that the second search starts from.
const STRONGEST: usize = 6;

/// Orders looked at closely at first, and readings for each; more are added as they stand out.
const FIRST: usize = 24;
const READINGS: usize = 6;

/// Orders added after a round at most.
const MORE: usize = 12;

/// Weight over the greatest below which a model under a noise does not count.
const LIGHT: f64 = 1e-4;

/// Smallest variance of residuals and of white noise over that of errors: sums hold no less.
const EXACT: f64 = 1e-12;

/// Smallest variance of errors that is distinguished from zero.
const NOTHING: f64 = 1e-200;

/// Posterior of orders, coefficients and noise.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// Probability that each order is in.
    pub probabilities: Vec<f64>,
    /// Places of the orders that some model has.
    pub places: Vec<usize>,
    /// Mean of each of their coefficients: cosine and sine of every order in turn.
    pub mean: DVector<f64>,
    /// Covariance of these coefficients.
    pub covariance: DMatrix<f64>,
    /// The noise of most evidence.
    pub noise: Noise,
    /// What of its variances readings of a run do not have in common, in the mean of the readings.
    pub within: [f64; VARIANCES],
    /// Models of the mixture over these orders, best first: weight and prior variances.
    pub models: Vec<(f64, Model)>,
    /// Variance of the zero of each run beside known coefficients.
    pub zeros: Vec<f64>,
    /// Every order beside those of the most probable set.
    pub alone: Vec<Candidate>,
}

/// The mixture over models under one noise.
#[derive(Clone, Debug)]
pub struct Mixture {
    /// Weight and prior variances of each model, best first.
    pub models: Vec<(f64, Model)>,
    /// Mean of the coefficients.
    pub mean: DVector<f64>,
    /// Covariance of the coefficients.
    pub covariance: DMatrix<f64>,
}

/// What a noise and a search that agree with each other have found.
struct Mode {
    fit: NoiseFit,
    looked: Vec<usize>,
    models: Vec<Found>,
    others: Vec<Candidate>,
    scores: Vec<f64>,
}

impl Readings {
    /// The estimate under prior probabilities of each order.
    ///
    /// Noise and orders are sought from all sides: with the strongest orders in, so that none passes
    /// for slow noise, with none, so that slow noise passes for no order, and with orders that differ
    /// from run to run, so that no difference passes for slow noise. Where these end apart, the
    /// mixture has all. None where no evidence can be computed: a covariance is not positive by
    /// rounding.
    pub fn estimate(&self, probabilities: &[f64]) -> Option<Estimate> {
        let total = self.variance();
        let prior = Prior::of(probabilities.to_vec(), total, self.runs().len());
        let looked = self.first(&prior, total);
        let noise_prior = NoisePrior {
            scale: self.among(&looked).left(total)?,
            least: EXACT * total,
        };
        let every = Model::of_orders(looked.len(), total);
        let mut starts = vec![
            (looked.clone(), every.clone()),
            (Vec::new(), Model::of_orders(0, 0.0)),
        ];
        if self.runs().len() > 1 {
            let fewest = self.runs().iter().map(Run::len).min().unwrap_or(0);
            let mut different = every;
            for omega in different.omega.iter_mut().take(fewest / READINGS) {
                *omega = total;
            }
            starts.push((looked.clone(), different));
        }
        let mut modes: Vec<Mode> = Vec::new();
        for start in starts {
            let mode = self.settled(&prior, noise_prior, (&looked, total), start, &modes)?;
            modes.extend(mode);
        }
        self.mixture(&modes, &prior, noise_prior)
    }

    /// The mixture over models under a known noise, sought from a model and from none: weights and
    /// models, mean and covariance. None where no evidence can be computed.
    pub fn under(&self, noise: Noise, probabilities: &[f64], start: Model) -> Option<Mixture> {
        let prior = Prior::of(probabilities.to_vec(), self.variance(), self.runs().len());
        let grams = self.grams(noise);
        let mut search = Search::new(&grams, &prior, WINDOW);
        search.from(start)?;
        search.from(Model::of_orders(self.orders().len(), 0.0))?;
        search.widen()?;
        let mut found = search.models();
        found.truncate(MODELS);
        let best = found.first()?.score;
        let weights: Vec<f64> = found.iter().map(|own| (own.score - best).exp()).collect();
        let whole: f64 = weights.iter().sum();
        let posteriors = found.iter().map(|own| own.model.posterior(&grams));
        let posteriors = posteriors.collect::<Option<Vec<Posterior>>>()?;
        let parts: Vec<(f64, &Posterior)> = weights.iter().copied().zip(&posteriors).collect();
        let (mean, covariance) = mixed(2 * self.orders().len(), &parts);
        let models = weights.iter().zip(found);
        Some(Mixture {
            models: models.map(|(w, own)| (w / whole, own.model)).collect(),
            mean,
            covariance,
        })
    }

    /// Noise and search in turn until the set of orders stays, from orders that the noise is first
    /// sought beside; nothing as soon as the noise is one of those known.
    fn settled(
        &self,
        prior: &Prior,
        noise_prior: NoisePrior,
        (looked, total): (&[usize], f64),
        mut now: (Vec<usize>, Model),
        known: &[Mode],
    ) -> Option<Option<Mode>> {
        let is_known = |fit: &NoiseFit| known.iter().any(|m| !m.fit.is_far_from(&fit.position));
        let mut looked = looked.to_vec();
        let mut tried = None;
        let start = noise_prior.start();
        let sought = self.among(&now.0);
        let mut fit = sought.noise_within(&now.1, noise_prior, start, ROUGH)?;
        for round in 1.. {
            let part = self.among(&looked);
            let grams = part.grams(fit.noise);
            let own = prior.among(&looked);
            let mut search = Search::new(&grams, &own, WINDOW);
            let first = search.from(Model::of_orders(looked.len(), 0.0))?;
            let second = search.from(part.strongest(&grams, 0.1 * total))?;
            let best = if second.score > first.score {
                second.model
            } else {
                first.model
            };
            let has: Vec<usize> = (0..looked.len()).filter(|&k| best.has(k)).collect();
            let found = (has.iter().map(|&k| looked[k]).collect(), best.among(&has));
            // The first noise is rough, and of orders that nothing supports yet.
            if (round == 1 || found != now) && round < ROUNDS {
                now = found;
                let sought = self.among(&now.0);
                fit = sought.noise(&now.1, noise_prior, fit.position)?;
                if is_known(&fit) {
                    return Some(None);
                }
                continue;
            }
            let posterior = best.posterior(&grams)?;
            let active = best.active();
            let only_differ = (0..looked.len()).filter(|&k| best.has(k) && best.tau[k] == 0.0);
            let every: Vec<usize> = active.iter().copied().chain(only_differ).collect();
            let inside = Inside {
                places: &every.iter().map(|&k| looked[k]).collect::<Vec<_>>(),
                omega: &every.iter().map(|&k| best.omega[k]).collect::<Vec<_>>(),
                tau: &active.iter().map(|&k| best.tau[k]).collect::<Vec<_>>(),
                mean: posterior.mean.as_slice(),
                covariance: &posterior.covariance(),
            };
            let others = self.candidates(fit.noise, &inside);
            let score =
                |(k, other): (usize, &Candidate)| other.best(&prior.sizes).1 + prior.log_in(k);
            let scores: Vec<f64> = others.iter().enumerate().map(score).collect();
            let more = self.standing_out(&scores, &looked);
            // Where none of the last was taken, none of the weaker ones would be.
            if more.is_empty() || tried.as_ref() == Some(&now.0) || round >= ROUNDS {
                search.widen()?;
                let models = search.models();
                return Some(Some(Mode {
                    fit,
                    looked,
                    models,
                    others,
                    scores,
                }));
            }
            tried = Some(now.0.clone());
            looked.extend(more);
            looked.sort_unstable();
        }
        None
    }

    /// Orders looked at first: the lowest, which slow noise resembles, and the strongest.
    fn first(&self, prior: &Prior, total: f64) -> Vec<usize> {
        let most = ((self.len() - self.runs().len()) / READINGS).clamp(1, FIRST);
        let white = Noise::of([total, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let inside = Inside {
            places: &[],
            omega: &[],
            tau: &[],
            mean: &[],
            covariance: &DMatrix::zeros(0, 0),
        };
        let rank = |(k, own): (usize, &Candidate)| own.best(&prior.sizes).1 + prior.log_in(k);
        let each: Vec<f64> = self
            .candidates(white, &inside)
            .iter()
            .enumerate()
            .map(rank)
            .collect();
        let mut ranked: Vec<usize> = (0..each.len()).collect();
        ranked.sort_by(|&a, &b| each[b].total_cmp(&each[a]));
        let lowest = (0..each.len()).take(most / 2);
        let mut found: Vec<usize> = lowest.collect();
        for k in ranked {
            if found.len() < most.min(each.len()) && !found.contains(&k) {
                found.push(k);
            }
        }
        found.sort_unstable();
        found
    }

    /// Orders beside those looked at that a model within the window may have, the best of them.
    fn standing_out(&self, scores: &[f64], looked: &[usize]) -> Vec<usize> {
        let is_new = |k: &usize| scores[*k] > -WINDOW && looked.binary_search(k).is_err();
        let mut found: Vec<usize> = (0..scores.len()).filter(is_new).collect();
        found.sort_by(|&a, &b| scores[b].total_cmp(&scores[a]));
        found.truncate(MORE);
        found
    }

    /// Variance of the errors.
    fn variance(&self) -> f64 {
        let squares = |run: &Run| run.error().iter().map(|e| e * e).sum::<f64>();
        let total: f64 = self.runs().iter().map(squares).sum();
        (total / self.len() as f64).max(NOTHING)
    }

    /// Variance of what all orders leave of the errors.
    fn left(&self, total: f64) -> Option<f64> {
        let grams = self.grams(Noise::of([total, 0.0, 0.0, 0.0, 0.0, 0.0]));
        let wide = 1e6 * total;
        let found = Model::of_orders(self.orders().len(), wide).posterior(&grams)?;
        let unknowns: f64 = found
            .covariance()
            .diagonal()
            .map(|own| 1.0 - own / wide)
            .sum();
        let free = (self.len() - self.runs().len()) as f64 - unknowns;
        let left = total * found.residual[(0, 0)] / free.max(1.0);
        Some(left.max(EXACT * total))
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
    fn mixture(&self, modes: &[Mode], prior: &Prior, noise_prior: NoisePrior) -> Option<Estimate> {
        let has = |mode: &Mode, k: usize| {
            let mut counted = mode.models.iter().take(MODELS);
            counted.any(|found| found.model.has(k))
        };
        let own = |mode: &Mode| -> Vec<usize> {
            let kept = (0..mode.looked.len()).filter(|&k| has(mode, k));
            kept.map(|k| mode.looked[k]).collect()
        };
        let mut places: Vec<usize> = modes.iter().flat_map(own).collect();
        places.sort_unstable();
        places.dedup();
        let readings = self.among(&places).holding();
        let some = prior.among(&places);
        let mut parts = Vec::new();
        for (m, mode) in modes.iter().enumerate() {
            let points = mode.fit.points();
            let volume = mode.fit.log_volume();
            let models: Vec<Model> = mode
                .models
                .iter()
                .take(MODELS)
                .map(|found| found.model.among_places(&mode.looked, &places))
                .collect();
            let part = |i: usize| {
                let at = noise_prior.log_density(&points[i]) + volume;
                let grams = readings.grams(noise_prior.noise(&points[i]));
                let own = |model: &Model| {
                    let found = model.posterior(&grams)?;
                    Some((found.log_evidence + some.log_odds(model) + at, found))
                };
                models.iter().map(own).collect::<Vec<_>>()
            };
            let each: Vec<_> = threads::map_parts(points.len(), self.threads(), part).collect();
            for (k, model) in models.iter().enumerate() {
                let at_points = each.iter().filter_map(|point| point[k].clone());
                parts.push((m, model.clone(), at_points.collect::<Vec<_>>()));
            }
        }
        let scores = parts
            .iter()
            .flat_map(|(_, _, at)| at.iter().map(|(score, _)| *score));
        let best = scores.clone().fold(f64::NEG_INFINITY, f64::max);
        let whole: f64 = scores.map(|score| (score - best).exp()).sum();
        let mut heavy = Vec::new();
        let mut of_modes = vec![0.0; modes.len()];
        let mut models = Vec::new();
        for (m, model, at) in &parts {
            let mut weight = 0.0;
            for (score, posterior) in at {
                let relative = (score - best).exp();
                weight += relative / whole;
                if relative > LIGHT {
                    heavy.push((relative, posterior));
                }
            }
            of_modes[*m] += weight;
            models.push((weight, model.clone()));
        }
        let (mean, covariance) = mixed(2 * places.len(), &heavy);
        let heaviest = (0..modes.len()).max_by(|&a, &b| of_modes[a].total_cmp(&of_modes[b]));
        let mode = &modes[heaviest?];
        let outside = |k: usize| mode.scores[k].min(-WINDOW).exp();
        let mut probabilities: Vec<f64> = (0..self.orders().len()).map(outside).collect();
        for (k, &place) in places.iter().enumerate() {
            let own = models.iter().filter(|(_, model)| model.tau[k] > 0.0);
            probabilities[place] = own.map(|(weight, _)| weight).sum::<f64>().min(1.0);
        }
        models.sort_by(|a, b| b.0.total_cmp(&a.0));
        let noise = mode.fit.noise;
        let grams = readings.grams(noise).into_iter();
        let mut within = [0.0; VARIANCES];
        for run in readings.runs() {
            let share = run.len() as f64 / readings.len() as f64;
            let own = run.within(noise).variances();
            within
                .iter_mut()
                .zip(own)
                .for_each(|(sum, v)| *sum += share * v);
        }
        Some(Estimate {
            probabilities,
            mean,
            covariance,
            noise,
            within,
            models,
            zeros: grams
                .zip(readings.runs())
                .map(|(gram, run)| run.zero_variance(noise, gram.information))
                .collect(),
            alone: mode.others.clone(),
            places,
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
