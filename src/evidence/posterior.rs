//! Evidence of a model, and the posterior of its coefficients.
//!
//! With `G`, `g`, `s` the sums without effects of runs and `T` the roots of `tau`:
//!
//! ```text
//! log p = log scale - 1/2 log|I + T G T| - 1/2 (s - g' S g)
//! S = (G + T^-2)^-1 = T (I + T G T)^-1 T,    mean = S g
//! ```

use nalgebra::{Cholesky, DMatrix};

use super::gram::Sums;

/// The posterior of the coefficients of the columns that are in.
#[derive(Clone, Debug)]
pub struct Posterior {
    /// Logarithm of the density of the readings under the model.
    pub log_evidence: f64,
    /// The columns.
    pub columns: Vec<usize>,
    /// Means, a column for each right-hand side.
    pub mean: DMatrix<f64>,
    /// `s - g' S g`.
    pub residual: DMatrix<f64>,
    /// `L^-1 T`, whose square is the covariance.
    root: DMatrix<f64>,
}

impl Posterior {
    /// Of sums over these columns, whose prior variances are `tau`.
    pub(super) fn of(sums: &Sums, tau: &[f64], columns: Vec<usize>) -> Option<Self> {
        let m = tau.len();
        let roots: Vec<f64> = tau.iter().map(|tau| tau.sqrt()).collect();
        let inner = DMatrix::from_fn(m, m, |i, k| {
            let unit = if i == k { 1.0 } else { 0.0 };
            unit + roots[i] * sums.products[(i, k)] * roots[k]
        });
        let lower = Cholesky::new(inner)?.unpack();
        let mut root = DMatrix::zeros(m, m);
        for (i, own) in roots.iter().enumerate() {
            root[(i, i)] = *own;
        }
        lower.solve_lower_triangular_unchecked_mut(&mut root);
        let q = &root * &sums.moments;
        let residual = &sums.squares - q.tr_mul(&q);
        let log_root: f64 = lower.diagonal().map(f64::ln).sum();
        let log_evidence = sums.log_scale - log_root - 0.5 * residual[(0, 0)];
        log_evidence.is_finite().then(|| Self {
            log_evidence,
            columns,
            mean: root.tr_mul(&q),
            residual,
            root,
        })
    }

    /// Covariance of the coefficients.
    pub fn covariance(&self) -> DMatrix<f64> {
        self.root.tr_mul(&self.root)
    }
}
