//! `g` from `g = error(y - g)`: what to subtract from an indicated angle `y`.

use std::f64::consts::{PI, TAU};

use super::Batch;
use super::exact::Exact;
use super::expansion;
use super::segments::OVERSHOOT;
use super::table::{DEGREE, MOST_SEGMENTS, Table};
use crate::chebyshev;
use crate::interrupt;
use crate::series::HarmonicSeries;
use crate::simd::InstructionSet;

/// Steps before giving up on another ulp: bisection alone needs about 60.
const MOST_STEPS: usize = 100;

/// What the forward table may add while the inverse is built, of the sum of amplitudes.
const FORWARD_TOLERANCE: f64 = 1e-16;

/// Segments made between two looks at whether anybody still waits for them.
const SEGMENTS_AT_ONCE: usize = 1024;

/// Root of `g - error(y - g)` in `[low, high]`, where `error` gives value and slope at
/// `y - g`. Newton's method in a shrinking bracket: it converges wherever `|error'| < 1`.
fn root(error: impl Fn(f64) -> (f64, f64), mut low: f64, mut high: f64, start: f64) -> f64 {
    let resolution = 0.5 * f64::EPSILON * (high - low);
    let mut g = start;
    for _ in 0..MOST_STEPS {
        let (value, slope) = error(g);
        let excess = g - value;
        if excess < 0.0 {
            low = low.max(g);
        } else {
            high = high.min(g);
        }
        let mut next = g - excess / (1.0 + slope);
        if !(low <= next && next <= high) {
            next = 0.5 * (low + high);
        }
        if (next - g).abs() <= resolution {
            return next;
        }
        g = next;
    }
    g
}

/// The true angle of an indicated one; `reach` is the sum of amplitudes.
pub fn solve(series: &HarmonicSeries, reach: f64, indicated: f64) -> f64 {
    if !indicated.is_finite() {
        return f64::NAN;
    }
    let centre = series.constant();
    let g = root(
        |g| series.evaluate(indicated - g),
        centre - reach,
        centre + reach,
        centre,
    );
    indicated - g
}

/// Newton's method on vectors: most samples converge in two or three steps, and those
/// that do not go to a solver that cannot fail.
pub struct Newton<'e> {
    /// `error`.
    pub error: &'e Exact,
    /// Its slope, or `None` where `error` takes the indicated angle and one step is exact.
    pub slope: Option<&'e Exact>,
    /// The sum of amplitudes.
    pub reach: f64,
    /// Bound of its second derivative, where its slope is at most 1/2.
    pub bend: Option<f64>,
    /// What to compute on.
    pub set: InstructionSet,
}

impl Newton<'_> {
    /// True angles `theta` of indicated ones; `safe` solves for a single one.
    pub fn solve(&self, indicated: &[f64], theta: &mut [f64], safe: impl Fn(f64) -> f64) {
        /// Steps after which a sample is hopeless.
        const STEPS: usize = 8;
        let mut error = vec![0.0; theta.len()];
        let Some(slope) = self.slope else {
            self.fill(self.error, indicated, &mut error);
            for ((theta, x), error) in theta.iter_mut().zip(indicated).zip(&error) {
                *theta = x - error;
            }
            return;
        };
        let mut steepness = vec![0.0; theta.len()];
        let mut last_step = vec![f64::INFINITY; theta.len()];
        theta.copy_from_slice(indicated);
        for _ in 0..STEPS {
            self.fill(self.error, theta, &mut error);
            self.fill(slope, theta, &mut steepness);
            for i in 0..theta.len() {
                let step = ((theta[i] - indicated[i]) + error[i]) / (1.0 + steepness[i]);
                // One that is found stands still: it does not depend on those beside it.
                if !self.is_done(theta[i], last_step[i]) {
                    theta[i] -= step;
                    last_step[i] = step.abs();
                }
            }
            if (0..theta.len()).all(|i| self.is_done(theta[i], last_step[i])) {
                break;
            }
        }
        for i in 0..theta.len() {
            if !self.is_done(theta[i], last_step[i]) {
                theta[i] = safe(indicated[i]);
            }
        }
    }

    /// True when the angle cannot be told from the solution, or there is none.
    ///
    /// Before a step s the angle was off by at most 3 s where no slope exceeds 1/2, and a
    /// step of Newton leaves the square of that times the second derivative.
    fn is_done(&self, theta: f64, last_step: f64) -> bool {
        let resolution = f64::EPSILON * (theta.abs() + self.reach);
        let is_sure = |bend: f64| 18.0 * bend * last_step * last_step <= resolution;
        last_step.is_nan() || last_step <= resolution || self.bend.is_some_and(is_sure)
    }

    fn fill(&self, function: &Exact, x: &[f64], out: &mut [f64]) {
        let batch = Batch::apart(x, out).expect("blocks are equally long");
        function.run(self.set, batch);
    }
}

