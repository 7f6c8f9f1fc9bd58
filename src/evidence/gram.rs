//! Sums of products of whitened columns: all that the evidence needs of a run.
//!
//! With `X` the columns, `Y` the right-hand sides (the error) and `1` the zero of the run:
//!
//! ```text
//! G = X' C^-1 X - c c' / n,   c = X' C^-1 1,   n = 1' C^-1 1
//! g = X' C^-1 Y - c (1' C^-1 Y) / n,    s = Y' C^-1 Y - (Y' C^-1 1) (1' C^-1 Y) / n
//! log scale = -log|L| - 1/2 log n - (N - 1)/2 log 2 pi
//! ```
//!
//! so that a run's likelihood, its zero integrated over a flat prior, is
//! `log scale - 1/2 (s - 2 b' g + b' G b)`.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};

use super::readings::{Readings, Run};
use super::rows::Rows;
use super::whitening::{Factor, Noise, State};
use crate::{interrupt, threads};

/// Readings below which one thread is faster than several.
const THREADED: usize = 400;

/// Sums without the zero of the run; those of several runs add up.
#[derive(Clone, Debug)]
pub struct Sums {
    /// `G`.
    pub products: DMatrix<f64>,
    /// `g`, a column for each right-hand side.
    pub moments: DMatrix<f64>,
    /// `s`.
    pub squares: DMatrix<f64>,
    /// Logarithm of what does not depend on coefficients.
    pub log_scale: f64,
}

impl Sums {
    /// Of no readings.
    pub fn zeros(columns: usize, targets: usize) -> Self {
        Self {
            products: DMatrix::zeros(columns, columns),
            moments: DMatrix::zeros(columns, targets),
            squares: DMatrix::zeros(targets, targets),
            log_scale: 0.0,
        }
    }

    /// Adds those of other readings.
    pub fn merge(&mut self, other: &Self) {
        self.products += &other.products;
        self.moments += &other.moments;
        self.squares += &other.squares;
        self.log_scale += other.log_scale;
    }
}

/// Sums of one run, and what its zero took of them.
#[derive(Clone, Debug)]
pub struct Gram {
    /// Without the zero.
    pub sums: Sums,
    /// `n`: the information of the run about its zero.
    pub information: f64,
    /// `c / n`: weighted means of the columns.
    pub means: DVector<f64>,
    /// Weighted mean of the error, less its plain mean.
    pub level: f64,
}

/// How a run is whitened, and its whitened rows, chunk by chunk, where rows are held.
#[derive(Debug)]
pub(super) struct Whitened<'a> {
    pub factor: Factor<'a>,
    pub rows: Option<Vec<Rows>>,
}

impl Gram {
    /// From the upper triangle of products of whitened rows: zero, columns, error.
    ///
    /// The row of the zero is complete.
    fn of(products: &[f64], stride: usize, columns: usize, (factor, count): (f64, usize)) -> Self {
        let m = columns - 2;
        let at = |i: usize, j: usize| products[i.min(j) * stride + i.max(j)];
        let n = at(0, 0);
        let left = |i: usize, j: usize| at(i, j) - at(0, i) * (at(0, j) / n);
        let last = columns - 1;
        let constant = 0.5 * (count as f64 - 1.0) * TAU.ln();
        let sums = Sums {
            products: DMatrix::from_fn(m, m, |i, j| left(i + 1, j + 1)),
            moments: DMatrix::from_fn(m, 1, |i, _| left(i + 1, last)),
            squares: DMatrix::from_element(1, 1, left(last, last).max(0.0)),
            log_scale: -factor - 0.5 * n.ln() - constant,
        };
        Self {
            sums,
            information: n,
            means: DVector::from_fn(m, |i, _| at(0, i + 1) / n),
            level: at(0, last) / n,
        }
    }
}

impl Readings {
    /// The Gram matrices of each run under a noise, in one pass.
    pub fn grams(&self, noise: Noise) -> Vec<Gram> {
        self.whitened(noise)
            .into_iter()
            .map(|(own, _)| own)
            .collect()
    }

    /// The Gram matrix of all runs with one zero, in one pass.
    ///
    /// Its noise is without what all readings of a run have in common: `C - c 1 1'`, whose inverse
    /// differs by the information about the zero.
    pub fn pooled(&self, noise: Noise) -> Gram {
        let (columns, stride) = (self.columns(), Rows::width(self.columns()));
        let work = |r: usize| {
            let (mut products, whitened) = self.products(r, noise);
            let n = products[0];
            let variance = self.runs()[r].zero_variance(noise, n);
            let zero: Vec<f64> = products[..columns].iter().map(|own| own / n).collect();
            for i in 0..columns {
                for j in i..columns {
                    products[i * stride + j] += (1.0 / variance - n) * zero[i] * zero[j];
                }
            }
            let root = whitened.factor.log_root + 0.5 * (n * variance).ln();
            (products, root)
        };
        let count = self.len() as f64;
        let level = |run: &Run| run.mean() * run.len() as f64 / count;
        let mean: f64 = self.runs().iter().map(level).sum();
        let (mut total, mut factor) = (vec![0.0; columns * stride], 0.0);
        let last = columns - 1;
        let parts = threads::map_parts(self.runs().len(), self.threads(), work);
        for ((own, root), run) in parts.zip(self.runs()) {
            for (sum, part) in total.iter_mut().zip(&own) {
                *sum += part;
            }
            // Errors of a run are less its mean: that is put back as so much of the zero.
            let level = run.mean() - mean;
            total[last * stride + last] += level * (2.0 * own[last] + level * own[0]);
            for c in 0..last {
                total[c * stride + last] += level * own[c];
            }
            factor += root;
        }
        Gram::of(&total, stride, columns, (factor, self.len()))
    }

    /// Threads of a pass over the readings.
    pub(super) fn threads(&self) -> usize {
        if self.len() < THREADED {
            1
        } else {
            threads::available()
        }
    }

    /// Gram matrices of each run, and how it is whitened.
    pub(super) fn whitened(&self, noise: Noise) -> Vec<(Gram, Whitened<'_>)> {
        let columns = self.columns();
        let work = |r: usize| {
            let (products, whitened) = self.products(r, noise);
            let scale = (whitened.factor.log_root, self.runs()[r].len());
            let gram = Gram::of(&products, Rows::width(columns), columns, scale);
            (gram, whitened)
        };
        threads::map_parts(self.runs().len(), self.threads(), work).collect()
    }

    /// Products of the whitened rows of a run, and how it is whitened.
    fn products(&self, r: usize, noise: Noise) -> (Vec<f64>, Whitened<'_>) {
        let (run, columns) = (&self.runs()[r], self.columns());
        let factor = Factor::new(noise, run.decays());
        let mut state = State::new(columns);
        let mut products = vec![0.0; columns * Rows::width(columns)];
        let mut rows = self.held(r).map(<[Rows]>::to_vec);
        for (k, (start, count)) in run.chunks().enumerate() {
            interrupt::point();
            let mut made = None;
            let own = match &mut rows {
                Some(rows) => &mut rows[k],
                None => made.insert(self.rows(run, start, count)),
            };
            factor.whiten(start, own, &mut state);
            own.add_products(own, &mut products);
        }
        (products, Whitened { factor, rows })
    }
}
