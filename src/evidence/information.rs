//! Gradient and average information of the evidence in the logarithms of the noise's variances.
//!
//! With `V` the covariance of all readings under the model, `K_j` that of term `j` (`K_0 = I`), and
//! `r = V^-1 y`, Fisher's identity gives, run by run,
//!
//! ```text
//! d log p / d a_j = -1/2 tr(C^-1 K_j) + 1/2 (r' K_j r + tr(Q U' K_j U)),   U = C^-1 [1 X]
//! ```
//!
//! with `Q` the posterior covariance of the run's zero and of its coefficients `b + d_r`. The
//! average of observed and expected information (Gilmour, Thompson and Cullis 1995) is
//! `1/2 v_i' V^-1 v_j` with `v_j = K_j r`: no product of it needs more than a pass over the
//! readings. It is positive, so that Newton steps ascend.

use std::borrow::Cow;

use nalgebra::{DMatrix, DVector};

use super::gram::{Gram, Whitened};
use super::model::{Effects, Model};
use super::posterior::Posterior;
use super::readings::{Readings, Run};
use super::rows::Rows;
use super::slopes::determinant_slopes;
use super::whitening::{Factor, Noise, State, TERMS, Terms, VARIANCES};
use crate::simd::{InstructionSet, Kernel, Lanes, MOST_LANES, dispatch};
use crate::{interrupt, threads};

/// Vectors of a product that are summed at once, so that sums do not wait for one another; the last
/// of them may be beyond a row.
const BLOCK: usize = 4;

/// Of the log evidence, in the logarithms of the variances.
#[derive(Clone, Debug)]
pub struct Information {
    /// Its gradient.
    pub gradient: DVector<f64>,
    /// Average information: about its curvature, with the other sign.
    pub average: DMatrix<f64>,
}

/// What a run adds: half its gradient, and moments and squares whose right-hand sides are `v_j`,
/// without the effects of runs.
struct Part {
    gradient: [f64; VARIANCES],
    moments: DMatrix<f64>,
    squares: DMatrix<f64>,
}

impl Readings {
    /// Gradient and information at a noise, from its Gram matrices and the model's posterior.
    pub fn information(
        &self,
        noise: Noise,
        model: &Model,
        grams: &[Gram],
        posterior: &Posterior,
    ) -> Option<Information> {
        let plain = |run| {
            let factor = Factor::new(noise, Run::decays(run));
            Whitened { factor, rows: None }
        };
        let whitened: Vec<Whitened> = self.runs().iter().map(plain).collect();
        self.information_of(model, grams, posterior, &whitened)
    }

    /// The same, given how each run is whitened.
    pub(super) fn information_of(
        &self,
        model: &Model,
        grams: &[Gram],
        posterior: &Posterior,
        whitened: &[Whitened],
    ) -> Option<Information> {
        let covariance = posterior.covariance();
        let work = |r: usize| {
            let total = Total::of(&grams[r], model, posterior, &covariance)?;
            Some(self.part(&self.runs()[r], &whitened[r], &grams[r], &total))
        };
        let parts = threads::map_parts(self.runs().len(), self.threads(), work);
        let parts = parts.collect::<Option<Vec<_>>>()?;
        let mut gradient = DVector::zeros(VARIANCES);
        let mut left = DMatrix::zeros(VARIANCES, VARIANCES);
        let mut moments = DMatrix::zeros(posterior.columns.len(), VARIANCES);
        for part in &parts {
            for j in 0..VARIANCES {
                gradient[j] += part.gradient[j];
            }
            left += &part.squares;
            moments += part.moments.select_rows(&posterior.columns);
        }
        left -= moments.tr_mul(&(&covariance * &moments));
        let sizes = whitened.first()?.factor.noise().variances();
        let average = DMatrix::from_fn(VARIANCES, VARIANCES, |i, j| {
            0.5 * sizes[i] * sizes[j] * left[(i, j)]
        });
        Some(Information {
            gradient,
            average: positive(average)?,
        })
    }

