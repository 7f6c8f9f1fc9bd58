//! Fit of a harmonic series to runs of readings.
//!
//! `indicated - reference = zero of the run + sum of A cos + B sin + noise`: the
//! harmonics are shared by all runs, the zero is each run's own.

pub(crate) mod check;
mod path;
mod run;

use std::f64::consts::TAU;

use crate::angle::Period;
use crate::design::Design;
use crate::error::Error;
use crate::moments::accumulator::Accumulator;
use crate::moments::readings::Readings;
use crate::{rank, threads};

use path::Reduced;
pub use run::{Argument, Run};

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
    /// `A, B` of each order of each shaft in turn.
    pub coefficients: Vec<f64>,
    /// Covariance of `[constant, A, B, ...]`, row by row; NaN without degrees of freedom.
    pub covariance: Vec<f64>,
    /// Weighted sum of squared residuals per degree of freedom; NaN without any.
    pub residual_variance: f64,
    /// Readings that count minus unknowns; with a ridge, the effective unknowns.
    pub degrees_of_freedom: f64,
    /// Unknowns determined: all of them, or there is an error instead.
    pub rank: usize,
    /// Of the weighted design matrix with one constant column per run, 2-norm.
    pub condition_number: f64,
    /// The path taken.
    pub method: Method,
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
}

impl Default for Options<'_> {
    fn default() -> Self {
        Self {
            argument: Argument::Reference,
            method: None,
            ridge: None,
            threads: threads::available(),
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
    // A number that is not finite spoils every sum it enters: it is looked for when one has.
    let reduced = path::reduce(design, &readings, &centres, options, || check::angles(runs))?;
    if ridge.is_none() {
        let angles = || readings.iter().flat_map(Readings::angles);
        let rounding = || {
            let reach = angles().fold(period.value(), |reach, x| reach.max(x.abs()));
            TAU * f64::EPSILON * reach / period.value()
        };
        let (system, condition) = (&reduced.system, reduced.condition_number);
        rank::check(design, system, condition, rounding, angles)?;
    }
    let count = readings.iter().map(Readings::count).sum();
    conclude(design, reduced, &centres, count, ridge)
}

/// Fits `design` to runs of which the moments are left; its orders must be whole orders,
/// and not too high ones, of the moments' base shaft.
pub fn fit_moments(design: &Design, runs: &[&Accumulator]) -> Result<Solution, Error> {
    check::have_readings(design, runs.iter().map(|run| run.count()))?;
    let reduced = path::reduce_moments(design, runs)?;
    let (system, condition) = (&reduced.system, reduced.condition_number);
    rank::check(
        design,
        system,
        condition,
        || path::FACTOR_ROUNDING,
        std::iter::empty,
    )?;
    let centres: Vec<_> = runs.iter().map(|run| run.centre()).collect();
    let count = runs.iter().map(|run| run.count()).sum();
    conclude(design, reduced, &centres, count, None)
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
        method,
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
        estimate.squares / degrees_of_freedom
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
    let mut covariance = estimate.covariance(&shares);
    covariance.iter_mut().for_each(|c| *c *= residual_variance);
    Ok(Solution {
        offset_std: estimate
            .offset_variances
            .iter()
            .map(|v| (v * residual_variance).sqrt())
            .collect(),
        offsets,
        constant,
        coefficients: estimate.coefficients,
        covariance,
        residual_variance,
        degrees_of_freedom,
        rank: system.unknowns(),
        condition_number,
        method,
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
