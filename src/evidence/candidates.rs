//! Every order by itself beside a model: one pass over the readings, whatever the number of orders.
//!
//! With `r = y - z - X b` of the posterior mean `b` and covariance `S` of the columns `X` that are in,
//! an order with columns `X_k` that is not in has
//!
//! ```text
//! q = X_k' C^-1 r,    s = X_k' C^-1 X_k - X_k' C^-1 X S X' C^-1 X_k
//! ```
//!
//! with the zero of each run taken out. Effects of runs are left out of account. For an order that is
//! in, with prior variance `tau`, the same without it follows from its own posterior:
//!
//! ```text
//! s = S_kk^-1 - I / tau,    q = S_kk^-1 b_k
//! ```

use nalgebra::{DMatrix, DVector};

use super::gains::Candidate;
use super::readings::{Readings, Run};
use super::rows::Rows;
use super::whitening::{Factor, Noise, State};
use crate::{interrupt, threads};

/// Numbers of a block of rows: it stays in the second cache.
const CELLS: usize = 1 << 15;

/// The columns that are in, as places of orders, with their posterior.
pub(super) struct Inside<'a> {
    pub places: &'a [usize],
    pub tau: &'a [f64],
    pub mean: &'a [f64],
    pub covariance: &'a DMatrix<f64>,
}

impl Inside<'_> {
    /// The order at a place that is in, beside the others.
    fn without(&self, place: usize) -> Option<Candidate> {
        let at = self.places.iter().position(|&own| own == place)?;
        let precision = self.covariance.view((2 * at, 2 * at), (2, 2)).into_owned();
        let precision = precision.try_inverse()?;
        let mean = &self.mean[2 * at..][..2];
        Some(Candidate::of_posterior(&precision, mean, self.tau[at]))
    }
}

/// Sums of a run: products of its columns with the zero, the residual and the columns that are in,
/// a row each, and of each order's own two.
struct Part {
    products: Vec<f64>,
    squares: Vec<[f64; 3]>,
}

impl Readings {
    /// Of all orders, beside those that are in; of an order that is in, beside the others.
    pub(super) fn candidates(&self, noise: Noise, inside: &Inside) -> Vec<Candidate> {
        let columns = self.columns();
        let pair = |&place: &usize| [2 * place + 1, 2 * place + 2];
        let own: Vec<usize> = inside.places.iter().flat_map(pair).collect();
        let stride = Rows::width(columns);
        let work = |r: usize| self.alone(&self.runs()[r], noise, inside.mean, &own);
        let parts = threads::map_parts(self.runs().len(), self.threads(), work);
        let (m, orders) = (own.len(), self.orders().len());
        let mut squares = vec![[0.0; 3]; orders];
        let mut residual = vec![0.0; 2 * orders];
        let mut cross = DMatrix::zeros(m, 2 * orders);
        for part in parts {
            let row = |i: usize| &part.products[i * stride..][..stride];
            let (zero, left) = (row(0), row(1));
            let (n, level) = (zero[0], left[0]);
            for (k, s) in squares.iter_mut().enumerate() {
                let c = &zero[2 * k + 1..][..2];
                let both = [c[0] * c[0], c[0] * c[1], c[1] * c[1]];
                for i in 0..3 {
                    s[i] += part.squares[k][i] - both[i] / n;
                }
            }
            for c in 0..2 * orders {
                residual[c] += left[c + 1] - zero[c + 1] * level / n;
                for i in 0..m {
                    cross[(i, c)] += row(i + 2)[c + 1] - zero[own[i]] * zero[c + 1] / n;
                }
            }
        }
        let each = (0..orders).map(|k| {
            if let Some(own) = inside.without(k) {
                return own;
            }
            let [a, b, c] = squares[k];
            let reach = cross.columns(2 * k, 2);
            let s = DMatrix::from_row_slice(2, 2, &[a, b, b, c]);
            let taken = reach.tr_mul(&(inside.covariance * reach));
            Candidate::new(s - taken, DVector::from_row_slice(&residual[2 * k..][..2]))
        });
        each.collect()
    }

    fn alone(&self, run: &Run, noise: Noise, mean: &[f64], own: &[usize]) -> Part {
        let factor = Factor::new(noise, run.decays());
        let columns = self.columns();
        let mut state = State::new(columns);
        let mut part = Part {
            products: vec![0.0; (own.len() + 2) * Rows::width(columns)],
            squares: vec![[0.0; 3]; self.orders().len()],
        };
        let most = (CELLS / columns).max(1);
        let blocks = (0..run.len()).step_by(most);
        for (start, count) in blocks.map(|start| (start, most.min(run.len() - start))) {
            interrupt::point();
            let mut rows = self.rows(run, start, count);
            factor.whiten(start, &mut rows, &mut state);
            let mut beside = Rows::zeros(count, own.len() + 2);
            for i in 0..count {
                let row = rows.row(i);
                let taken: f64 = own.iter().zip(mean).map(|(&c, b)| row[c] * b).sum();
                let target = beside.row_mut(i);
                target[0] = row[0];
                target[1] = row[columns - 1] - taken;
                for (x, &c) in target[2..].iter_mut().zip(own) {
                    *x = row[c];
                }
                for (sums, pair) in part.squares.iter_mut().zip(row[1..].chunks_exact(2)) {
                    sums[0] += pair[0] * pair[0];
                    sums[1] += pair[0] * pair[1];
                    sums[2] += pair[1] * pair[1];
                }
            }
            beside.add_products(&rows, &mut part.products);
        }
        part
    }
}
