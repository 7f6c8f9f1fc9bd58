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

use std::cell::{OnceCell, RefCell};
use std::collections::BTreeMap;
use std::rc::Rc;
use std::sync::{Arc, Mutex};

use nalgebra::{Cholesky, DMatrix, DVector};

use super::gram::{Gram, Sums};
use super::model::Model;
use super::posterior::Posterior;
use crate::lstsq::invert_upper;

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
        let best = self.best_above(sizes, f64::NEG_INFINITY);
        best.unwrap_or((0.0, f64::NEG_INFINITY))
    }

    /// The same, where it is more than `least`.
    fn best_above(&self, sizes: &[f64], least: f64) -> Option<(f64, f64)> {
        best_above(sizes, least, self.q.len(), |tau| Some(self.parts(tau)))
    }
}

/// The variance that gains most, and what it gains, of what a group fits and what its volume costs;
/// None where none of these, from the least to the greatest, gains more than `least`.
///
/// A variance that is `e` times smaller fits less, and costs less by at most half of the columns.
fn best_above(
    sizes: &[f64],
    mut least: f64,
    width: usize,
    parts: impl Fn(f64) -> Option<(f64, f64)>,
) -> Option<(f64, f64)> {
    let (mut best, mut greater) = (None, None);
    for &tau in sizes.iter().rev() {
        if let Some((at, fit, log_root)) = greater {
            let cheaper = 0.5 * width as f64 * f64::ln(at / tau);
            if fit - f64::max(log_root - cheaper, 0.0) < least {
                continue;
            }
        }
        let Some((fit, log_root)) = parts(tau) else {
            continue;
        };
        if fit - log_root > least {
            least = fit - log_root;
            best = Some((tau, least));
        }
        greater = Some((tau, fit, log_root));
    }
    best
}

/// Product of the first `n` values of two columns.
fn dot(matrix: &DMatrix<f64>, n: usize, i: usize, k: usize) -> f64 {
    matrix
        .column(i)
        .rows(0, n)
        .dot(&matrix.column(k).rows(0, n))
}

/// Columns above which a group is wide: one that is in is integrated over with the effects of runs, and
/// one that is out has its principal axes as columns, so that the products of its own are diagonal.
/// Where more columns are in than it has, it is treated as a narrow one all the same.
pub(super) const WIDE: usize = 32;

/// Sums beside what is integrated over, by the bits of its variances.
pub(super) type Met = Arc<Mutex<BTreeMap<Vec<u64>, Arc<Sums>>>>;

/// A model with a wide group that comes in: what this fits, what its volume costs, and the columns
/// that were in beside it. With `U` and `d` its products with these and its own, and `r` its `q`:
///
/// ```text
/// K = T^-2 + G - U h U' = L L',   h = tau / (1 + tau d),   z = L^-1 U h r
/// 1/2 (r' h r + z' z),   1/2 sum log(1 + tau d) + log|L| - log|L without it|
/// ```
#[derive(Debug)]
struct Beside {
    parts: (f64, f64),
    lower: DMatrix<f64>,
    /// `z`.
    known: DVector<f64>,
    /// `L'^-1`, whose square is the covariance.
    root: OnceCell<DMatrix<f64>>,
}

impl Beside {
    fn root(&self) -> &DMatrix<f64> {
        self.root.get_or_init(|| {
            let mut root = self.lower.transpose();
            invert_upper(root.as_view_mut());
            root
        })
    }
}

/// Wide groups that were let in, by group and bits of the variance; None of those that cannot be.
type LetIn = BTreeMap<(usize, u64), Option<Rc<Beside>>>;

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
    /// `T^-2 + G` of the columns that are in, and the logarithm of its root.
    precision: DMatrix<f64>,
    log_root: f64,
    /// Place of the columns of each group among those that are in, or among those that are out and
    /// treated as narrow.
    places: Vec<usize>,
    /// Products of the columns that are in with all.
    cross: DMatrix<f64>,
    /// `P` at the columns of the latter.
    reach: DMatrix<f64>,
    /// `s` of each of their groups.
    outside: Vec<DMatrix<f64>>,
    /// Squares of all columns.
    squares: DVector<f64>,
    /// `q` at all columns; of use where groups are out.
    moments: DVector<f64>,
    met: RefCell<LetIn>,
}

