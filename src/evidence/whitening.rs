//! Whitening by a semi-separable Cholesky factor: `C = w I + sum_j a_j exp(-|dt| / T_j) = L L'`.
//!
//! With `p_ij = exp(-(t_i - t_(i-1)) / T_j)`, the real terms of celerite (Foreman-Mackey et al.
//! 2017, AJ 154:220):
//!
//! ```text
//! S_i  = P_i (S_(i-1) + d_(i-1) v_(i-1) v_(i-1)') P_i,   P_i = diag(p_i)
//! d_i  = w + sum a - a' S_i a,    v_i = (1 - S_i a) / d_i
//! L_ik = sqrt(d_k) a' P_i ... P_(k+1) v_k  for i > k,    L_ii = sqrt(d_i)
//! ```
//!
//! A column is whitened in `O(N J)`. No number grows: decays are at most 1.

use super::rows::Rows;
use crate::simd::{InstructionSet, Kernel, Lanes, dispatch};

/// Exponential terms of the noise.
pub const TERMS: usize = 5;

/// Variances of the noise: its white part and its terms.
pub const VARIANCES: usize = TERMS + 1;

/// Correlation times of the terms in median steps of time; the last is a walk for any run.
pub const CORRELATION_TIMES: [f64; TERMS] = [3.0, 15.0, 80.0, 400.0, 4000.0];

/// Share of the total variance below which an innovation is rounding.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// One number for each term.
pub type Terms = [f64; TERMS];

/// Variances of the noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Of its white part; above 0.
    pub white: f64,
    /// Of each exponential term; not below 0.
    pub terms: Terms,
}

impl Noise {
    /// From the white variance and those of the terms in turn.
    pub fn of(variances: [f64; VARIANCES]) -> Self {
        let [white, terms @ ..] = variances;
        Self { white, terms }
    }

    /// The white variance, then those of the terms.
    pub fn variances(&self) -> [f64; VARIANCES] {
        std::array::from_fn(|i| {
            if i == 0 {
                self.white
            } else {
                self.terms[i - 1]
            }
        })
    }

    /// Variance of a reading.
    pub fn total(&self) -> f64 {
        self.white + self.terms.iter().sum::<f64>()
    }
}

/// Decay of each term from the reading before; zeros at the first reading.
pub fn decays(times: &[f64]) -> Vec<Terms> {
    let step = |pair: &[f64]| CORRELATION_TIMES.map(|length| (-(pair[1] - pair[0]) / length).exp());
    let first = times.first().map(|_| [0.0; TERMS]);
    first
        .into_iter()
        .chain(times.windows(2).map(step))
        .collect()
}

/// The factor `L` of a run under a noise.
#[derive(Clone, Debug)]
pub struct Factor<'a> {
    noise: Noise,
    decays: &'a [Terms],
    /// `sqrt(d_i) v_i`.
    gains: Vec<Terms>,
    /// `1 / sqrt(d_i)`.
    scales: Vec<f64>,
    /// `log|L|`.
    pub log_root: f64,
}

/// What is carried from one row to the next, a row of columns for each term.
#[derive(Clone, Debug)]
pub struct State {
    terms: Vec<f64>,
    last: Vec<f64>,
}

impl State {
    /// With this number of columns, before the first reading (after the last one for [`Factor::back`]).
    pub fn new(columns: usize) -> Self {
        let stride = Rows::width(columns);
        Self {
            terms: vec![0.0; TERMS * stride + Rows::SLACK],
            last: vec![0.0; stride + Rows::SLACK],
        }
    }

    /// A row for each term.
    #[inline(always)]
    pub(super) fn terms(&self) -> &[f64] {
        &self.terms
    }
}

impl<'a> Factor<'a> {
    /// Of readings with these decays.
    pub fn new(noise: Noise, decays: &'a [Terms]) -> Self {
        let mut made = Self {
            noise,
            decays,
            gains: Vec::with_capacity(decays.len()),
            scales: Vec::with_capacity(decays.len()),
            log_root: 0.0,
        };
        dispatch(InstructionSet::best(), Factorisation(&mut made));
        made
    }

    /// Readings.
    pub fn len(&self) -> usize {
        self.scales.len()
    }

    /// True without a reading.
    pub fn is_empty(&self) -> bool {
        self.scales.is_empty()
    }

    /// Its noise.
    pub(super) fn noise(&self) -> Noise {
        self.noise
    }

    /// `sqrt(d) v` and `1 / sqrt(d)` of a reading.
    #[inline(always)]
    pub(super) fn step(&self, i: usize) -> (Terms, f64) {
        (self.gains[i], self.scales[i])
    }

    /// Decay of each term from the reading before.
    #[inline(always)]
    pub(super) fn decay(&self, i: usize) -> Terms {
        self.decays[i]
    }

    /// Rows from reading `start` on become those of `L^-1 rows`; `state` is that of the row before.
    pub fn whiten(&self, start: usize, rows: &mut Rows, state: &mut State) {
        let factor = self;
        let work = Forward {
            factor,
            start,
            rows,
            state,
        };
        dispatch(InstructionSet::best(), work);
    }

    /// Rows from reading `start` on become those of `L^-T rows`; `state` is that of the row after.
    pub fn back(&self, start: usize, rows: &mut Rows, state: &mut State) {
        let factor = self;
        let work = Backward {
            factor,
            start,
            rows,
            state,
        };
        dispatch(InstructionSet::best(), work);
    }