    /// The part of one run.
    fn part(&self, run: &Run, whitening: &Whitened, gram: &Gram, total: &Total) -> Part {
        let (factor, columns) = (&whitening.factor, self.columns());
        let chunks: Vec<(usize, usize)> = run.chunks().collect();
        let whitened = |k: usize, state: &mut State| match &whitening.rows {
            Some(rows) => Cow::Borrowed(&rows[k]),
            None => {
                let (start, count) = chunks[k];
                let mut rows = self.rows(run, start, count);
                factor.whiten(start, &mut rows, state);
                Cow::Owned(rows)
            }
        };
        // Forward: the residual, and the state at each chunk from which the backward pass starts it.
        let mut states = Vec::with_capacity(chunks.len());
        let mut state = State::new(columns);
        let mut residual = Rows::zeros(run.len(), 1);
        for (k, &(start, count)) in chunks.iter().enumerate() {
            interrupt::point();
            states.push(state.clone());
            let rows = whitened(k, &mut state);
            for i in 0..count {
                let own = rows.row(i).iter().zip(&total.residual).map(|(x, c)| x * c);
                residual.row_mut(start + i)[0] = own.sum();
            }
        }
        factor.back(0, &mut residual, &mut State::new(1));
        let r: Vec<f64> = (0..run.len()).map(|i| residual.row(i)[0]).collect();
        let mut v = scaled_products(&r, run.decays());
        let mut quadratic = [0.0; VARIANCES];
        for i in 0..run.len() {
            for j in 0..VARIANCES {
                quadratic[j] += r[i] * v.row(i)[j];
            }
        }
        // Backward: solutions `U` of all columns, their products with `v_j`, and the traces.
        let mut moments = vec![0.0; columns * v.stride()];
        let mut traces = [0.0; VARIANCES];
        let mut after = State::new(columns);
        for (k, mut state) in states.into_iter().enumerate().rev() {
            interrupt::point();
            let (start, count) = chunks[k];
            let mut rows = whitened(k, &mut state).into_owned();
            let work = Traces {
                factor,
                start,
                rows: &mut rows,
                state: &mut after,
                covariance: &total.covariance,
                traces: &mut traces,
            };
            dispatch(InstructionSet::best(), work);
            rows.add_products(&v.part(start, count), &mut moments);
        }
        let stride = v.stride();
        factor.whiten(0, &mut v, &mut State::new(VARIANCES));
        let mut squares = vec![0.0; VARIANCES * stride];
        v.add_products(&v, &mut squares);
        let determinant = determinant_slopes(factor);
        let sizes = factor.noise().variances();
        let half = |j: usize| 0.5 * (sizes[j] * (quadratic[j] + traces[j]) - determinant[j]);
        let n = gram.information;
        let zero = |j: usize| moments[j];
        let mut own = DMatrix::from_fn(columns - 2, VARIANCES, |i, j| {
            moments[(i + 1) * stride + j] - gram.means[i] * zero(j)
        });
        let mut left = DMatrix::from_fn(VARIANCES, VARIANCES, |i, j| {
            squares[i.min(j) * stride + i.max(j)] - zero(i) * zero(j) / n
        });
        if let Some(spread) = &total.effects {
            let taken = spread * &own;
            left -= own.tr_mul(&taken);
            own -= &gram.sums.products * taken;
        }
        Part {
            gradient: std::array::from_fn(half),
            moments: own,
            squares: left,
        }
    }
}

/// A matrix that is positive but for rounding, which grows as columns become one.
fn positive(matrix: DMatrix<f64>) -> Option<DMatrix<f64>> {
    if !matrix.iter().all(|x| x.is_finite()) {
        return None;
    }
    let mut axes = matrix.clone().symmetric_eigen();
    if axes.eigenvalues.min() >= 0.0 {
        return Some(matrix);
    }
    axes.eigenvalues.apply(|power| *power = power.max(0.0));
    Some(axes.recompose())
}

/// Posterior of a run's zero and of its coefficients `b + d_r`.
struct Total {
    /// What the columns of a row are multiplied by, so that their sum is the residual.
    residual: Vec<f64>,
    /// Covariance, rows as far apart as those of [`Rows`], zeros at the error.
    covariance: Vec<f64>,
    /// `E = W (I + W G W)^-1 W` where coefficients differ from run to run.
    effects: Option<DMatrix<f64>>,
}

