//! Changes of the evidence by closed forms (Tipping and Faul 2003): no candidate is factorised.
//!
//! For a group with columns `X` that is not in, with `V` the covariance of the readings without it,
//! `s = X' V^-1 X` and `q = X' V^-1 y`, a variance `tau` changes the log evidence by
//!
//! ```text
//! -1/2 log|I + tau s| + 1/2 tau q' (I + tau s)^-1 q
//! ```
//!
//! With `S` the posterior covariance and `P = S G`: `s_j = G_jj - G_j' P_j` of a group that is out;
//! without a group `k` that is in, `s_k = S_kk^-1 - I / tau` of itself, and of another
//! `s_j + P_kj' S_kk^-1 P_kj`.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::gram::{Gram, Sums};
use super::model::Model;
use super::posterior::Posterior;

/// `s` and `q` of a group without which the readings have covariance `V`.
#[derive(Clone, Debug)]
pub struct Candidate {
    s: DMatrix<f64>,
    q: DVector<f64>,
}

impl Candidate {
    /// Of its own sums.
    pub(super) fn new(s: DMatrix<f64>, q: DVector<f64>) -> Self {
        Self { s, q }
    }

    /// Of a group that is in, as if it were out: from the inverse of its posterior covariance.
    pub(super) fn of_posterior(precision: &DMatrix<f64>, mean: &[f64], tau: f64) -> Self {
        let q = precision * DVector::from_row_slice(mean);
        let mut s = precision.clone();
        for i in 0..mean.len() {
            s[(i, i)] -= 1.0 / tau;
        }
        Self { s, q }
    }

    /// Least squares of its coefficients: `s^-1 q` and `s^-1`; None where the others hold it.
    pub fn alone(&self) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let inverse = Cholesky::new(self.s.clone())?.inverse();
        Some((&inverse * &self.q, inverse))
    }

    /// Change of the log evidence by letting the group in with this variance.
    pub fn gain(&self, tau: f64) -> f64 {
        let (fit, log_root) = self.parts(tau);
        fit - log_root
    }

    /// What the group fits with this variance, which grows with it, and what its volume costs.
    fn parts(&self, tau: f64) -> (f64, f64) {
        if let [a, b] = *self.q.as_slice() {
            // An order's two columns, without a factor.
            let s = &self.s;
            let (x, y, z) = (
                1.0 + tau * s[(0, 0)],
                tau * s[(0, 1)],
                1.0 + tau * s[(1, 1)],
            );
            let volume = f64::max(x * z - y * y, f64::EPSILON);
            let square = (z * a * a - 2.0 * y * a * b + x * b * b) / volume;
            return (0.5 * tau * square, 0.5 * volume.ln());
        }
        let (mut upper, mut z) = (self.s.clone(), self.q.clone());
        upper *= tau;
        // Cholesky and solution at once, by columns, which lie in one piece.
        let (mut log_root, mut square) = (0.0, 0.0);
        for i in 0..self.q.len() {
            for k in 0..i {
                let known = dot(&upper, k, i, k);
                upper[(k, i)] = (upper[(k, i)] - known) / upper[(k, k)];
            }
            // At least 1 but for rounding.
            let left = 1.0 + upper[(i, i)] - dot(&upper, i, i, i);
            upper[(i, i)] = left.max(f64::EPSILON).sqrt();
            let known = upper.column(i).rows(0, i).dot(&z.rows(0, i));
            z[i] = (z[i] - known) / upper[(i, i)];
            log_root += upper[(i, i)].ln();
            square += z[i] * z[i];
        }
        (0.5 * tau * square, log_root)
    }

    /// The variance of these that gains most, and what it gains.
    pub fn best(&self, sizes: &[f64]) -> (f64, f64) {
        let gains = sizes.iter().map(|&tau| (tau, self.gain(tau)));
        gains.fold((0.0, f64::NEG_INFINITY), |best, own| {
            if own.1 > best.1 { own } else { best }
        })
    }

    /// The same; None where no variance gains more than `least`, mostly told by the greatest alone.
    pub fn best_above(&self, sizes: &[f64], least: f64) -> Option<(f64, f64)> {
        let greatest = sizes.iter().copied().fold(0.0, f64::max);
        if self.parts(greatest).0 <= least {
            return None;
        }
        Some(self.best(sizes)).filter(|best| best.1 > least)
    }
}

/// Product of the first `n` values of two columns.
fn dot(matrix: &DMatrix<f64>, n: usize, i: usize, k: usize) -> f64 {
    matrix
        .column(i)
        .rows(0, n)
        .dot(&matrix.column(k).rows(0, n))
}

/// Columns above which a group is wide.
const WIDE: usize = 16;

/// `I + tau s` of a wide group that is out, factorised.
#[derive(Clone, Debug)]
pub struct Wide {
    root: Cholesky<f64, Dyn>,
    tau: f64,
}

/// A model under one noise with all that gains need.
#[derive(Clone, Debug)]
pub struct Solved {
    /// The model.
    pub model: Model,
    /// Log evidence.
    pub log_evidence: f64,
    bounds: Vec<(usize, usize)>,
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
    /// Place of the columns of each group that is in among those that are.
    places: Vec<usize>,
    /// `P` at all columns.
    reach: DMatrix<f64>,
    /// `s` of each group; of use where it is out.
    outside: Vec<DMatrix<f64>>,
    /// `q` at all columns; of use where groups are out.
    moments: DVector<f64>,
}

