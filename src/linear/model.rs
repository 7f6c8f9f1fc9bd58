//! Least squares of one design for some targets, and what it cannot see.

use nalgebra::{DMatrix, SymmetricEigen};

use super::rank_limit;
use crate::lstsq::{Singular, Triangle, cholesky, invert_upper, product, singular};

/// A triangle of unit columns whose condition is below this needs no singular values: all of
/// its directions are far above the rank limit of any size.
const REGULAR_ROWS: f64 = 1e6;

/// Columns that keep this part of their length beside those before them are far above the
/// limit as well, and are solved by their Cholesky factor: of columns that nearly cancel in
/// many steps the inverse of the matrix itself has negative variances.
const REGULAR_SUMS: f64 = 1e-4;

/// Steps for each eigenvalue: a handful are usual.
const STEPS: usize = 100;

/// A root `H` of the pseudo-inverse, `H H' = (X' W X)^+`, and `H' X' W y` of every target.
#[derive(Clone, Debug)]
pub struct LinearModel {
    root: DMatrix<f64>,
    turned: DMatrix<f64>,
    /// Directions left out: unit vectors in scaled columns.
    unseen: DMatrix<f64>,
    /// Sum of squared residuals of every target.
    pub squares: Vec<f64>,
    /// Of `X' W X`, over the directions that are seen.
    pub log_determinant: f64,
}

impl LinearModel {
    /// From the triangle of `[design | targets]`; None where a number is not finite.
    pub fn of_rows(triangle: &Triangle, targets: usize) -> Option<Self> {
        let full = triangle.square();
        let n = full.ncols() - targets;
        let right = full.view((0, n), (n, targets));
        let below = full.view((n, n), (targets, targets));
        let mut squares: Vec<f64> = below.column_iter().map(|c| c.norm_squared()).collect();
        let mut unit = full.view((0, 0), (n, n)).into_owned();
        let lengths: Vec<f64> = unit.column_iter().map(|c| c.norm()).collect();
        let lengths = scales(&lengths)?;
        if right.iter().any(|value| !value.is_finite()) {
            return None;
        }
        for (mut column, length) in unit.column_iter_mut().zip(&lengths) {
            column.unscale_mut(*length);
        }
        let size = 2.0 * lengths.iter().map(|length| length.ln()).sum::<f64>();
        let mut inverse = unit.clone();
        invert_upper(inverse.as_view_mut());
        if unit.norm() * inverse.norm() < REGULAR_ROWS {
            let seen = unit.diagonal().iter().map(|d| d.abs().ln()).sum::<f64>();
            return Some(Self {
                root: divided(inverse, &lengths),
                turned: right.into_owned(),
                unseen: DMatrix::zeros(n, 0),
                squares,
                log_determinant: size + 2.0 * seen,
            });
        }
        if unit.iter().any(|value| !value.is_finite()) {
            return None;
        }
        let Singular {
            values,
            left,
            turns,
        } = singular(&unit);
        let (kept, lost) = parted(&values, rank_limit(n) * values[0]);
        let left = left.select_columns(&kept);
        let turned = left.tr_mul(&right);
        let missed = right - &left * &turned;
        for (square, column) in squares.iter_mut().zip(missed.column_iter()) {
            *square += column.norm_squared();
        }
        let mut root = turns.select_columns(&kept);
        for (mut column, &k) in root.column_iter_mut().zip(&kept) {
            column.unscale_mut(values[k]);
        }
        Some(Self {
            root: divided(root, &lengths),
            turned,
            unseen: turns.select_columns(&lost),
            squares,
            log_determinant: size + 2.0 * kept.iter().map(|&k| values[k].ln()).sum::<f64>(),
        })
    }

