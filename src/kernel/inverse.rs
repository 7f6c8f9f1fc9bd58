//! `theta` from `theta + error(theta) = indicated`, one sample at a time.

use crate::series::HarmonicSeries;

/// Newton steps before giving up on another ulp: bisection alone needs about 60.
const MOST_STEPS: usize = 100;

/// Newton's method inside a bracket that shrinks, so it converges wherever
/// `|error'| < 1` (the root is within the sum of amplitudes around `indicated - C0`).
pub fn solve(series: &HarmonicSeries, reach: f64, indicated: f64) -> f64 {
    if !indicated.is_finite() {
        return f64::NAN;
    }
    let centre = indicated - series.constant();
    let (mut low, mut high) = (centre - reach, centre + reach);
    let mut theta = centre;
    for _ in 0..MOST_STEPS {
        let (error, slope) = series.evaluate(theta);
        let excess = (theta - indicated) + error;
        if excess == 0.0 {
            return theta;
        }
        if excess < 0.0 {
            low = low.max(theta);
        } else {
            high = high.min(theta);
        }
        let mut next = theta - excess / (1.0 + slope);
        if !(low <= next && next <= high) {
            next = 0.5 * (low + high);
        }
        // A step below half an ulp cannot improve the result.
        if next == theta || (next - theta).abs() <= 0.5 * f64::EPSILON * theta.abs() {
            return next;
        }
        theta = next;
    }
    theta
}
