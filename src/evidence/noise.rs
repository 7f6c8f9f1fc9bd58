//! The noise at the maximum of the evidence, and a few points of its posterior.
//!
//! Newton steps in the logarithms of the variances, with the average information as curvature,
//! damped until the evidence increases. Nothing is random.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::gram::{Gram, Whitened};
use super::information::Information;
use super::model::Model;
use super::posterior::Posterior;
use super::prior::NoisePrior;
use super::readings::Readings;
use super::whitening::{Noise, VARIANCES};
use crate::interrupt;

/// Steps at most; a dozen are usual.
const STEPS: usize = 50;

/// Greatest change of a logarithm in one step.
const LONGEST: f64 = 2.0;

/// Predicted increase of the log evidence below which the maximum is reached.
const CLOSE: f64 = 1e-5;

/// The same within a step.
const ROUGH: f64 = 1e-7;

/// Dampings tried before a step is given up.
const TRIES: usize = 12;

/// Part of the predicted increase from which on the damping is lowered.
const TRUSTED: f64 = 0.25;

/// Where the points of the posterior are, in its standard deviations along each axis.
const APART: f64 = 1.5;

/// The noise of most evidence under a model.
#[derive(Clone, Debug)]
pub struct NoiseFit {
    /// Logarithms of the variances.
    pub position: [f64; VARIANCES],
    /// The noise there.
    pub noise: Noise,
    /// Gram matrices under it.
    pub grams: Vec<Gram>,
    /// Log evidence and log prior of the noise.
    pub value: f64,
    /// Curvature of that, with the other sign.
    pub precision: DMatrix<f64>,
}

/// A noise, and the evidence of a model under it.
struct At<'a> {
    position: [f64; VARIANCES],
    noise: Noise,
    grams: Vec<Gram>,
    whitened: Vec<Whitened<'a>>,
    posterior: Posterior,
    value: f64,
}

impl Readings {
    fn at(&self, model: &Model, prior: NoisePrior, position: [f64; VARIANCES]) -> Option<At<'_>> {
        let noise = prior.noise(&position);
        let (grams, whitened): (Vec<_>, Vec<_>) = self.whitened(noise).into_iter().unzip();
        let posterior = model.posterior(&grams)?;
        let value = posterior.log_evidence + prior.log_density(&position);
        Some(At {
            position,
            noise,
            grams,
            whitened,
            posterior,
            value,
        })
    }

    /// The noise of most evidence under a model, from logarithms of variances to start from.
    ///
    /// None where no evidence can be computed: a covariance is not positive by rounding.
    pub fn noise(
        &self,
        model: &Model,
        prior: NoisePrior,
        start: [f64; VARIANCES],
    ) -> Option<NoiseFit> {
        self.noise_within(model, prior, start, CLOSE)
    }

    /// The same, up to a predicted increase of the log evidence of `close`.
    pub fn noise_within(
        &self,
        model: &Model,
        prior: NoisePrior,
        start: [f64; VARIANCES],
        close: f64,
    ) -> Option<NoiseFit> {
        let held = self.holding();
        let mut now = held.at(model, prior, prior.within(start))?;
        let mut damping = 0.0;
        for step in 0.. {
            let found = held.information_of(model, &now.grams, &now.posterior, &now.whitened)?;
            let near = Near {
                position: now.position,
                found,
                prior,
            };
            let mut better = None;
            for _ in 0..TRIES {
                interrupt::point();
                let (next, gain) = near.best(damping)?;
                if gain < close || step == STEPS {
                    break;
                }
                let next = held.at(model, prior, next);
                if let Some(next) = next.filter(|next| next.value > now.value) {
                    if next.value - now.value > TRUSTED * gain {
                        damping /= 8.0;
                    }
                    better = Some(next);
                    break;
                }
                damping = f64::max(4.0 * damping, 0.5);
            }
            match better {
                Some(next) => now = next,
                None => {
                    return Some(NoiseFit {
                        position: now.position,
                        noise: now.noise,
                        grams: now.grams,
                        value: now.value,
                        precision: near.slopes(&near.position, 0.0).1,
                    });
                }
            }
        }
        None
    }
}

/// The log evidence and log prior near a position.
///
/// With the average information `A`, the relative change `f` of each variance, and its logarithm's
/// where it grows: `g' f - 1/2 f' A f`. A variance that goes to 0 takes the evidence to a limit, which a
/// parabola in its logarithm does not have.
struct Near {
    position: [f64; VARIANCES],
    found: Information,
    prior: NoisePrior,
}

