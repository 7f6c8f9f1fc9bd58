//! `g` from `g = error(y - g)`: what to subtract from an indicated angle `y`.

use std::f64::consts::{PI, TAU};

use super::Batch;
use super::exact::{Both, Exact};
use super::expansion;
use super::segments::OVERSHOOT;
use super::table::{DEGREE, MOST_SEGMENTS, Table};
use crate::chebyshev;
use crate::interrupt;
use crate::series::HarmonicSeries;
use crate::simd::{InstructionSet, Kernel, Lanes, dispatch_any};

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
    /// Its constant: the angles start without it, as it may be many turns of a high order.
    pub constant: f64,
    /// The sum of amplitudes.
    pub reach: f64,
    /// Bounds of its slope and of its second derivative.
    pub slope_bound: f64,
    pub bend: f64,
    /// What to compute on.
    pub set: InstructionSet,
}

impl Newton<'_> {
    /// True angles `theta` of indicated ones, of each the same alone or among others;
    /// `safe` solves for a single one.
    pub fn solve(&self, indicated: &[f64], theta: &mut [f64], safe: impl Fn(f64) -> f64) {
        if theta.len() == 1 {
            return self.solve_in(&mut [0.0; 4], indicated, theta, safe);
        }
        self.solve_in(&mut vec![0.0; 4 * theta.len()], indicated, theta, safe);
    }

    /// The same, with room for four rows of numbers.
    fn solve_in(
        &self,
        room: &mut [f64],
        indicated: &[f64],
        theta: &mut [f64],
        safe: impl Fn(f64) -> f64,
    ) {
        /// Steps after which a sample is hopeless.
        const STEPS: usize = 8;
        let (error, room) = room.split_at_mut(theta.len());
        let Some(slope) = self.slope else {
            let batch = Batch::apart(indicated, error).expect("blocks are equally long");
            self.error.run(self.set, batch);
            for ((theta, x), error) in theta.iter_mut().zip(indicated).zip(error) {
                *theta = x - *error;
            }
            return;
        };
        let (steepness, room) = room.split_at_mut(theta.len());
        let (last_step, limits) = room.split_at_mut(theta.len());
        last_step.fill(f64::INFINITY);
        dispatch_any(self.set, theta.len(), self.limits(indicated, limits));
        for (theta, x) in theta.iter_mut().zip(indicated) {
            // What is not finite has no angle, and asks for no steps.
            *theta = if x.is_finite() {
                x - self.constant
            } else {
                f64::NAN
            };
        }
        for _ in 0..STEPS {
            let both = Both {
                functions: [self.error, slope],
                x: theta,
                out: [&mut *error, &mut *steepness],
            };
            dispatch_any(self.set, indicated.len(), both);
            let mut left = false;
            let step = Step {
                indicated,
                error,
                steepness,
                limits,
                theta: &mut *theta,
                last_step: &mut *last_step,
                left: &mut left,
            };
            dispatch_any(self.set, indicated.len(), step);
            if !left {
                return;
            }
        }
        for i in 0..theta.len() {
            if last_step[i] > limits[i] {
                theta[i] = safe(indicated[i]);
            }
        }
    }

    /// Before a step s the angle was off by at most `s (1 + l)/(1 - l)`, the slope l at most, and
    /// a step of Newton leaves the square of that times the second derivative over `2 (1 - l)`:
    /// half of a resolution is enough.
    fn limits<'a>(&self, indicated: &'a [f64], limits: &'a mut [f64]) -> Limits<'a> {
        /// Beyond any step, and its products are numbers.
        const ANY: f64 = 1e150;
        /// Slope from which on a small step says nothing.
        const STEEP: f64 = 0.5;
        let l = self.slope_bound;
        let left = self.bend * ((1.0 + l) / (1.0 - l)).powi(2) / (1.0 - l);
        let sure = if l <= STEEP { left.sqrt().recip() } else { 0.0 };
        Limits {
            indicated,
            reach: self.reach,
            sure: sure.min(ANY),
            limits,
        }
    }
}

/// Of every sample the last step after which the angle equals the solution to rounding.
struct Limits<'a> {
    indicated: &'a [f64],
    reach: f64,
    /// The step that leaves a resolution of 1.
    sure: f64,
    limits: &'a mut [f64],
}

impl Kernel for Limits<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        for (limit, x) in self.limits.iter_mut().zip(self.indicated) {
            let resolution = f64::EPSILON * (x.abs() + self.reach);
            let sure = self.sure * resolution.sqrt();
            *limit = if sure > resolution { sure } else { resolution };
        }
    }
}

/// A step of Newton's method for every sample that is not found yet.
struct Step<'a> {
    indicated: &'a [f64],
    error: &'a [f64],
    steepness: &'a [f64],
    limits: &'a [f64],
    theta: &'a mut [f64],
    last_step: &'a mut [f64],
    /// Whether some are not found after it.
    left: &'a mut bool,
}

impl Kernel for Step<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let n = self.theta.len();
        let (indicated, limits) = (&self.indicated[..n], &self.limits[..n]);
        let (error, steepness) = (&self.error[..n], &self.steepness[..n]);
        let (theta, last_step) = (&mut *self.theta, &mut self.last_step[..n]);
        let mut left = false;
        for i in 0..n {
            let step = ((theta[i] - indicated[i]) + error[i]) / (1.0 + steepness[i]);
            // One that is found stands still: it does not depend on those beside it.
            let goes = last_step[i] > limits[i];
            theta[i] = if goes { theta[i] - step } else { theta[i] };
            last_step[i] = if goes { step.abs() } else { last_step[i] };
            left |= last_step[i] > limits[i];
        }
        *self.left = left;
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
