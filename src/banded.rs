//! Symmetric positive definite matrices of a few diagonals: factored and solved in place.

use crate::check::same_length;
use crate::error::Error;

/// Diagonals that are kept: the main one and three above it.
pub const BAND: usize = 4;

/// Cholesky factor `L` of a banded matrix: row `i` holds `L[i, i - lag]` at `lag`.
#[derive(Clone, Debug)]
pub struct Factor {
    rows: Vec<[f64; BAND]>,
    /// Of the matrix.
    pub log_determinant: f64,
}

impl Factor {
    /// Factors a matrix whose entry `(i, i + lag)` is `bands[BAND * i + lag]`; None where it
    /// is not positive definite to working precision.
    pub fn new(bands: &[f64]) -> Option<Self> {
        let n = bands.len() / BAND;
        let mut rows = vec![[0.0; BAND]; n];
        let mut log_determinant = 0.0;
        for i in 0..n {
            let mut row = [0.0; BAND];
            for lag in (0..BAND.min(i + 1)).rev() {
                let j = i - lag;
                let mut value = bands[BAND * j + lag];
                for k in i.saturating_sub(BAND - 1)..j {
                    let other = if lag == 0 { row } else { rows[j] };
                    value -= row[i - k] * other[j - k];
                }
                if lag > 0 {
                    row[lag] = value / rows[j][0];
                } else if value > 0.0 && value.is_finite() {
                    row[0] = value.sqrt();
                    log_determinant += value.ln();
                } else {
                    return None;
                }
            }
            rows[i] = row;
        }
        Some(Self {
            rows,
            log_determinant,
        })
    }

    /// Rows and columns of the matrix.
    pub fn size(&self) -> usize {
        self.rows.len()
    }

    /// Right-hand sides, row by row with `width` numbers each, become their solutions.
    pub fn solve(&self, width: usize, right: &mut [f64]) -> Result<(), Error> {
        let n = self.size();
        same_length("right", right.len(), "size * width", n * width)?;
        for i in 0..n {
            let row = self.rows[i];
            let (before, here) = right.split_at_mut(i * width);
            let here = &mut here[..width];
            for lag in 1..BAND.min(i + 1) {
                let known = &before[(i - lag) * width..][..width];
                for (x, y) in here.iter_mut().zip(known) {
                    *x -= row[lag] * y;
                }
            }
            let scale = 1.0 / row[0];
            here.iter_mut().for_each(|x| *x *= scale);
        }
        for i in (0..n).rev() {
            let (here, after) = right.split_at_mut((i + 1) * width);
            let here = &mut here[i * width..];
            for lag in 1..BAND.min(n - i) {
                let known = &after[(lag - 1) * width..][..width];
                let factor = self.rows[i + lag][lag];
                for (x, y) in here.iter_mut().zip(known) {
                    *x -= factor * y;
                }
            }
            let scale = 1.0 / self.rows[i][0];
            here.iter_mut().for_each(|x| *x *= scale);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A banded matrix with a dominant diagonal, and its entry at any place.
    fn matrix(n: usize) -> Vec<f64> {
        let entry = |i: usize, lag: usize| match lag {
            0 => 5.0 + (i as f64).sin(),
            _ => (1.7 * i as f64 + lag as f64).cos(),
        };
        (0..n)
            .flat_map(|i| (0..BAND).map(move |lag| entry(i, lag)))
            .collect()
    }

    fn at(bands: &[f64], i: usize, j: usize) -> f64 {
        let (low, lag) = (i.min(j), i.abs_diff(j));
        if lag < BAND {
            bands[BAND * low + lag]
        } else {
            0.0
        }
    }

    #[test]
    fn what_is_solved_gives_the_right_hand_side_back() {
        for n in [1, 2, 3, 4, 5, 60] {
            let bands = matrix(n);
            let factor = Factor::new(&bands).unwrap();
            let right: Vec<f64> = (0..2 * n).map(|i| 1.0 + i as f64).collect();
            let mut solved = right.clone();
            factor.solve(2, &mut solved).unwrap();
            for i in 0..n {
                for column in 0..2 {
                    let product: f64 = (0..n)
                        .map(|j| at(&bands, i, j) * solved[2 * j + column])
                        .sum();
                    let wanted = right[2 * i + column];
                    // A condition of about 10, and sums of 60 terms of size 100.
                    assert!((product - wanted).abs() < 1e-11 * (1.0 + wanted.abs()));
                }
            }
        }
    }

    #[test]
    fn the_determinant_is_that_of_elimination() {
        let n = 12;
        let bands = matrix(n);
        let mut full: Vec<Vec<f64>> = (0..n)
            .map(|i| (0..n).map(|j| at(&bands, i, j)).collect())
            .collect();
        let mut expected = 0.0;
        for k in 0..n {
            expected += full[k][k].ln();
            let (above, below) = full.split_at_mut(k + 1);
            let pivot = &above[k];
            for row in below {
                let factor = row[k] / pivot[k];
                for (x, y) in row.iter_mut().zip(pivot) {
                    *x -= factor * y;
                }
            }
        }
        let found = Factor::new(&bands).unwrap().log_determinant;
        assert!((found - expected).abs() < 1e-12 * expected.abs());
    }

    #[test]
    fn what_is_not_positive_definite_has_no_factor() {
        let mut bands = matrix(6);
        bands[BAND * 3] = -1.0;
        assert!(Factor::new(&bands).is_none());
        bands[BAND * 3] = f64::NAN;
        assert!(Factor::new(&bands).is_none());
        let mut short = vec![0.0; 5];
        assert!(
            Factor::new(&matrix(6))
                .unwrap()
                .solve(1, &mut short)
                .is_err()
        );
    }
}