    /// From `X' W X`, `X' W y` of every target and `y' W y`; None where a number is not finite.
    ///
    /// `lengths` are those of the columns with nothing beside them, where something was taken
    /// out of the sums already; `floor` is the part of their squares that has to be left where
    /// more than rounding is asked for.
    pub fn of_sums(
        gram: &DMatrix<f64>,
        moments: &DMatrix<f64>,
        squares: &[f64],
        lengths: Option<&[f64]>,
        floor: Option<f64>,
    ) -> Option<Self> {
        let n = gram.ncols();
        let own: Vec<f64>;
        let lengths = if let Some(lengths) = lengths {
            lengths
        } else {
            own = gram.diagonal().iter().map(|d| d.max(0.0).sqrt()).collect();
            &own
        };
        let lengths = scales(lengths)?;
        let unit = DMatrix::from_fn(n, n, |i, j| {
            0.5 * (gram[(i, j)] + gram[(j, i)]) / (lengths[i] * lengths[j])
        });
        if unit.iter().chain(moments).any(|value| !value.is_finite()) {
            return None;
        }
        let size = 2.0 * lengths.iter().map(|length| length.ln()).sum::<f64>();
        let mut lower = unit.clone();
        let regular = floor.is_none() && cholesky(lower.as_view_mut()).is_some();
        if regular && lower.diagonal().iter().all(|&pivot| pivot > REGULAR_SUMS) {
            let seen = lower.diagonal().iter().map(|pivot| pivot.ln()).sum::<f64>();
            let mut root = lower.lower_triangle().transpose();
            invert_upper(root.as_view_mut());
            let root = divided(root, &lengths);
            return Some(Self::finished(
                root,
                DMatrix::zeros(n, 0),
                (moments, squares),
                size + 2.0 * seen,
            ));
        }
        let found = SymmetricEigen::try_new(unit, f64::EPSILON, STEPS * (n + 1))?;
        let values = found.eigenvalues;
        let greatest = values.iter().fold(1.0, |most: f64, &value| most.max(value));
        let (kept, lost) = parted(values.as_slice(), floor.unwrap_or(rank_limit(n) * greatest));
        let mut root = found.eigenvectors.select_columns(&kept);
        for (mut column, &k) in root.column_iter_mut().zip(&kept) {
            column.unscale_mut(values[k].sqrt());
        }
        let unseen = found.eigenvectors.select_columns(&lost);
        let seen = kept.iter().map(|&k| values[k].ln()).sum::<f64>();
        let root = divided(root, &lengths);
        Some(Self::finished(
            root,
            unseen,
            (moments, squares),
            size + seen,
        ))
    }

    fn finished(
        root: DMatrix<f64>,
        unseen: DMatrix<f64>,
        (moments, squares): (&DMatrix<f64>, &[f64]),
        log_determinant: f64,
    ) -> Self {
        let turned = root.tr_mul(moments);
        let explained = turned.column_iter().map(|column| column.norm_squared());
        let pairs = squares.iter().zip(explained);
        Self {
            squares: pairs.map(|(all, part)| (all - part).max(0.0)).collect(),
            root,
            turned,
            unseen,
            log_determinant,
        }
    }

    /// Unknowns.
    pub fn columns(&self) -> usize {
        self.root.nrows()
    }

    /// Directions that are seen.
    pub fn rank(&self) -> usize {
        self.root.ncols()
    }

    /// Solutions, a column for every target; of least norm in scaled columns.
    pub fn coefficients(&self) -> DMatrix<f64> {
        &self.root * &self.turned
    }

    /// `H` with `H H'` the pseudo-inverse of `X' W X`.
    pub fn root(&self) -> &DMatrix<f64> {
        &self.root
    }

    /// Directions that are not seen: unit vectors of scaled columns, one a column.
    pub fn unseen(&self) -> &DMatrix<f64> {
        &self.unseen
    }

    /// Pseudo-inverse of `X' W X`: the covariance under white noise of unit variance.
    pub fn inverse(&self) -> DMatrix<f64> {
        product(self.root.as_view(), self.root.transpose().as_view())
    }
}

/// What columns are divided by: their lengths, of columns of zeros nothing.
fn scales(lengths: &[f64]) -> Option<Vec<f64>> {
    let finite = lengths.iter().all(|length| length.is_finite());
    let scale = |&length: &f64| if length > 0.0 { length } else { 1.0 };
    finite.then(|| lengths.iter().map(scale).collect())
}

/// Rows divided by the lengths of the columns that they stand for.
fn divided(mut root: DMatrix<f64>, lengths: &[f64]) -> DMatrix<f64> {
    for (mut row, length) in root.row_iter_mut().zip(lengths) {
        row.unscale_mut(*length);
    }
    root
}

