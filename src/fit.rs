//! Fit of a harmonic series to runs of readings.
//!
//! `indicated - reference = zero of the run + sum of A cos + B sin + noise`: the
//! harmonics are shared by all runs, the zero is each run's own.

mod check;
mod path;
mod run;

use crate::angle::Period;
use crate::design::Design;
use crate::error::Error;
use crate::{rank, threads};

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
    check::check(design, runs, ridge)?;
    let period = design.period();
    let centres: Vec<_> = runs.iter().map(|run| run.centre(period)).collect();
    let (system, condition_number, method) = path::reduce(design, runs, &centres, options)?;
    if ridge.is_none() {
        let angles = || runs.iter().flat_map(|run| run.angles(argument));
        let reach = || angles().fold(0.0, |reach: f64, x| reach.max(x.abs()));
        rank::check(design, &system, condition_number, reach, angles)?;
    }
    let readings = runs.iter().map(Run::count).sum::<usize>();
    let estimate = system.solve(ridge).ok_or_else(|| Error::Rank {
        rank: 0,
        unknowns: system.unknowns(),
        orders: design.harmonics().collect(),
        reason: "the penalised problem is singular; give every order a positive ridge".into(),
    })?;

    let degrees_of_freedom = (readings as f64 - estimate.unknowns).max(0.0);
    let residual_variance = if degrees_of_freedom > 0.0 {
        estimate.squares / degrees_of_freedom
    } else {
        f64::NAN
    };
    let offsets: Vec<_> = estimate
        .offsets
        .iter()
        .zip(&centres)
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
    let turn = std::f64::consts::TAU / period.value();
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
