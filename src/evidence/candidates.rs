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
        let prior = DMatrix::from_diagonal_element(2, 2, 1.0 / self.tau[at]);
        let mean = DVector::from_row_slice(&self.mean[2 * at..][..2]);
        Some(Candidate::new(&precision - prior, &precision * mean))
    }
}

/// Sums of a run: products of its columns with the zero, the residual and the columns that are in,
/// and of each order's own two.
struct Part {
    zero: Vec<f64>,
    residual: Vec<f64>,
    inside: Vec<f64>,
    squares: Vec<[f64; 3]>,
}

impl Readings {
    /// Of all orders, beside those that are in; of an order that is in, beside the others.
    pub(super) fn candidates(&self, noise: Noise, inside: &Inside) -> Vec<Candidate> {
        let columns = self.columns();
        let pair = |&place: &usize| [2 * place + 1, 2 * place + 2];
        let own: Vec<usize> = inside.places.iter().flat_map(pair).collect();
        let mut of_row = vec![0.0; columns];
        for (&c, b) in own.iter().zip(inside.mean) {
            of_row[c] = -b;
        }
        of_row[columns - 1] = 1.0;
        let work = |r: usize| self.alone(&self.runs()[r], noise, &of_row, &own);
        let parts = threads::map_parts(self.runs().len(), self.threads(), work);
        let (m, orders) = (own.len(), self.orders().len());
        let mut squares = vec![[0.0; 3]; orders];
        let mut residual = vec![0.0; 2 * orders];
        let mut cross = DMatrix::zeros(m, 2 * orders);
        for part in parts {
            let (n, level) = (part.zero[0], part.residual[0]);
            for (k, s) in squares.iter_mut().enumerate() {
                let c = &part.zero[2 * k + 1..][..2];
                let both = [c[0] * c[0], c[0] * c[1], c[1] * c[1]];
                for i in 0..3 {
                    s[i] += part.squares[k][i] - both[i] / n;
                }
            }
            for c in 0..2 * orders {
                residual[c] += part.residual[c + 1] - part.zero[c + 1] * level / n;
                for i in 0..m {
                    let both = part.zero[own[i]] * part.zero[c + 1] / n;
                    cross[(i, c)] += part.inside[i * columns + c + 1] - both;
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

    fn alone(&self, run: &Run, noise: Noise, of_row: &[f64], own: &[usize]) -> Part {
        let factor = Factor::new(noise, run.decays());
        let columns = self.columns();
        let mut state = State::new(columns);
        let mut part = Part {
            zero: vec![0.0; columns],
            residual: vec![0.0; columns],
            inside: vec![0.0; own.len() * columns],
            squares: vec![[0.0; 3]; self.orders().len()],
        };
        let most = (CELLS / columns).max(1);
        let blocks = (0..run.len()).step_by(most);
        for (start, count) in blocks.map(|start| (start, most.min(run.len() - start))) {
            interrupt::point();
            let mut rows = self.rows(run, start, count);
            factor.whiten(start, &mut rows, &mut state);
            for i in 0..count {
                let row = &rows.row(i)[..columns];
                let left: f64 = row.iter().zip(of_row).map(|(x, c)| x * c).sum();
                for c in 0..columns {
                    part.zero[c] += row[c] * row[0];
                    part.residual[c] += row[c] * left;
                }
                for (sums, &k) in part.inside.chunks_exact_mut(columns).zip(own) {
                    for c in 0..columns {
                        sums[c] += row[c] * row[k];
                    }
                }
                for (own, pair) in part.squares.iter_mut().zip(row[1..].chunks_exact(2)) {
                    own[0] += pair[0] * pair[0];
                    own[1] += pair[0] * pair[1];
                    own[2] += pair[1] * pair[1];
                }
            }
        }
        part
    }
}
