//! Noise that is alike from one reading to the next: the filter that makes it white.

use nalgebra::{RealField, convert};

use crate::interrupt;

/// Noise of first-order correlation within runs, of readings of these weights.
#[derive(Clone, Copy, Debug)]
pub struct Correlated<'a> {
    /// First and one-past-last reading of every run, one after the other from the first on.
    pub bounds: &'a [(usize, usize)],
    /// Correlation of neighbours.
    pub rho: f64,
    /// Roots of the weights.
    pub roots: Option<&'a [f64]>,
}

impl Correlated<'_> {
    /// Nothing to filter.
    pub fn is_white(&self) -> bool {
        self.rho == 0.0 && self.roots.is_none()
    }

    /// Rows `x_t - rho x_(t - 1)` within runs, the first of each times `sqrt(1 - rho^2)`.
    pub fn filtered<T: RealField + Copy>(&self, x: &[T], columns: usize, out: &mut [T]) {
        let mut weighted = Vec::new();
        if let Some(roots) = self.roots {
            weighted.extend_from_slice(x);
            weigh(&mut weighted, columns, roots);
        }
        let x = if self.roots.is_some() { &weighted } else { x };
        let edge: T = convert((1.0 - self.rho * self.rho).sqrt());
        let against: T = convert(-self.rho);
        for &(start, stop) in self.bounds {
            interrupt::point();
            let part = &x[start * columns..stop * columns];
            let first = columns.min(part.len());
            let (head, tail) = out[start * columns..stop * columns].split_at_mut(first);
            for (y, &x) in head.iter_mut().zip(part) {
                *y = x * edge;
            }
            for (y, (&before, &x)) in tail.iter_mut().zip(part.iter().zip(&part[first..])) {
                *y = before * against + x;
            }
        }
    }

    /// The transpose of `filtered`, applied to columns.
    pub fn filtered_back<T: RealField + Copy>(&self, y: &[T], columns: usize, out: &mut [T]) {
        let edge: T = convert((1.0 - self.rho * self.rho).sqrt());
        let rho: T = convert(self.rho);
        out.copy_from_slice(y);
        for &(start, stop) in self.bounds {
            interrupt::point();
            let part = &y[start * columns..stop * columns];
            let out = &mut out[start * columns..stop * columns];
            let first = columns.min(part.len());
            for x in &mut out[..first] {
                *x *= edge;
            }
            for (x, &after) in out.iter_mut().zip(&part[first..]) {
                *x -= rho * after;
            }
        }
        if let Some(roots) = self.roots {
            weigh(out, columns, roots);
        }
    }
}

/// Every row times its root.
fn weigh<T: RealField + Copy>(rows: &mut [T], columns: usize, roots: &[f64]) {
    for (row, &root) in rows.chunks_exact_mut(columns.max(1)).zip(roots) {
        let root: T = convert(root);
        row.iter_mut().for_each(|x| *x *= root);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    const BOUNDS: [(usize, usize); 3] = [(0, 7), (7, 8), (8, 20)];

    fn noises(roots: &[f64]) -> [Correlated<'_>; 2] {
        let noise = |rho, roots| Correlated {
            bounds: &BOUNDS,
            rho,
            roots,
        };
        [noise(0.6, None), noise(0.3, Some(roots))]
    }

    /// The filter as a matrix, a column for every reading.
    fn matrix(noise: &Correlated<'_>, back: bool) -> DMatrix<f64> {
        let unit = DMatrix::<f64>::identity(20, 20);
        let mut out = vec![0.0; 400];
        if back {
            noise.filtered_back(unit.as_slice(), 20, &mut out);
        } else {
            noise.filtered(unit.as_slice(), 20, &mut out);
        }
        DMatrix::from_row_slice(20, 20, &out)
    }

    #[test]
    fn filtered_noise_is_white_and_the_transpose_is_that() {
        let roots: Vec<f64> = (0..20).map(|i| 1.0 + 0.1 * f64::from(i)).collect();
        for noise in noises(&roots) {
            let map = matrix(&noise, false);
            assert!((matrix(&noise, true) - map.transpose()).amax() < 1e-15);
            let run = |i: usize| BOUNDS.iter().position(|&(_, stop)| i < stop);
            let covariance = DMatrix::from_fn(20, 20, |i, j| {
                let of = |i: usize| noise.roots.map_or(1.0, |roots| roots[i]);
                let alike = if run(i) == run(j) { 1.0 } else { 0.0 };
                let apart = i32::try_from(i.abs_diff(j)).unwrap();
                alike * noise.rho.powi(apart) / (1.0 - noise.rho.powi(2)) / (of(i) * of(j))
            });
            let white = (1.0 - noise.rho.powi(2)) * &map * covariance * map.transpose();
            let scale = 1.0 - noise.rho.powi(2);
            assert!((white / scale - DMatrix::identity(20, 20)).amax() < 1e-12);
        }
    }
}
