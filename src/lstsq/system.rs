//! Runs with a zero each and the harmonics they share: solution and covariance.

use nalgebra::{DMatrix, DMatrixView, DVector};

use super::Triangle;
use super::blocked::{invert_upper, product, times_transpose};
use super::singular::singular;

/// Above this size the condition number is estimated by power iteration (a few per
/// cent low at most) instead of all singular values, whose cost grows fastest.
const SINGULAR_VALUES_UP_TO: usize = 128;

/// Most steps of the power iteration, and the change at which it stops.
const POWER_STEPS: usize = 30;
const POWER_CHANGE: f64 = 1e-3;

/// What remains of one run's own zero: `norm * zero + coupling . shared = target`.
#[derive(Clone, Debug)]
pub struct Pivot {
    /// `sqrt` of the run's sum of weights.
    pub norm: f64,
    /// One element per shared column.
    pub coupling: Vec<f64>,
    /// Right-hand side.
    pub target: f64,
}

/// Runs with a zero each, and the harmonics they share.
#[derive(Clone, Debug)]
pub struct System {
    /// One per run.
    pub runs: Vec<Pivot>,
    /// The shared columns after every run's zero is taken out.
    pub shared: Triangle,
}

/// The solution of a [`System`]; variances are those for readings of unit variance.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// One zero per run.
    pub offsets: Vec<f64>,
    /// Variance of each zero.
    pub offset_variances: Vec<f64>,
    /// One coefficient per shared column.
    pub coefficients: Vec<f64>,
    /// Weighted sum of squared residuals.
    pub squares: f64,
    /// Unknowns the readings pay for: all of them, fewer where a ridge holds them.
    pub unknowns: f64,
    spread: Spread,
    runs: Vec<Pivot>,
}

/// A root of the covariance of the coefficients. The covariance itself costs more than
/// the solution, and not every caller looks at it.
#[derive(Clone, Debug)]
enum Spread {
    /// The triangle `R` (and its right-hand side): the covariance is `(R' R)^-1`.
    Triangle(DMatrix<f64>),
    /// A square root `S`: the covariance is `S' S`.
    Root(DMatrix<f64>),
}

impl Spread {
    /// Variance of `vector . coefficients`.
    fn variance(&self, vector: &DVector<f64>) -> f64 {
        let n = vector.len();
        match self {
            Self::Triangle(factor) => factor
                .view((0, 0), (n, n))
                .tr_solve_upper_triangular(vector)
                .map_or(f64::NAN, |root| root.norm_squared()),
            Self::Root(root) => (root * vector).norm_squared(),
        }
    }

    fn covariance(&self, n: usize) -> DMatrix<f64> {
        match self {
            Self::Triangle(factor) => {
                let mut inverse = factor.view((0, 0), (n, n)).into_owned();
                invert_upper(inverse.as_view_mut());
                let mut covariance = DMatrix::zeros(n, n);
                times_transpose(inverse.as_view(), covariance.as_view_mut());
                covariance
            }
            Self::Root(root) => product(root.transpose().as_view(), root.as_view()),
        }
    }
}

impl System {
    /// Unknowns: zeros and shared columns.
    pub fn unknowns(&self) -> usize {
        self.runs.len() + self.columns()
    }

    fn columns(&self) -> usize {
        self.shared.factor.ncols() - 1
    }

    /// Minimises the squares of the residuals plus `sum of ridge * coefficient^2`.
    ///
    /// With a ridge the covariance is that of the biased estimate, `H G H` with
    /// `H = (G + ridge)^-1` and `G` the Gram matrix. None when singular.
    pub fn solve(&self, ridge: Option<&[f64]>) -> Option<Estimate> {
        let n = self.columns();
        let square = self.shared.square();
        let left_over = square[(n, n)].powi(2);
        let (coefficients, spread, squares, paid) = if let Some(ridge) = ridge {
            let held = self.held(ridge);
            let factor = held.square();
            let coefficients = back_substitute(&factor)?;
            let mut inverse = factor.view((0, 0), (n, n)).into_owned();
            invert_upper(inverse.as_view_mut());
            let plain = square.view((0, 0), (n, n));
            let share = product(plain, inverse.as_view());
            let misfit = (plain * &coefficients - square.view((0, n), (n, 1))).norm_squared();
            let spread = Spread::Root(product(share.as_view(), inverse.transpose().as_view()));
            (
                coefficients,
                spread,
                left_over + misfit,
                share.norm_squared(),
            )
        } else {
            let coefficients = back_substitute(&square)?;
            let spread = Spread::Triangle(square.into_owned());
            (coefficients, spread, left_over, n as f64)
        };
        let mut offsets = Vec::with_capacity(self.runs.len());
        let mut offset_variances = Vec::with_capacity(self.runs.len());
        for run in &self.runs {
            let coupling = DVector::from_column_slice(&run.coupling);
            offsets.push((run.target - coupling.dot(&coefficients)) / run.norm);
            offset_variances.push((1.0 + spread.variance(&coupling)) / run.norm.powi(2));
        }
        Some(Estimate {
            offsets,
            offset_variances,
            coefficients: coefficients.as_slice().to_vec(),
            squares,
            unknowns: self.runs.len() as f64 + paid,
            spread,
            runs: self.runs.clone(),
        })
    }