impl Near {
    /// Changes of the variances at a position, and their slopes.
    fn changes(&self, at: &[f64; VARIANCES]) -> (DVector<f64>, DVector<f64>) {
        let apart = DVector::from_fn(VARIANCES, |j, _| at[j] - self.position[j]);
        (
            apart.map(|s| s.min(s.exp_m1())),
            apart.map(|s| s.exp().min(1.0)),
        )
    }

    /// Gradient and curvature, with the other sign, the latter where it is positive.
    fn slopes(&self, at: &[f64; VARIANCES], damping: f64) -> (DVector<f64>, DMatrix<f64>) {
        let (change, slope) = self.changes(at);
        let each = (&self.found.gradient - &self.found.average * change).component_mul(&slope);
        let mut gradient = each.clone() + DVector::from(self.prior.slopes(at).to_vec());
        let scale = DMatrix::from_diagonal(&slope);
        let mut precision = &scale * &self.found.average * &scale;
        for j in 0..VARIANCES {
            let apart = at[j] - self.position[j];
            let own = self.found.average[(j, j)] + f64::max(-self.found.gradient[j], 0.0);
            let held = damping * (own + self.prior.precision());
            gradient[j] -= held * apart;
            // A slope is curvature in the logarithm, too.
            let bend = if apart > 0.0 {
                0.0
            } else {
                f64::max(-each[j], 0.0)
            };
            precision[(j, j)] += self.prior.precision() + bend + held;
        }
        (gradient, precision)
    }

    /// Where it is greatest when damped, and the increase that it predicts.
    fn best(&self, damping: f64) -> Option<([f64; VARIANCES], f64)> {
        let least = self.prior.within(self.position.map(|x| x - LONGEST));
        let most = self.prior.within(self.position.map(|x| x + LONGEST));
        let mut at = self.position;
        for _ in 0..STEPS {
            let (gradient, precision) = self.slopes(&at, damping);
            let (next, gain) = newton(&at, (&gradient, precision), (&least, &most))?;
            at = next;
            if gain < ROUGH {
                break;
            }
        }
        let (change, _) = self.changes(&at);
        let bend = 0.5 * change.dot(&(&self.found.average * &change));
        let prior = self.prior.log_density(&at) - self.prior.log_density(&self.position);
        Some((at, self.found.gradient.dot(&change) - bend + prior))
    }
}

/// A Newton step within bounds, and half of what its slope predicts.
fn newton(
    position: &[f64; VARIANCES],
    (gradient, precision): (&DVector<f64>, DMatrix<f64>),
    (least, most): (&[f64; VARIANCES], &[f64; VARIANCES]),
) -> Option<([f64; VARIANCES], f64)> {
    // At a bound that the gradient points beyond, a variance stays.
    let is_free = |j: &usize| {
        let (x, slope) = (position[*j], gradient[*j]);
        !(x <= least[*j] && slope < 0.0 || x >= most[*j] && slope > 0.0)
    };
    let free: Vec<usize> = (0..VARIANCES).filter(is_free).collect();
    let own = precision.select_rows(&free).select_columns(&free);
    let slopes = gradient.select_rows(&free);
    let mut step = Cholesky::new(own)?.solve(&slopes);
    let longest = step.amax();
    if longest > LONGEST {
        step *= LONGEST / longest;
    }
    let mut next = *position;
    for (i, &j) in free.iter().enumerate() {
        next[j] = (position[j] + step[i]).clamp(least[j], most[j]);
    }
    let moved = |j| gradient[j] * (next[j] - position[j]);
    Some((next, 0.5 * (0..VARIANCES).map(moved).sum::<f64>()))
}

impl NoiseFit {
    /// True of a position beyond one standard deviation of this posterior.
    pub(super) fn is_far_from(&self, position: &[f64; VARIANCES]) -> bool {
        let apart = DVector::from_fn(VARIANCES, |j, _| position[j] - self.position[j]);
        apart.dot(&(&self.precision * &apart)) > 1.0
    }

    /// Logarithm of the volume of its posterior, but for a constant.
    pub(super) fn log_volume(&self) -> f64 {
        let powers = self.precision.clone().symmetric_eigen().eigenvalues;
        -0.5 * powers.iter().map(|power| power.ln()).sum::<f64>()
    }

    /// The maximum, and a point on both sides of it along each principal axis of the curvature.
    pub fn points(&self) -> Vec<[f64; VARIANCES]> {
        let axes = self.precision.clone().symmetric_eigen();
        let mut out = vec![self.position];
        for (axis, power) in axes.eigenvectors.column_iter().zip(&axes.eigenvalues) {
            let apart = APART / power.sqrt();
            for side in [1.0, -1.0] {
                out.push(std::array::from_fn(|j| {
                    self.position[j] + side * apart * axis[j]
                }));
            }
        }
        out
    }
}
