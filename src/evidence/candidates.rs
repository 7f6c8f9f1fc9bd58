//! Every order by itself beside a model: one pass over the readings, whatever the number of orders.
//!
//! With `r = y - z - X b` of the posterior mean `b` and covariance `S` of the columns `X` that are in,
//! an order with columns `X_k` that is not in has
//!
//! ```text
//! q = X_k' C^-1 r,    s = X_k' C^-1 X_k - X_k' C^-1 X S X' C^-1 X_k
//! ```
//!
//! with the zero of each run taken out, and its effects: of columns `Z` of variances `W²` (Woodbury,
//! run by run)
//!
//! ```text
//! C^-1 - C^-1 Z W (I + W Z' C^-1 Z W)^-1 W Z' C^-1
//! ```
//!
//! in the place of `C^-1`. For an order that is in, with prior variance `tau`, the same without it
//! follows from its own posterior:
//!
//! ```text
//! s = S_kk^-1 - I / tau,    q = S_kk^-1 b_k
//! ```

use nalgebra::{DMatrix, DVector};

use super::gains::Candidate;
use super::model::Effects;
use super::readings::{Readings, Run};
use super::rows::Rows;
use super::whitening::{Factor, Noise, State};
use crate::{interrupt, threads};

/// Orders whose columns are made at once: what a whitening carries on stays in the first cache.
const ORDERS: usize = 128;

/// The columns that are in, as places of orders, with their posterior; then those of orders that only
/// differ from run to run. `omega` is of all of these.
pub(super) struct Inside<'a> {
    pub places: &'a [usize],
    pub omega: &'a [f64],
    pub tau: &'a [f64],
    pub mean: &'a [f64],
    pub covariance: &'a DMatrix<f64>,
}

impl Inside<'_> {
    /// The order at a place that is in, beside the others.
    fn without(&self, place: usize) -> Option<Candidate> {
        let active = &self.places[..self.tau.len()];
        let at = active.iter().position(|&own| own == place)?;
        let precision = self.covariance.view((2 * at, 2 * at), (2, 2)).into_owned();
        let precision = precision.try_inverse()?;
        let mean = &self.mean[2 * at..][..2];
        Some(Candidate::of_posterior(&precision, mean, self.tau[at]))
    }
}

/// Sums of some orders in a run: products of zero, columns that are in and residual, a row each, with
/// the zero and the orders' columns; squares of the latter, and their products with the next one.
#[derive(Clone)]
struct Part {
    products: Vec<f64>,
    squares: Vec<f64>,
}

/// Effects of a run, and what they take of the columns that are in and of the residual.
struct Taken {
    effects: Effects,
    inside: DMatrix<f64>,
    residual: DMatrix<f64>,
}

