//! The slow truth: one sine and cosine per order and sample, each from its own
//! exactly reduced phase. Fast paths are tested against these functions.

use std::f64::consts::TAU;

use crate::angle::{Period, sin_cos_turns};
use crate::series::HarmonicSeries;

/// `error(x)` term by term.
pub fn error(series: &HarmonicSeries, x: f64) -> f64 {
    series.constant() + terms(series, x, |a, b, sine, cosine, _| a * cosine + b * sine)
}

/// `d error / dx` term by term.
pub fn slope(series: &HarmonicSeries, x: f64) -> f64 {
    terms(series, x, |a, b, sine, cosine, rate| {
        rate * (b * cosine - a * sine)
    })
}

/// `theta` with `theta + error(theta) = indicated`, by bisection.
///
/// Needs no derivative and cannot diverge: the root is bracketed by the sum of
/// amplitudes around `indicated - C0`.
pub fn correct(series: &HarmonicSeries, indicated: f64) -> f64 {
    let reach = series.amplitude_sum();
    let centre = indicated - series.constant();
    let (mut low, mut high) = (centre - reach, centre + reach);
    loop {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            return middle;
        }
        if middle + error(series, middle) < indicated {
            low = middle;
        } else {
            high = middle;
        }
    }
}

fn terms(series: &HarmonicSeries, x: f64, term: impl Fn(f64, f64, f64, f64, f64) -> f64) -> f64 {
    let mut sum = 0.0;
    for shaft in series.shafts() {
        let phase = series.period().phase(x, shaft.cycles);
        for (i, &order) in shaft.orders.iter().enumerate() {
            let order = f64::from(order);
            let (sine, cosine) = sin_cos_turns(Period::harmonic(phase, order));
            let rate = TAU * shaft.cycles * order / series.period().value();
            sum += term(shaft.cosine[i], shaft.sine[i], sine, cosine, rate);
        }
    }
    sum
}
