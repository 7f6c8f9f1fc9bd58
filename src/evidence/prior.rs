//! What is assumed before any reading: sizes of groups, which are in, and the noise.

use super::model::Model;
use super::whitening::{CORRELATION_TIMES, Noise, VARIANCES};

/// Standard deviation of the logarithm of each variance of the noise.
const SPREAD: f64 = 2.5;

/// Share of the variance of residuals at which the white variance is centred.
const WHITE: f64 = 0.5;

/// The same of each term, over its correlation time.
///
/// Above the frequencies of their correlation times all terms then have one spectrum, that of a
/// random walk: how slow a noise is that readings show at some frequency is left open, so that what
/// low orders may hold is not taken for theirs because a term of that time is expected to be small.
const WALK: f64 = 1e-4;

/// Of the share of groups in the model that differ from run to run: a beta distribution.
///
/// Where one order changes from mounting to mounting, others do; most designs have none.
const DIFFERENT: f64 = 0.25;
const EQUAL: f64 = 1.0;

/// Shares from which a maximum is sought: white and a little of every term.
const START: [f64; VARIANCES] = [0.5, 0.1, 0.1, 0.1, 0.1, 0.1];

/// Logarithms of the smallest and greatest variance over that of residuals.
const RANGE: (f64, f64) = (-12.0, 4.0);

/// Prior of which groups are in, and of their sizes.
#[derive(Clone, Debug)]
pub struct Prior {
    /// Probability that each group is in; more than 0 and less than 1.
    pub probabilities: Vec<f64>,
    /// Variances of shared coefficients that a group may have, equally probable.
    pub sizes: Vec<f64>,
    /// Variances of what differs from run to run, each as probable as others; empty where there is
    /// one run.
    pub effects: Vec<f64>,
}

impl Prior {
    /// Of groups in readings of variance `total`: sizes from 1e-4 to 4 times that, effects of runs
    /// from 1e-5 to 1 times.
    pub fn of(probabilities: Vec<f64>, total: f64, runs: usize) -> Self {
        let powers = |first: f64, step: f64, count: usize| {
            let power = move |k| total * 10.0_f64.powf(first + step * k as f64);
            (0..count).map(power).collect()
        };
        Self {
            probabilities,
            sizes: powers(-4.0, 0.8, 7),
            effects: if runs > 1 {
                powers(-5.0, 0.5, 11)
            } else {
                Vec::new()
            },
        }
    }

    /// Of some groups alone.
    pub fn among(&self, groups: &[usize]) -> Self {
        Self {
            probabilities: groups.iter().map(|&k| self.probabilities[k]).collect(),
            ..self.clone()
        }
    }

    /// Logarithm of the probability that group `k` is in with one of the sizes, over that it is not,
    /// whatever differs from run to run.
    pub fn log_in(&self, k: usize) -> f64 {
        let p = self.probabilities[k];
        (p / (1.0 - p) / self.sizes.len() as f64).ln()
    }

    /// The same of a group with these variances, in which groups differ being known.
    ///
    /// What runs do not share alone (`tau` of 0) is as probable as that and something shared.
    pub fn log_odds_of(&self, k: usize, tau: f64, omega: f64) -> f64 {
        if tau == 0.0 && omega == 0.0 {
            return 0.0;
        }
        let mut own = self.log_in(k);
        if tau == 0.0 {
            own += (self.sizes.len() as f64).ln();
        }
        if omega > 0.0 {
            own -= ((2 * self.effects.len()) as f64).ln();
        }
        own
    }

    /// Logarithm of the probability that a further group of a model differs, or does not.
    fn log_next(&self, count: Count, differs: bool) -> f64 {
        if self.effects.is_empty() {
            return 0.0;
        }
        let like_it = if differs {
            DIFFERENT + count.different as f64
        } else {
            EQUAL + (count.groups - count.different) as f64
        };
        (like_it / (DIFFERENT + EQUAL + count.groups as f64)).ln()
    }

