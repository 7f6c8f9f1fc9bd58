//! Fit of a harmonic series to runs of readings.
//!
//! `indicated - reference = zero of the run + sum of A cos + B sin + noise`: the
//! harmonics are shared by all runs, the zero is each run's own.

mod check;
mod counts;
mod folds;
mod preview;
mod reduction;
mod residuals;

use std::f64::consts::TAU;

use crate::angle::Period;
use crate::design::{Design, Frequencies};
use crate::error::Error;
use crate::lstsq::{Estimate, System};
use crate::moments::accumulator::Accumulator;
use crate::readings::Readings;
use crate::series::{HarmonicSeries, Shaft};
use crate::{rank, threads};

pub use crate::readings::{Argument, Run};
use counts::Counts;
pub use folds::Fold;
use preview::Watched;
use reduction::Reduced;
pub use residuals::{Scan, median_magnitude, sample, scan};

/// How the least-squares problem was solved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// Householder QR of the design matrix, block by block.
    Plain,
    /// One pass of piecewise moments, normal equations by Cholesky: well-conditioned
    /// problems only.
    Moments,
    /// One pass of piecewise moments, one small QR of their factors: the design is not squared.
    Qr,
    /// One mean per count of an encoder that counts, then one of the others: for an
    /// argument of whole numbers, up to 2^17 to a turn.
    Counts,
}

/// A fitted series, with what is known of its uncertainty.
#[derive(Clone, Debug)]
pub struct Solution {
    /// Zero of each run in `(-period/2, period/2]`.
    pub offsets: Vec<f64>,
    /// Standard error of each zero.
    pub offset_std: Vec<f64>,
    /// Circular mean of the zeros; where they cancel on the circle, the first.
    pub constant: f64,
    /// Weighted sum of squared residuals per degree of freedom; NaN without any.
    pub residual_variance: f64,
    /// Readings that count minus unknowns; with a ridge, the effective unknowns.
    pub degrees_of_freedom: f64,
    /// Unknowns determined: all of them, or there is an error instead.
    pub rank: usize,
    /// The path taken.
    pub method: Method,
    /// What no residual of a reading that counts exceeds, signs left away: infinite where that
    /// was not looked for while the readings were summed.
    pub residual_bound: f64,
    system: System,
    condition_number: Option<f64>,
    /// What it does not exceed.
    condition_bound: f64,
    scatter: f64,
    design: Design,
    centres: Vec<f64>,
    count: usize,
    estimate: Estimate,
    /// Derivative of the constant by every zero.
    shares: Vec<f64>,
}

impl Solution {
    /// `A, B` of each order of each shaft in turn.
    pub fn coefficients(&self) -> &[f64] {
        &self.estimate.coefficients
    }

    /// Of the weighted design matrix with one constant column per run, 2-norm; made anew
    /// by every call where the choice of the path did not need it.
    pub fn condition_number(&self) -> f64 {
        let made = || self.system.condition_number();
        self.condition_number.unwrap_or_else(made)
    }

    /// Whether the condition number is below `limit`: where a bound of it is, it is not made.
    pub fn is_conditioned_below(&self, limit: f64) -> bool {
        self.condition_bound < limit || self.condition_number() < limit
    }

    /// The series fitted, its constant the mean zero.
    pub fn series(&self) -> Result<HarmonicSeries, Error> {
        let mut pairs = self.coefficients().chunks_exact(2);
        let shaft = |frequencies: &Frequencies| {
            let own = pairs.by_ref().take(frequencies.orders.len());
            let (cosine, sine) = own.map(|pair| (pair[0], pair[1])).unzip();
            Shaft {
                cycles: frequencies.cycles,
                orders: frequencies.orders.clone(),
                cosine,
                sine,
            }
        };
        let shafts = self.design.shafts().iter().map(shaft).collect();
        HarmonicSeries::new(self.design.period().value(), self.constant, shafts)
    }