    /// The shared triangle with the ridge's rows below it.
    fn held(&self, ridge: &[f64]) -> Triangle {
        let n = ridge.len();
        let mut rows = DMatrix::zeros(n, n + 1);
        for (i, penalty) in ridge.iter().enumerate() {
            rows[(i, i)] = penalty.sqrt();
        }
        let mut held = self.shared.clone();
        held.stack(&rows);
        held
    }

    /// What [`Self::condition_number`] does not exceed: the product of the Frobenius norms
    /// of the factor and of its inverse, at a fraction of the price of singular values.
    /// Infinite for a large system, where the condition number itself is cheaper.
    pub fn condition_bound(&self) -> f64 {
        let n = self.columns();
        if self.runs.len() + n > SINGULAR_VALUES_UP_TO {
            return f64::INFINITY;
        }
        let square = self.shared.square();
        let mut inverse = square.view((0, 0), (n, n)).into_owned();
        let mut norm = inverse.norm_squared();
        invert_upper(inverse.as_view_mut());
        let mut norm_of_inverse = inverse.norm_squared();
        for run in &self.runs {
            let coupling = DVector::from_column_slice(&run.coupling);
            norm += run.norm.powi(2) + coupling.norm_squared();
            let across = inverse.tr_mul(&coupling).norm_squared();
            norm_of_inverse += (1.0 + across) / run.norm.powi(2);
        }
        let bound = (norm * norm_of_inverse).sqrt();
        if bound.is_nan() { f64::INFINITY } else { bound }
    }

    /// A closer bound, which is near where the columns are nearly at right angles: by the
    /// greatest sums over a row of the Gram matrix and of its inverse. Infinite for a large
    /// system.
    pub fn near_condition_bound(&self) -> f64 {
        if self.unknowns() > SINGULAR_VALUES_UP_TO {
            return f64::INFINITY;
        }
        let factor = self.factor();
        let mut inverse = factor.clone();
        invert_upper(inverse.as_view_mut());
        let gram = product(factor.transpose().as_view(), factor.as_view());
        let back = product(inverse.as_view(), inverse.transpose().as_view());
        let bound = (greatest_row(&gram) * greatest_row(&back)).sqrt();
        if bound.is_nan() { f64::INFINITY } else { bound }
    }

    /// The whole triangle: a row per run above the shared one.
    fn factor(&self) -> DMatrix<f64> {
        let (runs, n) = (self.runs.len(), self.columns());
        let mut factor = DMatrix::zeros(runs + n, runs + n);
        for (i, run) in self.runs.iter().enumerate() {
            factor[(i, i)] = run.norm;
            for (j, value) in run.coupling.iter().enumerate() {
                factor[(i, runs + j)] = *value;
            }
        }
        let square = self.shared.square();
        let shared = square.view((0, 0), (n, n));
        factor.view_mut((runs, runs), (n, n)).copy_from(&shared);
        factor
    }

    /// Ratio of the greatest to the least singular value of the weighted design with
    /// one column per run and one per shared coefficient.
    pub fn condition_number(&self) -> f64 {
        let (runs, n) = (self.runs.len(), self.columns());
        if runs + n <= SINGULAR_VALUES_UP_TO {
            let values = singular(&self.factor()).values;
            return values[0] / values[values.len() - 1];
        }
        let square = self.shared.square();
        let shared = square.view((0, 0), (n, n));
        let greatest = power(runs + n, |v| self.squared(&shared, &v));
        let least = power(runs + n, |v| self.unsquared(&shared, v));
        (greatest * least).sqrt()
    }