impl Solved {
    /// From sums of all columns without the effects of runs.
    pub fn of(model: Model, sums: &Sums) -> Option<Self> {
        let tau = model.by_column(&model.tau);
        let active: Vec<usize> = (0..tau.len()).filter(|&c| tau[c] > 0.0).collect();
        let cross = sums.products.select_rows(&active);
        let own = Sums {
            products: cross.select_columns(&active),
            moments: sums.moments.select_rows(&active),
            squares: sums.squares.clone(),
            log_scale: sums.log_scale,
        };
        let sizes: Vec<f64> = active.iter().map(|&c| tau[c]).collect();
        let found = Posterior::of(&own, &sizes, active)?;
        let (covariance, mean) = (found.covariance(), found.mean.column(0).into_owned());
        let reach = &covariance * &cross;
        let bounds = model.bounds();
        let mut place = 0;
        let places = (0..bounds.len()).map(|k| {
            let own = place;
            place += if model.tau[k] > 0.0 {
                model.widths[k]
            } else {
                0
            };
            own
        });
        // Products between groups are of no use.
        let outside = bounds.iter().map(|&(from, to)| {
            let own = sums.products.view((from, from), (to - from, to - from));
            let (beside, reached) = (cross.columns_range(from..to), reach.columns_range(from..to));
            if to - from > WIDE {
                return own - beside.transpose() * reached;
            }
            own - beside.tr_mul(&reached)
        });
        Some(Self {
            log_evidence: found.log_evidence,
            places: places.collect(),
            outside: outside.collect(),
            moments: sums.moments.column(0) - cross.tr_mul(&mean),
            bounds,
            mean,
            covariance,
            reach,
            model,
        })
    }

    /// Of a group that is out.
    pub fn outside(&self, j: usize) -> Candidate {
        let (from, to) = self.bounds[j];
        Candidate {
            s: self.outside[j].clone(),
            q: self.moments.rows(from, to - from).into_owned(),
        }
    }

    /// A group that is out with a variance, if it is so wide that its exchanges share a factor.
    pub fn wide(&self, j: usize, tau: f64) -> Option<Wide> {
        let own = &self.outside[j];
        if own.nrows() <= WIDE {
            return None;
        }
        let root = Cholesky::new(DMatrix::identity(own.nrows(), own.nrows()) + own * tau)?;
        Some(Wide { root, tau })
    }

    /// What differs of each group in each run from the shared coefficients.
    pub(super) fn differences(&self, grams: &[Gram]) -> Vec<Vec<Candidate>> {
        let mut mean = DVector::zeros(self.moments.nrows());
        for (k, &(from, to)) in self.bounds.iter().enumerate() {
            if self.model.tau[k] > 0.0 {
                let own = self.mean.rows(self.places[k], to - from);
                mean.rows_mut(from, to - from).copy_from(&own);
            }
        }
        let mut found = vec![Vec::with_capacity(grams.len()); self.bounds.len()];
        for gram in grams {
            let sums = self.model.sums(std::slice::from_ref(gram));
            let left = sums.moments.column(0) - &sums.products * &mean;
            for (own, &(from, to)) in found.iter_mut().zip(&self.bounds) {
                let s = sums.products.view((from, from), (to - from, to - from));
                let q = left.rows(from, to - from).into_owned();
                own.push(Candidate::new(s.into_owned(), q));
            }
        }
        found
    }

    /// Without a group that is in.
    pub fn without(&self, k: usize) -> Option<Without<'_>> {
        let (place, width) = (self.places[k], self.model.widths[k]);
        let own = self
            .covariance
            .view((place, place), (width, width))
            .into_owned();
        let precision = Cholesky::new(own)?.inverse();
        let mean = &self.mean.as_slice()[place..place + width];
        let own = Candidate::of_posterior(&precision, mean, self.model.tau[k]);
        let loss = own.gain(self.model.tau[k]);
        Some(Without {
            solved: self,
            k,
            precision,
            own,
            loss,
        })
    }
}

/// What a model would be without one of its groups; effects of runs stay as they are.
pub struct Without<'a> {
    solved: &'a Solved,
    k: usize,
    precision: DMatrix<f64>,
    /// The group itself, as if it were out.
    pub own: Candidate,
    /// What its leaving takes from the log evidence.
    pub loss: f64,
}

impl Without<'_> {
    /// What another, wide group can gain at most: what it fits with its variance, by Woodbury.
    ///
    /// ```text
    /// 1/2 tau q' (A + tau U U')^-1 q,   A = I + tau s_j = L L',   U U' = P_kj' S_kk^-1 P_kj
    /// ```
    pub fn at_most(&self, j: usize, wide: &Wide) -> Option<f64> {
        let (solved, tau) = (self.solved, wide.tau);
        let ((from, to), place) = (solved.bounds[j], solved.places[self.k]);
        let reach = solved
            .reach
            .view((place, from), (self.precision.nrows(), to - from));
        let lower = wide.root.l_dirty();
        let q = solved.moments.rows(from, to - from) + reach.tr_mul(&self.own.q);
        let z = lower.solve_lower_triangular(&q)?;
        let halves = reach.tr_mul(&Cholesky::new(self.precision.clone())?.l());
        let w = lower.solve_lower_triangular(&halves)?;
        let known = w.tr_mul(&z);
        let inner = DMatrix::identity(known.len(), known.len()) + w.tr_mul(&w) * tau;
        let less = tau * known.dot(&Cholesky::new(inner)?.solve(&known));
        Some(0.5 * tau * (z.norm_squared() - less))
    }

    /// Another group that is out, in a model without this one.
    pub fn other(&self, j: usize) -> Candidate {
        let Self {
            solved,
            k,
            precision,
            own,
            ..
        } = self;
        let mut candidate = solved.outside(j);
        let ((from, to), place) = (solved.bounds[j], solved.places[*k]);
        let reach = solved
            .reach
            .view((place, from), (precision.nrows(), to - from));
        candidate.s += reach.tr_mul(&(precision * reach));
        candidate.q += reach.tr_mul(&own.q);
        candidate
    }
}