    /// The same readings under penalties on the squared coefficients: nothing is read again.
    pub fn penalised(&self, ridge: &[f64]) -> Result<Self, Error> {
        check::penalties(&self.design, ridge)?;
        let reduced = Reduced {
            system: self.system.clone(),
            condition_number: self.condition_number,
            condition_bound: Some(self.condition_bound),
            method: self.method,
            scatter: self.scatter,
            watched: None,
        };
        conclude(
            &self.design,
            reduced,
            &self.centres,
            self.count,
            Some(ridge),
        )
    }

    /// Covariance of `[constant, A, B, ...]`, row by row; NaN without degrees of freedom.
    ///
    /// Made anew by every call, at the price of a solution or more: O(n^3).
    pub fn covariance(&self) -> Vec<f64> {
        let mut covariance = self.estimate.covariance(&self.shares);
        let scale = |value: &mut f64| *value *= self.residual_variance;
        covariance.iter_mut().for_each(scale);
        covariance
    }
}

/// How to fit.
#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
    /// What the harmonics are functions of.
    pub argument: Argument,
    /// The path to take; None for the fastest that keeps the accuracy of QR.
    pub method: Option<Method>,
    /// Penalties on the squared coefficients, one each.
    pub ridge: Option<&'a [f64]>,
    /// Threads; results do not depend on them.
    pub threads: usize,
    /// Whether to look for [`Solution::residual_bound`] while many readings are summed.
    pub watch: bool,
}

impl Default for Options<'_> {
    fn default() -> Self {
        Self {
            argument: Argument::Reference,
            method: None,
            ridge: None,
            threads: threads::available(),
            watch: false,
        }
    }
}

/// Fits `design` to `runs`.
pub fn fit(design: &Design, runs: &[Run], options: Options) -> Result<Solution, Error> {
    let Options {
        argument, ridge, ..
    } = options;
    check::shapes(design, runs, ridge)?;
    let period = design.period();
    let readings: Vec<_> = runs.iter().map(|run| run.readings(argument)).collect();
    let centres: Vec<_> = readings.iter().map(|run| run.centre(period)).collect();
    let counts = match options.method {
        None | Some(Method::Counts) if design.is_periodic() => {
            Counts::of_runs(&readings, &centres, period, options.threads)
        }
        _ => None,
    };
    // A number that is not finite spoils every sum it enters: it is looked for when one has.
    let inspect = || check::angles(runs);
    let mut reduced = match &counts {
        Some(counts) => {
            let means: Vec<_> = counts.iter().map(Counts::readings).collect();
            let centres = vec![0.0; runs.len()];
            let options = Options {
                method: None,
                ..options
            };
            let scatter: f64 = counts.iter().map(|run| run.scatter).sum();
            if !scatter.is_finite() {
                inspect()?;
            }
            let reduced = reduction::reduce(design, &means, &centres, options, inspect)?;
            reduced.counted(scatter)
        }
        None => reduction::reduce(design, &readings, &centres, options, inspect)?,
    };
    if ridge.is_none() {
        let angles = || readings.iter().flat_map(Readings::angles);
        let rounding = || {
            let reach = angles().fold(period.value(), |reach, x| reach.max(x.abs()));
            TAU * f64::EPSILON * reach / period.value()
        };
        let bound = reduced.bound();
        rank::check(design, &reduced.system, bound, rounding, angles)?;
    }
    let count = readings.iter().map(Readings::count).sum();
    conclude(design, reduced, &centres, count, ridge)
}

/// Fits `design` to runs of which the moments are left; its orders must be whole orders,
/// and not too high ones, of the moments' base shaft.
pub fn fit_moments(design: &Design, runs: &[&Accumulator]) -> Result<Solution, Error> {
    check::have_readings(design, runs.iter().map(|run| run.count()))?;
    let mut reduced = reduction::reduce_moments(design, runs)?;
    let rounding = || reduction::FACTOR_ROUNDING;
    let bound = reduced.bound();
    rank::check(design, &reduced.system, bound, rounding, std::iter::empty)?;
    let centres: Vec<_> = runs.iter().map(|run| run.centre()).collect();
    let count = runs.iter().map(|run| run.count()).sum();
    conclude(design, reduced, &centres, count, None)
}

