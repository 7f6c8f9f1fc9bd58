//! Correlation between neighbours within runs, after what drifts is taken out.

use std::f64::consts::PI;

use nalgebra::{DMatrix, DVectorView};

use crate::interrupt;

/// Half periods per run that count as drift and not as correlation of the noise.
const DRIFT_TERMS: usize = 8;

/// Correlation between neighbours below which the noise counts as white, and the most it can be.
const WHITE_BELOW: f64 = 0.05;
const MOST: f64 = 0.98;

/// Standard errors of a correlation of zero up to which the noise counts as white.
const ERRORS: f64 = 4.0;

/// Runs whose neighbours are looked at: the mean of each and its drift are taken out.
#[derive(Clone, Debug)]
pub struct Neighbours {
    /// First reading of every run that is long enough, and its mean and drift at right angles.
    runs: Vec<(usize, DMatrix<f64>)>,
}

impl Neighbours {
    /// Of runs whose clock increases.
    pub fn new(clock: &[f64], bounds: &[(usize, usize)]) -> Self {
        let long = bounds.iter().filter(|run| run.1 - run.0 > 2 * DRIFT_TERMS);
        let basis = |&(start, stop): &(usize, usize)| {
            interrupt::point();
            let (clock, span) = (&clock[start..stop], clock[stop - 1] - clock[start]);
            let drift = DMatrix::from_fn(clock.len(), DRIFT_TERMS + 1, |i, k| {
                let part = if span > 0.0 {
                    (clock[i] - clock[0]) / span
                } else {
                    0.0
                };
                (PI * part * k as f64).cos()
            });
            (start, drift.qr().q())
        };
        Self {
            runs: long.map(basis).collect(),
        }
    }

    /// Pooled over the runs, and at least 0: 0 below what counts as white or within four standard
    /// errors of it, so that white noise stays exactly white.
    pub fn correlation(&self, residual: &[f64]) -> f64 {
        let (mut product, mut power, mut pairs) = (0.0, 0.0, 0.0);
        for (start, q) in &self.runs {
            interrupt::point();
            let part = &residual[*start..start + q.nrows()];
            let part = DVectorView::from_slice(part, part.len());
            let mut left = part.into_owned();
            left.gemv(-1.0, q, &q.tr_mul(&part), 1.0);
            let n = left.len() - 1;
            product += left.rows(1, n).dot(&left.rows(0, n));
            power += left.norm_squared();
            pairs += n as f64;
        }
        if pairs == 0.0 || power == 0.0 {
            return 0.0;
        }
        // The basis takes out a share of the slow part: about K/n of the correlation.
        let rho = product / power;
        if rho > WHITE_BELOW.max(ERRORS / pairs.sqrt()) {
            rho.min(MOST)
        } else {
            0.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drift_is_no_correlation_and_neighbours_that_are_alike_are() {
        let n = 400;
        let clock: Vec<f64> = (0..n).map(|i| 2.0 * f64::from(i)).collect();
        let neighbours = Neighbours::new(&clock, &[(0, 10), (10, 400)]);
        let noise = |i: i32| f64::from(i * i % 97).sin();
        let slow = |i: i32| 50.0 * (PI * 3.0 * f64::from(i - 10) / 389.0).cos();
        let white: Vec<f64> = (0..n).map(|i| noise(i) + slow(i)).collect();
        assert_eq!(neighbours.correlation(&white), 0.0);
        let alike: Vec<f64> = (0..n).map(|i| noise(i) + noise(i + 1) + slow(i)).collect();
        let found = neighbours.correlation(&alike);
        assert!((found - 0.5).abs() < 0.1, "{found}");
        assert_eq!(neighbours.correlation(&[0.0; 400]), 0.0);
        assert_eq!(
            Neighbours::new(&clock[..16], &[(0, 16)]).correlation(&alike[..16]),
            0.0
        );
    }
}
