//! Linear least squares by orthogonal triangles.
//!
//! Rows `[columns | right-hand side]` are reduced block by block to the triangle of
//! their QR factorisation, which is all that a solution needs: memory is that of the
//! triangle, whatever the number of rows, and triangles merge like the rows they
//! stand for. The design is never squared. With `linear` this is all that knows nalgebra.

mod blocked;
mod householder;
mod singular;
mod system;

use std::borrow::Cow;

use nalgebra::DMatrix;

pub(crate) use blocked::{cholesky, invert_upper, product, triangle};
pub(crate) use singular::{Singular, singular};
pub use system::{Estimate, Pivot, System};

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
        let rows = DMatrix::from_row_slice(height, columns, rows);
        if self.factor.nrows() == 0 {
            self.factor = triangle(rows);
        } else {
            self.stack(&rows);
        }
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
        if self.factor.nrows() == 0 {
            self.factor.clone_from(&other.factor);
        } else {
            self.stack(&other.factor);
        }
    }

    fn stack(&mut self, below: &DMatrix<f64>) {
        if below.nrows() == 0 {
            return;
        }
        let (top, columns) = self.factor.shape();
        let mut rows = DMatrix::zeros(top + below.nrows(), columns);
        rows.rows_mut(0, top).copy_from(&self.factor);
        rows.rows_mut(top, below.nrows()).copy_from(below);
        self.factor = triangle(rows);
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
    pub(crate) fn square(&self) -> Cow<'_, DMatrix<f64>> {
        if self.factor.is_square() {
            return Cow::Borrowed(&self.factor);
        }
        let columns = self.factor.ncols();
        Cow::Owned(self.factor.clone().resize(columns, columns, 0.0))
    }

    /// All of it, one row after the other.
    pub fn to_rows(&self) -> Vec<f64> {
        self.square().transpose().as_slice().to_vec()
    }

    /// Whether every number of it is finite.
    pub fn is_finite(&self) -> bool {
        self.factor.iter().all(|value| value.is_finite())
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
