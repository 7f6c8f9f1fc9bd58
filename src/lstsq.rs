//! Linear least squares by orthogonal triangles.
//!
//! Rows `[columns | right-hand side]` are reduced block by block to the triangle of
//! their QR factorisation, which is all that a solution needs: memory is that of the
//! triangle, whatever the number of rows, and triangles merge like the rows they
//! stand for. The design is never squared. This is the one module that knows nalgebra.

mod blocked;

use nalgebra::{DMatrix, DVector};

use blocked::{cholesky, invert_upper, times_transpose};

/// Above this size the condition number is estimated by power iteration (a few per
/// cent low at most) instead of all singular values, whose cost grows fastest.
const SINGULAR_VALUES_UP_TO: usize = 128;

/// Most steps of the power iteration, and the change at which it stops.
const POWER_STEPS: usize = 30;
const POWER_CHANGE: f64 = 1e-3;

/// The upper triangle `R` of rows; the last column is the right-hand side.
#[derive(Clone, Debug)]
pub struct Triangle {
    factor: DMatrix<f64>,
}

impl Triangle {
    /// No rows yet.
    pub fn new(columns: usize) -> Self {
        let factor = DMatrix::zeros(0, columns);
        Self { factor }
    }

    /// Adds rows, given one after the other.
    pub fn absorb(&mut self, rows: &[f64]) {
        let columns = self.factor.ncols();
        let height = rows.len() / columns;
        self.stack(&DMatrix::from_row_slice(height, columns, rows));
    }

    /// The triangle of some rows, given one after the other.
    pub fn of_rows(columns: usize, rows: &[f64]) -> Self {
        let mut triangle = Self::new(columns);
        triangle.absorb(rows);
        triangle
    }

    /// This triangle and another in one.
    pub fn merged(mut self, after: &Self) -> Self {
        self.merge(after);
        self
    }

    /// Adds the rows that another triangle stands for.
    pub fn merge(&mut self, other: &Self) {
        self.stack(&other.factor);
    }

    fn stack(&mut self, below: &DMatrix<f64>) {
        if below.nrows() == 0 {
            return;
        }
        let (top, columns) = self.factor.shape();
        let mut rows = DMatrix::zeros(top + below.nrows(), columns);
        rows.rows_mut(0, top).copy_from(&self.factor);
        rows.rows_mut(top, below.nrows()).copy_from(below);
        self.factor = rows.qr().unpack_r();
    }

    /// The triangle of rows whose Gram matrix is given, lower half column by column: the
    /// squares of the design are all that is left of it, so this is for well-conditioned
    /// problems. None when the matrix is not positive definite to working precision.
    pub fn from_gram(columns: usize, gram: Vec<f64>) -> Option<Self> {
        let mut lower = DMatrix::from_vec(columns, columns, gram);
        let n = columns - 1;
        cholesky(lower.view_mut((0, 0), (n, n)))?;
        let (design, target) = (lower.view((0, 0), (n, n)), lower.view((n, 0), (1, n)));
        let target = design.solve_lower_triangular(&target.transpose())?;
        let left_over = lower[(n, n)] - target.norm_squared();
        let mut factor = DMatrix::zeros(columns, columns);
        for j in 0..n {
            for i in 0..=j {
                factor[(i, j)] = lower[(j, i)];
            }
        }
        factor.view_mut((0, n), (n, 1)).copy_from(&target);
        factor[(n, n)] = left_over.max(0.0).sqrt();
        Some(Self { factor })
    }

    /// Takes the first column out: the row that holds it, and the rest.
    pub fn eliminate(&self) -> (Pivot, Self) {
        let columns = self.factor.ncols();
        let full = self.square();
        let sign = full[(0, 0)].signum();
        let pivot = Pivot {
            norm: sign * full[(0, 0)],
            coupling: (1..columns - 1).map(|j| sign * full[(0, j)]).collect(),
            target: sign * full[(0, columns - 1)],
        };
        let factor = full.view((1, 1), (columns - 1, columns - 1)).into_owned();
        (pivot, Self { factor })
    }

    /// The triangle with rows of zeros where there were too few.
    fn square(&self) -> DMatrix<f64> {
        let columns = self.factor.ncols();
        self.factor.clone().resize(columns, columns, 0.0)
    }

    /// The columns of the design part.
    pub fn design_columns(&self) -> Vec<Vec<f64>> {
        let square = self.square();
        let columns = square.ncols() - 1;
        (0..columns)
            .map(|j| square.column(j).iter().copied().collect())
            .collect()
    }
}

/// Triangles of many blocks of rows, merged in pairs like the carries of a binary counter:
/// rounding grows with the logarithm of the number of blocks.
#[derive(Clone, Debug, Default)]
pub struct Reduction {
    waiting: Vec<(u32, Triangle)>,
}