    /// What a backward pass does at reading `i`: `row` becomes its solution `u`. On entry the state
    /// has `sum_(k > i) exp(-(t_k - t_i) / T_j) u_k`; [`Self::back_step`] moves it to the reading
    /// before.
    #[inline(always)]
    pub(super) fn back_row<L: Lanes>(&self, i: usize, row: &mut [f64], state: &State) {
        let stride = row.len() - Rows::SLACK;
        let gains = &self.gains[i];
        let mut factors = [L::splat(0.0); TERMS];
        for j in 0..TERMS {
            factors[j] = L::splat(gains[j] * self.noise.terms[j]);
        }
        let scale = L::splat(self.scales[i]);
        for c in (0..stride).step_by(L::N) {
            let mut u = Rows::load::<L>(row, c);
            for j in 0..TERMS {
                let after = Rows::load::<L>(&state.terms, j * stride + c);
                u = factors[j].neg_mul_add(after, u);
            }
            Rows::store(u * scale, row, c);
        }
    }

    /// Moves the state of a backward pass from reading `i`, whose solution `row` is, to the one before.
    #[inline(always)]
    pub(super) fn back_step<L: Lanes>(&self, i: usize, row: &[f64], state: &mut State) {
        let stride = row.len() - Rows::SLACK;
        for j in 0..TERMS {
            let decay = L::splat(self.decays[i][j]);
            for c in (0..stride).step_by(L::N) {
                let after = Rows::load::<L>(&state.terms, j * stride + c);
                let own = Rows::load::<L>(row, c);
                Rows::store((after + own) * decay, &mut state.terms, j * stride + c);
            }
        }
    }
}

struct Factorisation<'f, 'a>(&'f mut Factor<'a>);

impl Kernel for Factorisation<'_, '_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Factor {
            noise,
            decays,
            gains,
            scales,
            log_root,
        } = self.0;
        let (a, total) = (noise.terms, noise.total());
        let mut s = [[0.0; TERMS]; TERMS];
        // Products of innovations, whose logarithm is taken when they leave a safe range.
        let mut product = 1.0;
        for decay in *decays {
            let last = gains.last().unwrap_or(&[0.0; TERMS]);
            let (mut d, mut known) = (total, [0.0; TERMS]);
            for j in 0..TERMS {
                for k in 0..TERMS {
                    s[j][k] = (s[j][k] + last[j] * last[k]) * (decay[j] * decay[k]);
                    known[j] += s[j][k] * a[k];
                }
            }
            for j in 0..TERMS {
                d -= a[j] * known[j];
            }
            let d = if d > ROUNDING * total {
                d
            } else {
                ROUNDING * total
            };
            let scale = 1.0 / d.sqrt();
            let mut next = [0.0; TERMS];
            for j in 0..TERMS {
                next[j] = (1.0 - known[j]) * scale;
            }
            gains.push(next);
            scales.push(scale);
            product *= d / total;
            if product < 1e-200 {
                *log_root += 0.5 * product.ln();
                product = 1.0;
            }
        }
        *log_root += 0.5 * (product.ln() + decays.len() as f64 * total.ln());
    }
}

struct Forward<'w, 'a> {
    factor: &'w Factor<'a>,
    start: usize,
    rows: &'w mut Rows,
    state: &'w mut State,
}

impl Kernel for Forward<'_, '_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self {
            factor,
            start,
            rows,
            state,
        } = self;
        let (stride, a) = (rows.stride(), factor.noise.terms);
        if a == [0.0; TERMS] {
            // White noise: nothing is carried on.
            for i in 0..rows.len() {
                let scale = factor.scales[start + i];
                rows.row_mut(i)[..stride]
                    .iter_mut()
                    .for_each(|x| *x *= scale);
            }
            return;
        }
        for i in 0..rows.len() {
            let reading = start + i;
            let gains = &factor.gains[reading.saturating_sub(1)];
            let decays = &factor.decays[reading];
            let scale = L::splat(factor.scales[reading]);
            let (mut gain, mut decay) = ([L::splat(0.0); TERMS], [L::splat(0.0); TERMS]);
            let mut size = [L::splat(0.0); TERMS];
            for j in 0..TERMS {
                gain[j] = L::splat(gains[j]);
                decay[j] = L::splat(decays[j]);
                size[j] = L::splat(a[j]);
            }
            let row = rows.row_mut(i);
            for c in (0..stride).step_by(L::N) {
                let (mut z, last) = (Rows::load::<L>(row, c), Rows::load::<L>(&state.last, c));
                for j in 0..TERMS {
                    let before = Rows::load::<L>(&state.terms, j * stride + c);
                    let f = gain[j].mul_add(last, before) * decay[j];
                    Rows::store(f, &mut state.terms, j * stride + c);
                    z = size[j].neg_mul_add(f, z);
                }
                let white = z * scale;
                Rows::store(white, row, c);
                Rows::store(white, &mut state.last, c);
            }
        }
    }
}

struct Backward<'w, 'a> {
    factor: &'w Factor<'a>,
    start: usize,
    rows: &'w mut Rows,
    state: &'w mut State,
}

impl Kernel for Backward<'_, '_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        for i in (0..self.rows.len()).rev() {
            let row = self.rows.row_mut(i);
            self.factor.back_row::<L>(self.start + i, row, self.state);
            self.factor.back_step::<L>(self.start + i, row, self.state);
        }
    }
}