    /// `F' F v` of the whole factor `F`: a row per run above the shared triangle.
    fn squared(&self, shared: &DMatrixView<f64>, v: &DVector<f64>) -> DVector<f64> {
        let runs = self.runs.len();
        let below = v.rows(runs, shared.ncols());
        let mut out = DVector::zeros(v.len());
        out.rows_mut(runs, shared.ncols())
            .copy_from(&shared.tr_mul(&(shared * below)));
        for (i, run) in self.runs.iter().enumerate() {
            let coupling = DVector::from_column_slice(&run.coupling);
            let along = run.norm * v[i] + coupling.dot(&below);
            out[i] = run.norm * along;
            out.rows_mut(runs, shared.ncols())
                .axpy(along, &coupling, 1.0);
        }
        out
    }

    /// `(F' F)^-1 v`.
    fn unsquared(&self, shared: &DMatrixView<f64>, v: DVector<f64>) -> DVector<f64> {
        let runs = self.runs.len();
        let mut below = v.rows(runs, shared.ncols()).into_owned();
        let mut up = v;
        for (i, run) in self.runs.iter().enumerate() {
            up[i] /= run.norm;
            below.axpy(-up[i], &DVector::from_column_slice(&run.coupling), 1.0);
        }
        let solved = shared
            .tr_solve_upper_triangular(&below)
            .and_then(|x| shared.solve_upper_triangular(&x));
        let Some(below) = solved else {
            up.fill(f64::INFINITY);
            return up;
        };
        for (i, run) in self.runs.iter().enumerate() {
            let coupling = DVector::from_column_slice(&run.coupling);
            up[i] = (up[i] - coupling.dot(&below)) / run.norm;
        }
        up.rows_mut(runs, shared.ncols()).copy_from(&below);
        up
    }
}

/// The greatest sum of a row's magnitudes, of a symmetric matrix: no eigenvalue exceeds it.
fn greatest_row(matrix: &DMatrix<f64>) -> f64 {
    let sums = matrix.column_iter().map(|column| column.abs().sum());
    // A sum that is no number is kept.
    sums.fold(0.0, |most, sum| if sum <= most { most } else { sum })
}

/// The coefficients of a triangle with its right-hand side; None when singular.
fn back_substitute(square: &DMatrix<f64>) -> Option<DVector<f64>> {
    let n = square.ncols() - 1;
    let factor = square.view((0, 0), (n, n));
    let pivots = factor.diagonal().abs();
    if n > 0 && pivots.min() <= pivots.max() * f64::EPSILON * n as f64 {
        return None;
    }
    let target = square.view((0, n), (n, 1)).column(0).into_owned();
    let found = factor.solve_upper_triangular(&target)?;
    found.iter().all(|c| c.is_finite()).then_some(found)
}

/// Greatest eigenvalue of a symmetric positive operator.
fn power(size: usize, apply: impl Fn(DVector<f64>) -> DVector<f64>) -> f64 {
    // Any start with a part of every eigenvector will do; this one is reproducible.
    let mut vector = DVector::from_fn(size, |i, _| 1.0 + (i as f64).sin());
    let mut value = 0.0;
    for _ in 0..POWER_STEPS {
        vector.normalize_mut();
        vector = apply(vector);
        let previous = value;
        value = vector.norm();
        if !value.is_finite() {
            return f64::INFINITY;
        }
        if value - previous < POWER_CHANGE * value {
            break;
        }
    }
    value
}

impl Estimate {
    /// Covariance of `[sum of share * zero, coefficients]`, row by row: the first
    /// unknown is a mean of the zeros with the given shares.
    pub fn covariance(&self, shares: &[f64]) -> Vec<f64> {
        let n = self.coefficients.len();
        let mut coupling = DVector::zeros(n);
        let mut own = 0.0;
        for (run, share) in self.runs.iter().zip(shares) {
            let share = share / run.norm;
            coupling += share * DVector::from_column_slice(&run.coupling);
            own += share * share;
        }
        let covariance = self.spread.covariance(n);
        let cross = -(&covariance * &coupling);
        let mut full = DMatrix::zeros(1 + n, 1 + n);
        full[(0, 0)] = own - coupling.dot(&cross);
        full.view_mut((1, 0), (n, 1)).copy_from(&cross);
        full.view_mut((0, 1), (1, n)).copy_from(&cross.transpose());
        full.view_mut((1, 1), (n, n)).copy_from(&covariance);
        full.as_slice().to_vec()
    }
}
