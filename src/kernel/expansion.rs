//! The table of a series: Chebyshev expansion of every segment, by Fourier transform.
//!
//! Over the segment centred on `x_n = n p / M`, with `z = pi k / M` (Jacobi-Anger):
//! `exp(i k (x_n + u p / 2M)) = exp(i k x_n) (J_0(z) + 2 sum_j i^j J_j(z) T_j(u))`.
//! The coefficient of `T_j` in all segments at once is thus a Fourier series over `n`.
//! What is cut off after degree 7 is bounded by `|J_j(z)| <= (z/2)^j / j!` (DLMF 10.14.4).

use std::f64::consts::PI;

use rustfft::FftPlanner;
use rustfft::num_complex::Complex;

use super::segments::OVERSHOOT;
use super::table::{DEGREE, MOST_SEGMENTS, Table};
use crate::chebyshev::bessel;
use crate::series::{HarmonicSeries, Line};

/// Greatest difference between a periodic series and its table of `segments`.
pub fn bound(series: &HarmonicSeries, segments: usize) -> f64 {
    let tail = |order: f64| {
        let half = 0.5 * PI * order / segments as f64;
        // 8! = 40320; the tail's ratio is below z/2 / 9. |J| <= 1 caps what is hopeless.
        let tail = half.powi(8) / 40320.0 / (1.0 - (half / 9.0).min(0.5));
        OVERSHOOT * 2.0 * tail
    };
    series
        .lines()
        .map(|line| line.amplitude() * tail(line.order))
        .sum()
}

/// Greatest difference between a periodic series and its interpolation by cubics in
/// Chebyshev's points: the fourth derivative over `4! 2^3` (DLMF 3.3.17).
pub fn cubic_bound(series: &HarmonicSeries, segments: usize) -> f64 {
    let step = PI / segments as f64;
    let lines = series.lines();
    OVERSHOOT / 192.0
        * lines
            .map(|line| line.amplitude() * (step * line.order).powi(4))
            .sum::<f64>()
}

/// The table of a periodic series with the fewest segments, from `least` (a power of two),
/// that are within `tolerance`; `None` where that would be too many.
pub fn table(series: &HarmonicSeries, tolerance: f64, least: usize) -> Option<Table> {
    let highest = series.lines().map(|line| line.order).fold(1.0, f64::max);
    let mut segments = least;
    // Two segments per period of the highest order keep the transform unambiguous and
    // the geometric tail of `bound` valid.
    while segments as f64 <= 2.0 * highest || bound(series, segments) > tolerance {
        segments *= 2;
        if segments > MOST_SEGMENTS {
            return None;
        }
    }
    Some(expand(series, segments))
}

fn expand(series: &HarmonicSeries, segments: usize) -> Table {
    let line = |line: Line| (line, bessel(PI * line.order / segments as f64));
    let lines: Vec<(Line, [f64; DEGREE + 1])> = series.lines().map(line).collect();
    let transform = FftPlanner::new().plan_fft_inverse(segments);
    let mut rows = vec![[0.0; DEGREE + 1]; segments];
    // Two real Fourier series are one complex one: columns j and j + 1 go together.
    for pair in (0..=DEGREE).step_by(2) {
        let mut spectrum = vec![Complex::new(0.0, 0.0); segments];
        for (line, bessel) in &lines {
            // A cos + B sin is the real part of (A - iB) exp(i ...).
            let amplitude = Complex::new(line.cosine, -line.sine);
            let even = amplitude * power_of_i(pair) * bessel[pair];
            let odd = amplitude * power_of_i(pair + 1) * bessel[pair + 1];
            let i = Complex::<f64>::i();
            let index = line.order as usize;
            spectrum[index] += even + i * odd;
            spectrum[segments - index] += even.conj() + i * odd.conj();
        }
        transform.process(&mut spectrum);
        for (row, value) in rows.iter_mut().zip(&spectrum) {
            row[pair] = value.re;
            row[pair + 1] = value.im;
        }
    }
    for row in &mut rows {
        // The expansion has J_0, not 2 J_0; the line and its mirror image doubled both.
        row[0] *= 0.5;
    }
    Table::new(
        rows.into_iter(),
        series.constant(),
        series.period(),
        bound(series, segments),
    )
}

/// `i^j`.
fn power_of_i(j: usize) -> Complex<f64> {
    [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)].map(|(re, im)| Complex::new(re, im))[j % 4]
}