    /// Change of the logarithm of a model's probability by other variances of group `k`.
    pub fn change(&self, model: &Model, k: usize, tau: f64, omega: f64) -> f64 {
        let others = Count::of((0..model.tau.len()).filter(|&j| j != k), model);
        let with = |tau: f64, omega: f64| match (tau, omega) {
            (0.0, 0.0) => 0.0,
            _ => self.log_odds_of(k, tau, omega) + self.log_next(others, omega > 0.0),
        };
        with(tau, omega) - with(model.tau[k], model.omega[k])
    }

    /// Logarithm of the probability of a model over that of none of the groups.
    pub fn log_odds(&self, model: &Model) -> f64 {
        let mut count = Count::default();
        let mut total = 0.0;
        for k in (0..model.tau.len()).filter(|&k| model.has(k)) {
            let omega = model.omega[k];
            total += self.log_odds_of(k, model.tau[k], omega) + self.log_next(count, omega > 0.0);
            count.add(omega);
        }
        total
    }

    /// Logarithm of the probability of a model.
    pub fn log_probability(&self, model: &Model) -> f64 {
        let none: f64 = self.probabilities.iter().map(|p| (1.0 - p).ln()).sum();
        none + self.log_odds(model)
    }
}

/// Groups in a model, and those of them that differ from run to run.
#[derive(Clone, Copy, Debug, Default)]
struct Count {
    groups: usize,
    different: usize,
}

impl Count {
    /// Of some groups of a model.
    fn of(groups: impl Iterator<Item = usize>, model: &Model) -> Self {
        let mut count = Self::default();
        for k in groups.filter(|&k| model.has(k)) {
            count.add(model.omega[k]);
        }
        count
    }

    fn add(&mut self, omega: f64) {
        self.groups += 1;
        self.different += usize::from(omega > 0.0);
    }
}

/// Prior of the logarithms of the noise's variances: independent normal ones.
#[derive(Clone, Copy, Debug)]
pub struct NoisePrior {
    /// Variance of residuals, which they are relative to.
    pub scale: f64,
    /// Variance that white noise has at least: the rounding of sums.
    pub least: f64,
}

impl NoisePrior {
    /// Variances that a search starts from: all terms have a share.
    pub fn start(&self) -> [f64; VARIANCES] {
        START.map(|share| (self.scale * share).ln())
    }

    /// Where it is greatest.
    pub fn centre(&self) -> [f64; VARIANCES] {
        let share = |j| match j {
            0 => WHITE,
            _ => WALK * CORRELATION_TIMES[j - 1],
        };
        std::array::from_fn(|j| (self.scale * share(j)).ln())
    }

    /// Logarithm of the density, but for a constant.
    pub fn log_density(&self, position: &[f64; VARIANCES]) -> f64 {
        let own = position.iter().zip(self.centre());
        own.map(|(x, centre)| -0.5 * ((x - centre) / SPREAD).powi(2))
            .sum()
    }

    /// Slopes of the logarithm of the density.
    pub fn slopes(&self, position: &[f64; VARIANCES]) -> [f64; VARIANCES] {
        let centre = self.centre();
        std::array::from_fn(|j| (centre[j] - position[j]) / (SPREAD * SPREAD))
    }

    /// Curvature of the logarithm of the density, with the other sign.
    pub fn precision(&self) -> f64 {
        1.0 / (SPREAD * SPREAD)
    }

    /// The position within the smallest and greatest variances that is nearest.
    pub fn within(&self, position: [f64; VARIANCES]) -> [f64; VARIANCES] {
        let [low, high] = [RANGE.0, RANGE.1].map(|end| self.scale.ln() + end);
        let mut within = position.map(|x| x.clamp(low, high));
        within[0] = within[0].max(self.least.ln());
        within
    }

    /// The noise at a position within the bounds.
    pub fn noise(&self, position: &[f64; VARIANCES]) -> Noise {
        Noise::of(self.within(*position).map(f64::exp))
    }
}