/// Greatest difference between the inverse and its interpolation by polynomials of so
/// high a degree over `segments`, in Chebyshev's points.
///
/// In the strip `|Im theta| <= s` the slope is at most
/// `l(s) = slope + sum k C_k sinh(k s)`. While `l(s) < 1`, `g -> error(y - g)` contracts
/// there for every y with `|Im y| <= s (1 - l(s))`: g is analytic in that strip and at
/// most `sum C_k cosh(k s)` from C0. An ellipse of Bernstein around a segment that fits
/// into it bounds the interpolation error by `4 B rho^-n / (rho - 1)` (Trefethen,
/// Approximation Theory and Approximation Practice, theorem 8.2).
pub fn bound(series: &HarmonicSeries, slope: f64, segments: usize, degree: usize) -> f64 {
    /// Strips tried, each 1.2 times as wide as the one before.
    const STRIPS: i32 = 60;
    let radians = TAU / series.period().value();
    let highest = series.lines().map(|line| line.order).fold(1.0, f64::max);
    let mut best = f64::INFINITY;
    for i in 0..STRIPS {
        interrupt::point();
        let strip = 20.0 / highest / 1.2f64.powi(i);
        let (mut steepness, mut size) = (slope, 0.0);
        for line in series.lines() {
            let (k, c) = (line.order, line.amplitude());
            steepness += radians * k * c * (k * strip).sinh();
            size += c * (k * strip).cosh();
        }
        if steepness >= 1.0 {
            continue;
        }
        let semi_axis = strip * (1.0 - steepness) * segments as f64 / PI;
        let rho = semi_axis + semi_axis.hypot(1.0);
        best = best.min(4.0 * size * rho.powi(-(degree as i32)) / (rho - 1.0));
    }
    OVERSHOOT * best
}

/// The table of `g` for a periodic series whose slope is at most `slope < 1`, within
/// `tolerance`; `None` where that would take too many segments.
pub fn table(series: &HarmonicSeries, slope: f64, tolerance: f64) -> Option<Table> {
    let mut segments = 8;
    while bound(series, slope, segments, DEGREE) > tolerance {
        segments *= 2;
        if segments > MOST_SEGMENTS {
            return None;
        }
    }
    // The constant is left out until the end, so that a large one costs no digits.
    let reach = series.amplitude_sum();
    let varying = series.without_constant();
    let forward = expansion::table(&varying, FORWARD_TOLERANCE * reach, segments)?;
    let per_segment = forward.segments() / segments;
    let half = 0.5 * series.period().value() / segments as f64;
    let points: [f64; DEGREE + 1] = chebyshev::points();
    let transform = chebyshev::transform();
    let mut g = 0.0;
    let expansions = (0..segments).map(|n| {
        if n % SEGMENTS_AT_ONCE == 0 {
            interrupt::point();
        }
        let values = points.map(|u| {
            let offset = u * half - series.constant();
            let error = |g: f64| forward.at(n * per_segment, offset - g);
            g = root(error, -reach, reach, g);
            g
        });
        chebyshev::apply(&transform, &values)
    });
    Some(Table::new(
        expansions,
        series.constant(),
        series.period(),
        bound(series, slope, segments, DEGREE),
    ))
}
