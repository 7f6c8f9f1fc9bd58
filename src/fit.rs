//! Fit of a harmonic series to runs of readings.
//!
//! `indicated - reference = zero of the run + sum of A cos + B sin + noise`: the
//! harmonics are shared by all runs, the zero is each run's own.

use crate::angle::{Period, two_sum};
use crate::design::Design;
use crate::error::Error;
use crate::lstsq::{System, Triangle};
use crate::rank;

/// Rows reduced at a time: enough to hide the triangle above them, few enough for the cache.
const BLOCK_ROWS: usize = 256;

/// Readings that a run's circular centre is taken from, at even strides.
const CENTRE_READINGS: usize = 4096;

/// Readings of one run, in any one unit.
#[derive(Clone, Copy, Debug)]
pub struct Run<'a> {
    /// True output angles.
    pub reference: &'a [f64],
    /// What the joint's own encoder says.
    pub indicated: &'a [f64],
    /// Reciprocal variances up to a factor; a reading of weight 0 does not count.
    pub weights: Option<&'a [f64]>,
}

/// Which angle the harmonics are functions of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Argument {
    /// The true angle.
    Reference,
    /// The indicated angle.
    Indicated,
}

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

/// Fits `design` to `runs`; `ridge` penalises the squared coefficients, one penalty each.
pub fn fit(
    design: &Design,
    runs: &[Run],
    argument: Argument,
    ridge: Option<&[f64]>,
) -> Result<Solution, Error> {
    check(design, runs, ridge)?;
    let period = design.period();
    let centres: Vec<_> = runs.iter().map(|run| run.centre(period)).collect();
    let mut system = System {
        runs: Vec::with_capacity(runs.len()),
        shared: Triangle::new(design.columns() + 1),
    };
    for (run, &centre) in runs.iter().zip(&centres) {
        let (pivot, rest) = reduce(design, run, argument, centre).eliminate();
        system.runs.push(pivot);
        system.shared.merge(&rest);
    }
    let readings = runs.iter().map(Run::count).sum::<usize>();
    let condition_number = system.condition_number();
    if ridge.is_none() {
        let angles = || runs.iter().flat_map(|run| run.angles(argument));
        let reach = angles().fold(0.0, |reach: f64, x| reach.max(x.abs()));
        rank::check(design, &system, condition_number, reach, angles())?;
    }
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
        method: Method::Plain,
    })
}

impl Run<'_> {
    fn weight(&self, i: usize) -> f64 {
        self.weights.map_or(1.0, |weights| weights[i])
    }

    /// Readings that count.
    fn count(&self) -> usize {
        match self.weights {
            Some(weights) => weights.iter().filter(|w| **w > 0.0).count(),
            None => self.reference.len(),
        }
    }

    /// Regressor angles of the readings that count.
    fn angles(&self, argument: Argument) -> impl Iterator<Item = f64> {
        let angles = match argument {
            Argument::Reference => self.reference,
            Argument::Indicated => self.indicated,
        };
        let counts = |(i, x): (usize, &f64)| (self.weight(i) > 0.0).then_some(*x);
        angles.iter().enumerate().filter_map(counts)
    }

    /// `indicated - reference - centre` in `(-period/2, period/2]`.
    fn error(&self, i: usize, centre: f64, period: Period) -> f64 {
        // The rounding of the difference matters after many turns: it is carried along.
        let (difference, carry) = two_sum(self.indicated[i], -self.reference[i]);
        period.wrap(period.wrap(difference) + carry - centre)
    }

    /// Circular mean of the errors: no error is cut in two when wrapped around it.
    fn centre(&self, period: Period) -> f64 {
        let turn = std::f64::consts::TAU / period.value();
        let stride = self.reference.len().div_ceil(CENTRE_READINGS).max(1);
        let (mut sine, mut cosine) = (0.0, 0.0);
        for i in (0..self.reference.len()).step_by(stride) {
            let (s, c) = (turn * self.error(i, 0.0, period)).sin_cos();
            sine += self.weight(i) * s;
            cosine += self.weight(i) * c;
        }
        sine.atan2(cosine) / turn
    }
}

/// The triangle of `[1, harmonics | error]` over one run.
fn reduce(design: &Design, run: &Run, argument: Argument, centre: f64) -> Triangle {
    let columns = design.columns() + 2;
    let mut triangle = Triangle::new(columns);
    let mut rows = Vec::with_capacity(BLOCK_ROWS.min(run.reference.len()) * columns);
    let angles = match argument {
        Argument::Reference => run.reference,
        Argument::Indicated => run.indicated,
    };
    for (i, &angle) in angles.iter().enumerate() {
        let scale = run.weight(i).sqrt();
        if scale == 0.0 {
            continue;
        }
        rows.push(scale);
        design.extend_row(&mut rows, angle, scale);
        rows.push(scale * run.error(i, centre, design.period()));
        if rows.len() == BLOCK_ROWS * columns {
            triangle.absorb(&rows);
            rows.clear();
        }
    }
    triangle.absorb(&rows);
    triangle
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

/// Lengths, finite numbers, weights, and that every run has a reading that counts.
fn check(design: &Design, runs: &[Run], ridge: Option<&[f64]>) -> Result<(), Error> {
    if let Some(ridge) = ridge {
        same_length("ridge", ridge.len(), "coefficients", design.columns())?;
        not_negative("ridge", ridge)?;
    }
    for run in runs {
        let wanted = run.reference.len();
        same_length("indicated", run.indicated.len(), "reference", wanted)?;
        finite("reference", run.reference)?;
        finite("indicated", run.indicated)?;
        if let Some(weights) = run.weights {
            same_length("weights", weights.len(), "reference", wanted)?;
            not_negative("weights", weights)?;
        }
    }
    let empty = runs.iter().position(|run| run.count() == 0);
    if runs.is_empty() || empty.is_some() {
        return Err(Error::Rank {
            rank: 0,
            unknowns: runs.len() + design.columns(),
            orders: design.harmonics().collect(),
            reason: match empty {
                Some(run) => format!("run {run} has no reading of positive weight; leave it out"),
                None => "there are no runs".into(),
            },
        });
    }
    Ok(())
}

fn same_length(
    what: &'static str,
    got: usize,
    other: &'static str,
    wanted: usize,
) -> Result<(), Error> {
    if got == wanted {
        return Ok(());
    }
    Err(Error::Length {
        what,
        got,
        other,
        wanted,
    })
}

fn finite(what: &'static str, values: &[f64]) -> Result<(), Error> {
    match values.iter().position(|v| !v.is_finite()) {
        Some(index) => Err(Error::NotFinite {
            what,
            index,
            got: values[index],
        }),
        None => Ok(()),
    }
}

fn not_negative(what: &'static str, values: &[f64]) -> Result<(), Error> {
    let bad = |v: &f64| !(v.is_finite() && *v >= 0.0);
    match values.iter().position(bad) {
        Some(index) => Err(Error::Weight {
            what,
            index,
            got: values[index],
        }),
        None => Ok(()),
    }
}
