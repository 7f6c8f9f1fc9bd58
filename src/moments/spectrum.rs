//! Sums over `exp(i k x)` for all orders at once, from the moments of the segments.

use std::f64::consts::PI;

use rustfft::FftPlanner;
use rustfft::num_complex::Complex64;

use super::accumulator::Accumulator;
use super::segment::Segment;
use crate::chebyshev::jacobi_anger;

/// What the normal equations of any orders up to `error.len() - 1` are made of.
#[derive(Clone, Debug)]
pub struct Spectrum {
    /// `sum of w exp(i k x)` for `k` from 0 to twice the highest order.
    pub weight: Vec<Complex64>,
    /// `sum of w y exp(i k x)` for `k` from 0 to the highest order.
    pub error: Vec<Complex64>,
    /// `sum of w y^2`.
    pub squares: f64,
    /// Readings of positive weight.
    pub count: usize,
    /// The angle that the errors `y` are counted from.
    pub centre: f64,
}

impl Spectrum {
    /// All sums for orders up to `highest` of the accumulator's base shaft.
    pub fn new(accumulator: &Accumulator, highest: u32) -> Self {
        let moments = accumulator.moments();
        let highest = highest as usize;
        let weight = Transform::new(&moments, |s| s.weight);
        let error = Transform::new(&moments, |s| s.error);
        Self {
            weight: (0..=2 * highest).map(|k| weight.at(k)).collect(),
            error: (0..=highest).map(|k| error.at(k)).collect(),
            squares: accumulator.squares(),
            count: accumulator.count(),
            centre: accumulator.centre(),
        }
    }
}

/// Discrete Fourier transforms over the segments, two moments to a transform.
struct Transform<const TERMS: usize> {
    pairs: Vec<Vec<Complex64>>,
}

impl<const TERMS: usize> Transform<TERMS> {
    fn new(moments: &[Segment], terms: impl Fn(&Segment) -> [f64; TERMS]) -> Self {
        let fft = FftPlanner::new().plan_fft_inverse(moments.len());
        let pairs = (0..TERMS / 2).map(|pair| {
            let both = |s: &Segment| Complex64::new(terms(s)[2 * pair], terms(s)[2 * pair + 1]);
            let mut values: Vec<_> = moments.iter().map(both).collect();
            fft.process(&mut values);
            values
        });
        Self {
            pairs: pairs.collect(),
        }
    }

    /// `sum over segments s and terms j of moment_sj i^j e_j(k h) exp(i k x_s)`: segments
    /// of half width `h`, the first centred at `x_0 = h - pi`.
    fn at(&self, k: usize) -> Complex64 {
        let segments = self.pairs[0].len();
        let half_width = PI / segments as f64;
        let series: [f64; TERMS] = jacobi_anger(k as f64 * half_width);
        let (index, mirrored) = (k % segments, (segments - k % segments) % segments);
        let mut sum = Complex64::ZERO;
        for (pair, values) in self.pairs.iter().enumerate() {
            // Two real sequences in one complex transform come apart by symmetry.
            let (here, there) = (values[index], values[mirrored].conj());
            let even = 0.5 * (here + there);
            let odd = Complex64::new(0.0, -0.5) * (here - there);
            let term = even * series[2 * pair] + odd * Complex64::I * series[2 * pair + 1];
            sum += if pair % 2 == 0 { term } else { -term };
        }
        let sign = if k.is_multiple_of(2) { 1.0 } else { -1.0 };
        sign * sum * Complex64::cis(k as f64 * half_width)
    }
}