/// The triangle `R` of the weighted rows `[1, harmonics | error - zero]` of a run, row by
/// row: all that the readings say, for whoever solves them in several ways.
pub fn triangle(
    design: &Design,
    run: &Run,
    argument: Argument,
    zero: f64,
    threads: usize,
) -> Result<Vec<f64>, Error> {
    check::lengths(run)?;
    check::angles(std::slice::from_ref(run))?;
    let found = reduction::triangle(design, &run.readings(argument), zero, threads);
    Ok(found.to_rows())
}

/// The same of every stretch of the argument that ends at one of `ends`, and of the rest.
pub fn folds(
    design: &Design,
    run: &Run,
    argument: Argument,
    ends: &[f64],
    zero: f64,
    threads: usize,
) -> Result<Vec<Fold>, Error> {
    check::lengths(run)?;
    let readings = run.readings(argument);
    let found = folds::folds(design, &readings, ends, zero, threads);
    if !found.iter().all(|fold| fold.triangle.is_finite()) {
        check::angles(std::slice::from_ref(run))?;
    }
    Ok(found)
}

/// Solves the reduced system and puts centres and variances back.
fn conclude(
    design: &Design,
    reduced: Reduced,
    centres: &[f64],
    count: usize,
    ridge: Option<&[f64]>,
) -> Result<Solution, Error> {
    let Reduced {
        system,
        condition_number,
        condition_bound,
        method,
        scatter,
        watched,
    } = reduced;
    let period = design.period();
    let estimate = system.solve(ridge).ok_or_else(|| Error::Rank {
        rank: 0,
        unknowns: system.unknowns(),
        orders: design.harmonics().collect(),
        reason: "singular to working precision; fit fewer orders, or give each a ridge".into(),
    })?;

    let degrees_of_freedom = (count as f64 - estimate.unknowns).max(0.0);
    let residual_variance = if degrees_of_freedom > 0.0 {
        (estimate.squares + scatter) / degrees_of_freedom
    } else {
        f64::NAN
    };
    let offsets: Vec<_> = estimate
        .offsets
        .iter()
        .zip(centres)
        .map(|(offset, centre)| period.wrap(offset + centre))
        .collect();
    let (constant, shares) = circular_mean(&offsets, period);
    Ok(Solution {
        offset_std: estimate
            .offset_variances
            .iter()
            .map(|v| (v * residual_variance).sqrt())
            .collect(),
        offsets,
        constant,
        residual_variance,
        degrees_of_freedom,
        rank: system.unknowns(),
        method,
        residual_bound: watched.map_or(f64::INFINITY, |watched| watched.bound(&estimate)),
        system,
        condition_number,
        condition_bound: condition_bound.unwrap_or(f64::INFINITY),
        scatter,
        design: design.clone(),
        centres: centres.to_vec(),
        count,
        estimate,
        shares,
    })
}

/// Circular mean of the zeros, and its derivative by each of them.
fn circular_mean(offsets: &[f64], period: Period) -> (f64, Vec<f64>) {
    /// Mean resultant length below which the direction is rounding.
    const NO_DIRECTION: f64 = 1e-9;
    let turn = TAU / period.value();
    let sine: f64 = offsets.iter().map(|o| (turn * o).sin()).sum();
    let cosine: f64 = offsets.iter().map(|o| (turn * o).cos()).sum();
    let length = sine.hypot(cosine);
    if offsets.len() == 1 || length < NO_DIRECTION * offsets.len() as f64 {
        let mut shares = vec![0.0; offsets.len()];
        shares[0] = 1.0;
        return (offsets[0], shares);
    }
    let mean = sine.atan2(cosine);
    let share = |o: &f64| (turn * o - mean).cos() / length;
    (
        period.wrap(mean / turn),
        offsets.iter().map(share).collect(),
    )
}