impl Solved {
    /// From runs, and sums that were made of them before.
    pub(super) fn beside(model: Model, grams: &[Gram], met: &Met) -> Option<Self> {
        let groups = 0..model.tau.len();
        let wide = |&k: &usize| model.widths[k] > WIDE;
        let mut whole = model.clone();
        for k in groups.clone().filter(wide) {
            whole.omega[k] = model.tau[k];
        }
        let made = || {
            let (mut sums, bounds) = (whole.sums(grams), model.bounds());
            for k in groups.filter(wide).filter(|&k| model.tau[k] == 0.0) {
                sums.turn(bounds[k]);
            }
            Arc::new(sums)
        };
        let key = whole.omega.iter().map(|omega| omega.to_bits()).collect();
        let sums = Arc::clone(met.lock().ok()?.entry(key).or_insert_with(made));
        Self::of(model, &sums)
    }

    /// From sums of all columns without the effects of runs and without wide groups that are in.
    pub fn of(model: Model, sums: &Sums) -> Option<Self> {
        let is_narrow = |k: usize| model.widths[k] <= WIDE;
        let tau = (0..model.tau.len()).map(|k| f64::from(is_narrow(k)) * model.tau[k]);
        let tau = model.by_column(&tau.collect::<Vec<_>>());
        let active: Vec<usize> = (0..tau.len()).filter(|&c| tau[c] > 0.0).collect();
        let cross = sums.products.select_rows(&active);
        let own = Sums {
            products: cross.select_columns(&active),
            moments: sums.moments.select_rows(&active),
            squares: sums.squares.clone(),
            log_scale: sums.log_scale,
        };
        let sizes: Vec<f64> = active.iter().map(|&c| tau[c]).collect();
        let mut precision = own.products.clone();
        for (i, size) in sizes.iter().enumerate() {
            precision[(i, i)] += 1.0 / size;
        }
        let found = Posterior::of(&own, &sizes, active)?;
        let (covariance, mean) = (found.covariance(), found.mean.column(0).into_owned());
        let bounds = model.bounds();
        let is_dense = |k: usize| model.tau[k] == 0.0 && model.widths[k] <= WIDE.max(mean.len());
        let (mut inside, mut out) = (0, Vec::new());
        let mut place = |k: usize| {
            let (from, to) = bounds[k];
            if is_narrow(k) && model.tau[k] > 0.0 {
                inside += to - from;
                return inside - (to - from);
            }
            if is_dense(k) {
                out.extend(from..to);
                return out.len() - (to - from);
            }
            0
        };
        let places: Vec<usize> = (0..bounds.len()).map(&mut place).collect();
        let reach = &covariance * cross.select_columns(&out);
        // Products between groups are of no use.
        let outside = bounds.iter().enumerate().map(|(k, &(from, to))| {
            let width = to - from;
            if !is_dense(k) {
                return DMatrix::zeros(0, 0);
            }
            let own = sums.products.view((from, from), (width, width));
            own - cross
                .columns(from, width)
                .tr_mul(&reach.columns(places[k], width))
        });
        Some(Self {
            log_evidence: found.log_evidence,
            log_root: -found.root.diagonal().map(f64::ln).sum(),
            outside: outside.collect(),
            squares: sums.products.diagonal(),
            moments: sums.moments.column(0) - cross.tr_mul(&mean),
            met: RefCell::default(),
            bounds,
            mean,
            covariance,
            precision,
            places,
            cross,
            reach,
            model,
        })
    }

    /// Of a narrow group that is out.
    pub fn outside(&self, j: usize) -> Candidate {
        let (from, to) = self.bounds[j];
        Candidate {
            s: self.outside[j].clone(),
            q: self.moments.rows(from, to - from).into_owned(),
        }
    }

    /// The variance with which a group that is out gains most, and what it gains, if more than `least`.
    pub fn best_above(&self, j: usize, sizes: &[f64], least: f64) -> Option<(f64, f64)> {
        let width = self.model.widths[j];
        if width <= WIDE {
            return self.outside(j).best_above(sizes, least);
        }
        let parts = |tau| Some(self.with_wide(j, tau)?.parts);
        best_above(sizes, least, width, parts)
    }

    /// A wide group that is out let in.
    fn with_wide(&self, j: usize, tau: f64) -> Option<Rc<Beside>> {
        let mut met = self.met.borrow_mut();
        let made = || self.let_in(j, tau).map(Rc::new);
        met.entry((j, tau.to_bits())).or_insert_with(made).clone()
    }