impl Readings {
    /// Of all orders, beside those that are in; of an order that is in, beside the others.
    pub(super) fn candidates(&self, noise: Noise, inside: &Inside) -> Vec<Candidate> {
        let own = self.among(inside.places);
        let all: Vec<usize> = (0..self.orders().len()).collect();
        let some: Vec<Self> = all.chunks(ORDERS).map(|part| self.among(part)).collect();
        let work = |r: usize| own.alone(&self.runs()[r], noise, inside.mean, &some);
        let runs = threads::map_parts(self.runs().len(), self.threads(), work);
        let runs: Vec<Vec<Part>> = runs.collect();
        let place = |k: usize| (k / ORDERS, 2 * (k % ORDERS) + 1);
        let (m, last) = (inside.mean.len(), own.columns() - 1);
        // Product of a row (1 of the first column) with a column, about the zero of the run.
        let left = |run: &[Part], i: usize, part: usize, c: usize| {
            let stride = Rows::width(some[part].columns());
            let (zero, row) = (
                &run[part].products[..stride],
                &run[part].products[i * stride..],
            );
            row[c] - row[0] * zero[c] / zero[0]
        };
        let differ: Vec<usize> = (0..inside.places.len())
            .filter(|&own| inside.omega[own] > 0.0)
            .flat_map(|own| [2 * own, 2 * own + 1])
            .collect();
        let effects: Vec<Option<Taken>> = runs
            .iter()
            .map(|run| {
                if differ.is_empty() {
                    return None;
                }
                let with = |i: usize, c: usize| {
                    let (part, first) = place(inside.places[c / 2]);
                    left(run, i, part, first + c % 2)
                };
                let of = |rows: usize, row: &dyn Fn(usize) -> usize| {
                    DMatrix::from_fn(differ.len(), rows, |i, k| with(row(k), differ[i]))
                };
                let products = of(differ.len(), &|k| differ[k] + 1);
                let omega: Vec<f64> = differ.iter().map(|&c| inside.omega[c / 2]).collect();
                let on: Vec<usize> = (0..differ.len()).collect();
                let effects = Effects::of(&products, &omega, &on)?;
                let inside = effects.whitened(of(m, &|k| k + 1));
                let residual = effects.whitened(of(1, &|_| last));
                Some(Taken {
                    effects,
                    inside,
                    residual,
                })
            })
            .collect();
        let each = all.iter().map(|&k| {
            if let Some(own) = inside.without(k) {
                return own;
            }
            let (part, c) = place(k);
            let stride = Rows::width(some[part].columns());
            let (mut s, mut q) = (DMatrix::zeros(2, 2), DVector::zeros(2));
            let mut reach = DMatrix::zeros(m, 2);
            for (run, taken) in runs.iter().zip(&effects) {
                let Part { products, squares } = &run[part];
                let zero = &products[..stride];
                for i in 0..2 {
                    for j in 0..2 {
                        let square = squares[(i ^ j) * stride + c + i * j];
                        s[(i, j)] += square - zero[c + i] * zero[c + j] / zero[0];
                    }
                    q[i] += left(run, last, part, c + i);
                    for own in 0..m {
                        reach[(own, i)] += left(run, own + 1, part, c + i);
                    }
                }
                if let Some(taken) = taken {
                    let own = |i: usize, j: usize| left(run, differ[i] + 1, part, c + j);
                    let x = taken
                        .effects
                        .whitened(DMatrix::from_fn(differ.len(), 2, own));
                    s -= x.tr_mul(&x);
                    q -= x.tr_mul(&taken.residual).column(0);
                    reach -= taken.inside.tr_mul(&x);
                }
            }
            Candidate::new(s - reach.tr_mul(&(inside.covariance * &reach)), q)
        });
        each.collect()
    }

    /// Sums of a run beside these orders, whose coefficients are `mean`.
    fn alone(&self, run: &Run, noise: Noise, mean: &[f64], some: &[Self]) -> Vec<Part> {
        let factor = Factor::new(noise, run.decays());
        let columns = self.columns();
        let width = |part: &Self| Rows::width(part.columns());
        let sums = |part: &Self| Part {
            products: vec![0.0; columns * width(part)],
            squares: vec![0.0; 2 * width(part)],
        };
        let mut parts: Vec<Part> = some.iter().map(sums).collect();
        let state = |part: &Self| State::new(part.columns());
        let (mut before, mut states) = (state(self), some.iter().map(state).collect::<Vec<_>>());
        for (start, count) in run.chunks() {
            interrupt::point();
            let mut beside = self.rows(run, start, count);
            factor.whiten(start, &mut beside, &mut before);
            for i in 0..count {
                let row = beside.row_mut(i);
                let taken: f64 = row[1..].iter().zip(mean).map(|(x, b)| x * b).sum();
                row[columns - 1] -= taken;
            }
            for ((orders, state), part) in some.iter().zip(&mut states).zip(&mut parts) {
                let mut rows = orders.rows(run, start, count);
                factor.whiten(start, &mut rows, state);
                beside.add_products(&rows, &mut part.products);
                rows.add_squares(&mut part.squares);
            }
        }
        parts
    }
}