impl Reduction {
    /// Adds the triangle of the next block.
    pub fn push(&mut self, triangle: Triangle) {
        let (mut level, mut triangle) = (0, triangle);
        while let Some((_, before)) = self.waiting.pop_if(|(other, _)| *other == level) {
            triangle = before.merged(&triangle);
            level += 1;
        }
        self.waiting.push((level, triangle));
    }

    /// The triangle of all blocks; None without any.
    pub fn finish(self) -> Option<Triangle> {
        let triangles = self.waiting.into_iter().rev().map(|(_, triangle)| triangle);
        triangles.reduce(|after, before| before.merged(&after))
    }
}

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
    /// Covariance of the coefficients.
    covariance: DMatrix<f64>,
    runs: Vec<Pivot>,
}

impl System {
    /// Unknowns: zeros and shared columns.
    pub fn unknowns(&self) -> usize {
        self.runs.len() + self.shared.factor.ncols() - 1
    }

    /// Minimises the squares of the residuals plus `sum of ridge * coefficient^2`.
    ///
    /// With a ridge the covariance is that of the biased estimate, `H G H` with
    /// `H = (G + ridge)^-1` and `G` the Gram matrix. None when singular.
    pub fn solve(&self, ridge: Option<&[f64]>) -> Option<Estimate> {
        let square = self.shared.square();
        let n = square.ncols() - 1;
        let plain = square.view((0, 0), (n, n));
        let target = square.view((0, n), (n, 1));
        let left_over = square[(n, n)].powi(2);
        let held = ridge.map(|ridge| self.held(ridge).square());
        let factor = held.as_ref().unwrap_or(&square);
        let pivots = factor.view((0, 0), (n, n)).diagonal().abs();
        if n > 0 && pivots.min() <= pivots.max() * f64::EPSILON * n as f64 {
            return None;
        }
        let mut inverse = factor.view((0, 0), (n, n)).into_owned();
        invert_upper(inverse.view_mut((0, 0), (n, n)));
        let coefficients = &inverse * factor.view((0, n), (n, 1));
        if !coefficients.iter().all(|c| c.is_finite()) {
            return None;
        }
        let (covariance, paid) = if ridge.is_some() {
            let share = plain * &inverse;
            let spread = &share * inverse.transpose();
            (spread.tr_mul(&spread), share.norm_squared())
        } else {
            let mut covariance = DMatrix::zeros(n, n);
            times_transpose(inverse.as_view(), covariance.as_view_mut());
            (covariance, n as f64)
        };
        let misfit = (plain * &coefficients - target).norm_squared();
        let mut estimate = Estimate {
            offsets: Vec::with_capacity(self.runs.len()),
            offset_variances: Vec::with_capacity(self.runs.len()),
            coefficients: coefficients.iter().copied().collect(),
            squares: left_over + misfit,
            unknowns: self.runs.len() as f64 + paid,
            covariance,
            runs: self.runs.clone(),
        };
        for run in &self.runs {
            let coupling = DVector::from_column_slice(&run.coupling);
            let zero = (run.target - coupling.dot(&coefficients.column(0))) / run.norm;
            let shared = coupling.dot(&(&estimate.covariance * &coupling));
            estimate.offsets.push(zero);
            estimate
                .offset_variances
                .push((1.0 + shared) / run.norm.powi(2));
        }
        Some(estimate)
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

    /// Ratio of the greatest to the least singular value of the weighted design with
    /// one column per run and one per shared coefficient.
    pub fn condition_number(&self) -> f64 {
        let (runs, n) = (self.runs.len(), self.shared.factor.ncols() - 1);
        let mut factor = DMatrix::zeros(runs + n, runs + n);
        for (i, run) in self.runs.iter().enumerate() {
            factor[(i, i)] = run.norm;
            for (j, value) in run.coupling.iter().enumerate() {
                factor[(i, runs + j)] = *value;
            }
        }
        let square = self.shared.square();
        factor
            .view_mut((runs, runs), (n, n))
            .copy_from(&square.view((0, 0), (n, n)));
        if runs + n <= SINGULAR_VALUES_UP_TO {
            let values = factor.singular_values();
            return values.max() / values.min();
        }
        let greatest = power(runs + n, |v| factor.tr_mul(&(&factor * v)));
        let least = power(runs + n, |v| {
            let up = factor.tr_solve_upper_triangular(&v).unwrap_or(v);
            factor.solve_upper_triangular(&up).unwrap_or(up)
        });
        (greatest * least).sqrt()
    }
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
        let cross = -(&self.covariance * &coupling);
        let mut full = DMatrix::zeros(1 + n, 1 + n);
        full[(0, 0)] = own - coupling.dot(&cross);
        full.view_mut((1, 0), (n, 1)).copy_from(&cross);
        full.view_mut((0, 1), (1, n)).copy_from(&cross.transpose());
        full.view_mut((1, 1), (n, n)).copy_from(&self.covariance);
        full.as_slice().to_vec()
    }
}