    fn let_in(&self, j: usize, tau: f64) -> Option<Beside> {
        let (from, to) = self.bounds[j];
        if !self.outside[j].is_empty() {
            return Some(Beside {
                parts: self.outside(j).parts(tau),
                lower: DMatrix::zeros(0, 0),
                known: DVector::zeros(0),
                root: OnceCell::new(),
            });
        }
        let spread = self
            .squares
            .rows(from, to - from)
            .map(|d| 1.0 + tau * d.max(0.0));
        let moments = self.moments.rows(from, to - from);
        let mut taken = self.cross.columns(from, to - from).into_owned();
        for (mut column, spread) in taken.column_iter_mut().zip(spread.iter()) {
            column *= (tau / spread).sqrt();
        }
        let lower = Cholesky::new(&self.precision - &taken * taken.transpose())?.unpack();
        let weighted = moments.zip_map(&spread, |q, spread| q * (tau / spread).sqrt());
        let mut known = taken * &weighted;
        lower.solve_lower_triangular_unchecked_mut(&mut known);
        let logs = 0.5 * spread.map(f64::ln).sum() + lower.diagonal().map(f64::ln).sum();
        let fit = 0.5 * (weighted.norm_squared() + known.norm_squared());
        Some(Beside {
            parts: (fit, logs - self.log_root),
            lower,
            known,
            root: OnceCell::new(),
        })
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

    /// Without a narrow group that is in.
    pub fn without(&self, k: usize) -> Option<Without<'_>> {
        let (place, width) = (self.places[k], self.model.widths[k]);
        let own = self.covariance.view((place, place), (width, width));
        let precision = Cholesky::new(own.into_owned())?.inverse();
        let mean = &self.mean.as_slice()[place..place + width];
        let own = Candidate::of_posterior(&precision, mean, self.model.tau[k]);
        let parts = own.parts(self.model.tau[k]);
        Some(Without {
            solved: self,
            k,
            precision,
            own,
            parts,
            loss: parts.0 - parts.1,
        })
    }
}

/// What a model would be without one of its groups; effects of runs stay as they are.
pub struct Without<'a> {
    pub(super) solved: &'a Solved,
    k: usize,
    precision: DMatrix<f64>,
    /// The group itself, as if it were out.
    pub own: Candidate,
    parts: (f64, f64),
    /// What its leaving takes from the log evidence.
    pub loss: f64,
}

impl Without<'_> {
    /// The variance with which another group gains most, and what it gains, if more than `least`.
    ///
    /// A wide one gains what it gains with this one, and what this one gains less beside it.
    pub fn best_above(&self, j: usize, sizes: &[f64], least: f64) -> Option<(f64, f64)> {
        let wide = self.solved.model.widths[j];
        if wide <= WIDE {
            return self.other(j).best_above(sizes, least);
        }
        let tau = self.solved.model.tau[self.k];
        let (place, width) = (self.solved.places[self.k], self.precision.nrows());
        best_above(sizes, least, wide, |size| {
            let beside = self.solved.with_wide(j, size)?;
            let (fit, log_root) = beside.parts;
            // The volume of this one is greater beside the other.
            if fit + self.parts.0 - log_root <= least {
                return Some((fit + self.parts.0, log_root));
            }
            if !self.solved.outside[j].is_empty() {
                return Some(self.other(j).parts(size));
            }
            let root = beside.root().rows(place, width);
            let precision = Cholesky::new(root * root.transpose())?.inverse();
            let mean = self.solved.mean.rows(place, width) - root * &beside.known;
            let less = Candidate::of_posterior(&precision, mean.as_slice(), tau).parts(tau);
            Some((
                fit + self.parts.0 - less.0,
                log_root + self.parts.1 - less.1,
            ))
        })
    }

    /// Another narrow group that is out, in a model without this one.
    pub fn other(&self, j: usize) -> Candidate {
        let (solved, width) = (self.solved, self.precision.nrows());
        let mut candidate = solved.outside(j);
        let reach = solved.reach.view(
            (solved.places[self.k], solved.places[j]),
            (width, solved.model.widths[j]),
        );
        candidate.s += reach.tr_mul(&(&self.precision * reach));
        candidate.q += reach.tr_mul(&self.own.q);
        candidate
    }
}