/// Places of values above a limit, and of the others, each from the greatest on.
fn parted(values: &[f64], limit: f64) -> (Vec<usize>, Vec<usize>) {
    let mut places: Vec<usize> = (0..values.len()).collect();
    places.sort_by(|&i, &j| values[j].total_cmp(&values[i]));
    places.into_iter().partition(|&k| values[k] > limit)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of sums of some dozen elements of order 1, times a condition of a hundred.
    const ROUNDING: f64 = 1e-11;

    fn rows(height: usize, columns: usize) -> DMatrix<f64> {
        DMatrix::from_fn(height, columns, |i, j| {
            ((i * (2 * j + 3)) as f64).sin() + (j as f64).cos()
        })
    }

    fn of_rows(rows: &DMatrix<f64>, targets: usize) -> LinearModel {
        let flat = rows.transpose();
        LinearModel::of_rows(&Triangle::of_rows(rows.ncols(), flat.as_slice()), targets).unwrap()
    }

    fn of_sums(rows: &DMatrix<f64>, targets: usize) -> LinearModel {
        let n = rows.ncols() - targets;
        let design = rows.columns(0, n).into_owned();
        let right = rows.columns(n, targets).into_owned();
        let squares: Vec<f64> = right.column_iter().map(|c| c.norm_squared()).collect();
        let (gram, moments) = (design.tr_mul(&design), design.tr_mul(&right));
        LinearModel::of_sums(&gram, &moments, &squares, None, None).unwrap()
    }

    #[test]
    fn residuals_are_at_right_angles_to_the_columns_however_they_were_summed() {
        for (height, columns, targets) in [(40, 7, 1), (9, 8, 1), (60, 12, 3)] {
            let all = rows(height, columns + targets);
            let design = all.columns(0, columns);
            for model in [of_rows(&all, targets), of_sums(&all, targets)] {
                let left = all.columns(columns, targets) - design * model.coefficients();
                assert!(design.tr_mul(&left).amax() < ROUNDING * height as f64);
                assert_eq!(model.rank(), columns);
                for (square, column) in model.squares.iter().zip(left.column_iter()) {
                    assert!((square - column.norm_squared()).abs() < 1e-9 * (1.0 + square));
                }
                let gram = design.tr_mul(&design);
                let one = gram * model.inverse() - DMatrix::identity(columns, columns);
                assert!(one.amax() < 1e-9);
            }
        }
    }

    #[test]
    fn a_column_made_of_others_is_left_out_whatever_its_scale() {
        for scale in [1.0, 1e-9, 1e9] {
            let mut all = rows(50, 6);
            let made = scale * (all.column(0) - 2.0 * all.column(1));
            all.set_column(3, &made);
            let mut without = all.clone().remove_column(3);
            let expected = of_rows(&without, 1);
            without.fill(0.0);
            for model in [of_rows(&all, 1), of_sums(&all, 1)] {
                assert_eq!(model.rank(), 4, "{scale}");
                assert_eq!(model.unseen().ncols(), 1);
                let square = expected.squares[0];
                assert!((model.squares[0] - square).abs() < 1e-9 * square);
                // Moore and Penrose: G P G = G.
                let design = all.columns(0, 5);
                let gram = design.tr_mul(&design);
                let again = &gram * model.inverse() * &gram;
                let size = gram.diagonal().map(f64::sqrt);
                let off = (again - &gram).component_div(&(&size * size.transpose()));
                assert!(off.amax() < 1e-8, "{scale}: {}", off.amax());
            }
        }
    }

    #[test]
    fn a_column_that_differs_by_more_than_rounding_is_seen() {
        let mut all = rows(50, 6);
        let nearly = all.column(0) + 1e-10 * all.column(3);
        all.set_column(3, &nearly);
        assert_eq!(of_rows(&all, 1).rank(), 5);
        // In squares that is below rounding.
        assert_eq!(of_sums(&all, 1).rank(), 4);
    }

    #[test]
    fn fewer_rows_than_columns_and_columns_of_zeros_have_no_information() {
        let all = rows(3, 6);
        let model = of_rows(&all, 1);
        assert_eq!(model.rank(), 3);
        assert!(model.squares[0] < ROUNDING);
        let mut all = rows(20, 4);
        all.fill_column(1, 0.0);
        for model in [of_rows(&all, 1), of_sums(&all, 1)] {
            assert_eq!(model.rank(), 2);
            assert!(model.coefficients()[1].abs() < ROUNDING);
        }
    }

    #[test]
    fn what_is_not_finite_has_no_solution() {
        let mut all = rows(20, 4);
        all[(3, 1)] = f64::NAN;
        let flat = all.transpose();
        assert!(LinearModel::of_rows(&Triangle::of_rows(4, flat.as_slice()), 1).is_none());
        let gram = all.tr_mul(&all);
        assert!(LinearModel::of_sums(&gram, &DMatrix::zeros(4, 1), &[1.0], None, None).is_none());
    }
}