impl Total {
    fn of(
        gram: &Gram,
        model: &Model,
        posterior: &Posterior,
        shared: &DMatrix<f64>,
    ) -> Option<Self> {
        let m = gram.means.len();
        let (mut mean, mut own) = (DVector::zeros(m), DMatrix::zeros(m, m));
        for (i, &c) in posterior.columns.iter().enumerate() {
            mean[c] = posterior.mean[(i, 0)];
            for (k, &d) in posterior.columns.iter().enumerate() {
                own[(c, d)] = shared[(i, k)];
            }
        }
        let omega = model.by_column(&model.omega);
        let on: Vec<usize> = (0..m).filter(|&c| omega[c] > 0.0).collect();
        let mut given = None;
        if !on.is_empty() {
            // With `E` the effects: mean b + E (g - G b), covariance
            // E + (I - E G) S (I - E G)'.
            let effects = Effects::of(&gram.sums.products, &omega, &on)?;
            let root = effects.whitened(DMatrix::identity(on.len(), on.len()));
            let inner = root.tr_mul(&root);
            let mut spread = DMatrix::zeros(m, m);
            for (i, &c) in on.iter().enumerate() {
                for (k, &d) in on.iter().enumerate() {
                    spread[(c, d)] = inner[(i, k)];
                }
            }
            let left = gram.sums.moments.column(0) - &gram.sums.products * &mean;
            mean += &spread * left;
            let kept = DMatrix::identity(m, m) - &spread * &gram.sums.products;
            own = &spread + &kept * own * kept.transpose();
            given = Some(spread);
        }
        let stride = Rows::width(m + 2);
        let zero = gram.level - gram.means.dot(&mean);
        let mut residual = vec![0.0; m + 2];
        residual[0] = -zero;
        residual[m + 1] = 1.0;
        let mut covariance = vec![0.0; (m + 2) * stride + BLOCK * MOST_LANES];
        let with_zero = -(&own * &gram.means);
        covariance[0] = 1.0 / gram.information - with_zero.dot(&gram.means);
        for i in 0..m {
            residual[i + 1] = -mean[i];
            covariance[i + 1] = with_zero[i];
            covariance[(i + 1) * stride] = with_zero[i];
            for k in 0..m {
                covariance[(i + 1) * stride + k + 1] = own[(i, k)];
            }
        }
        Some(Self {
            residual,
            covariance,
            effects: given,
        })
    }
}

/// `K_j r` of each term, a column each; the first is `r` itself.
fn scaled_products(r: &[f64], decays: &[Terms]) -> Rows {
    let mut out = Rows::zeros(r.len(), VARIANCES);
    let mut before = [0.0; TERMS];
    for i in 0..r.len() {
        let row = out.row_mut(i);
        row[0] = r[i];
        for j in 0..TERMS {
            before[j] *= decays[i][j];
            row[j + 1] = r[i] + before[j];
            before[j] += r[i];
        }
    }
    let mut after = [0.0; TERMS];
    for i in (0..r.len()).rev() {
        let row = out.row_mut(i);
        for j in 0..TERMS {
            row[j + 1] += after[j];
            after[j] = decays[i][j] * (after[j] + r[i]);
        }
    }
    out
}

/// A backward pass that adds `tr(Q U' K_j U)` to `traces`.
struct Traces<'w, 'a> {
    factor: &'w Factor<'a>,
    start: usize,
    rows: &'w mut Rows,
    state: &'w mut State,
    covariance: &'w [f64],
    traces: &'w mut [f64; VARIANCES],
}

impl Kernel for Traces<'_, '_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self {
            factor,
            start,
            rows,
            state,
            covariance,
            traces,
        } = self;
        let (stride, columns) = (rows.stride(), rows.columns());
        let mut plain = L::splat(0.0);
        let mut ahead = [L::splat(0.0); TERMS];
        let mut product = vec![0.0; stride + BLOCK * MOST_LANES];
        for i in (0..rows.len()).rev() {
            let row = rows.row_mut(i);
            factor.back_row::<L>(start + i, row, state);
            for c in (0..stride).step_by(BLOCK * L::N) {
                let mut sums = [L::splat(0.0); BLOCK];
                for k in 0..columns - 1 {
                    let factor = L::splat(row[k]);
                    for v in 0..BLOCK {
                        let own = Rows::load::<L>(covariance, k * stride + c + v * L::N);
                        sums[v] = factor.mul_add(own, sums[v]);
                    }
                }
                for v in 0..BLOCK {
                    Rows::store(sums[v], &mut product, c + v * L::N);
                }
            }
            for c in (0..stride).step_by(L::N) {
                let q = Rows::load::<L>(&product, c);
                plain = q.mul_add(Rows::load::<L>(row, c), plain);
                for j in 0..TERMS {
                    let after = Rows::load::<L>(state.terms(), j * stride + c);
                    ahead[j] = q.mul_add(after, ahead[j]);
                }
            }
            factor.back_step::<L>(start + i, row, state);
        }
        let zero = L::splat(0.0);
        let [whole, first, ..] = L::totals([plain, ahead[0], zero, zero]);
        let others = L::totals([ahead[1], ahead[2], ahead[3], ahead[4]]);
        traces[0] += whole;
        traces[1] += whole + 2.0 * first;
        for j in 1..TERMS {
            traces[j + 1] += whole + 2.0 * others[j - 1];
        }
    }
}
