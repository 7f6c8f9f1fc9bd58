//! Many penalties at once, each judged by readings that were left out.

use nalgebra::{DMatrix, DVector};

use super::groups::others;
use super::rank_limit;
use crate::lstsq::{Singular, Triangle, singular};

/// Readings that are left out together.
#[derive(Clone, Debug)]
pub struct Fold {
    /// Of `[1 | columns | target]`.
    pub triangle: Triangle,
    /// Sum of weights.
    pub weight: f64,
}

/// Fits of all readings at every penalty, and what fits of the others leave of each fold.
#[derive(Clone, Debug)]
pub struct RidgePath {
    /// Coefficients at every penalty, one a column.
    pub coefficients: DMatrix<f64>,
    /// Mean square left of each fold, added up over the folds, at every penalty.
    pub scores: Vec<f64>,
}

impl Fold {
    fn with(mut self, other: &Self) -> Self {
        self.triangle.merge(&other.triangle);
        self.weight += other.weight;
        self
    }
}

/// Least squares with penalties relative to the sum of weights on every coefficient but the
/// zero; with `own_zeros` every fold has a zero of its own. None where a number is not finite.
pub fn ridge_path(folds: &[Fold], own_zeros: bool, penalties: &[f64]) -> Option<RidgePath> {
    let mut folds = folds.to_vec();
    if own_zeros {
        for fold in &mut folds {
            fold.triangle = fold.triangle.eliminate().1;
        }
    }
    let (first, rest) = folds.split_first()?;
    let whole = rest.iter().fold(first.clone(), Fold::with);
    let coefficients = solutions(&whole, own_zeros, penalties)?;
    let mut scores = vec![0.0; penalties.len()];
    let mut finite = true;
    others(&folds, &Fold::with, &mut |i, rest| {
        let Some(rest) = rest.filter(|rest| rest.weight > 0.0 && folds[i].weight > 0.0) else {
            return;
        };
        let Some(found) = solutions(rest, own_zeros, penalties) else {
            finite = false;
            return;
        };
        let rows = folds[i].triangle.square();
        let columns = rows.ncols() - 1;
        let missed = rows.columns(0, columns) * found;
        for (score, column) in scores.iter_mut().zip(missed.column_iter()) {
            *score += (column - rows.column(columns)).norm_squared() / folds[i].weight;
        }
    });
    let zeros = usize::from(!own_zeros);
    let harmonics = coefficients.rows(zeros, coefficients.nrows() - zeros);
    finite.then(|| RidgePath {
        coefficients: harmonics.into_owned(),
        scores,
    })
}

/// `[zero, coefficients]`, or the coefficients alone where the zeros are out already.
fn solutions(fold: &Fold, own_zeros: bool, penalties: &[f64]) -> Option<DMatrix<f64>> {
    if own_zeros {
        return penalised(&fold.triangle, fold.weight, penalties);
    }
    let (pivot, rest) = fold.triangle.eliminate();
    let found = penalised(&rest, fold.weight, penalties)?;
    let coupling = DVector::from_column_slice(&pivot.coupling);
    let mut all = found.insert_row(0, 0.0);
    if pivot.norm != 0.0 {
        for mut column in all.column_iter_mut() {
            let through = coupling.dot(&column.rows(1, coupling.len()));
            column[0] = (pivot.target - through) / pivot.norm;
        }
    }
    Some(all)
}

/// Minimises the squares of the residuals plus `weight * penalty * |b|^2`: here the columns are
/// not scaled, for the penalty holds each as it is.
fn penalised(triangle: &Triangle, weight: f64, penalties: &[f64]) -> Option<DMatrix<f64>> {
    let full = triangle.square();
    let n = full.ncols() - 1;
    if full.iter().any(|value| !value.is_finite()) {
        return None;
    }
    let square = full.view((0, 0), (n, n)).into_owned();
    let Singular {
        values,
        left,
        turns,
    } = singular(&square);
    let least = rank_limit(n) * values.first()?;
    let moment = left.tr_mul(&full.view((0, n), (n, 1)));
    let gains = DMatrix::from_fn(n, penalties.len(), |i, j| {
        let s = values[i];
        if s > least {
            s / (s * s + weight * penalties[j]) * moment[i]
        } else {
            0.0
        }
    });
    Some(turns * gains)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PENALTIES: [f64; 3] = [0.0, 1e-4, 1.0];

    fn rows() -> DMatrix<f64> {
        DMatrix::from_fn(36, 6, |i, j| match j {
            0 => 1.0,
            _ => ((i * (2 * j + 3)) as f64).sin() + (j as f64).cos(),
        })
    }

    fn folds(rows: &DMatrix<f64>) -> Vec<Fold> {
        (0..3)
            .map(|k| {
                let flat = rows.rows(12 * k, 12).transpose();
                let triangle = Triangle::of_rows(6, flat.as_slice());
                Fold {
                    triangle,
                    weight: 12.0,
                }
            })
            .collect()
    }

    /// `(X'X + p) b = X'y` by the normal equations, the columns of the zeros not held.
    fn direct(
        design: &DMatrix<f64>,
        target: &DVector<f64>,
        held: f64,
        zeros: usize,
    ) -> DVector<f64> {
        let mut gram = design.tr_mul(design);
        (zeros..gram.ncols()).for_each(|i| gram[(i, i)] += held);
        gram.lu().solve(&design.tr_mul(target)).unwrap()
    }

    #[test]
    fn fits_and_scores_are_those_of_rows() {
        let rows = rows();
        let target = rows.column(5).into_owned();
        for own_zeros in [false, true] {
            let zeros = if own_zeros { 3 } else { 1 };
            let mut design = rows.columns(1, 4).into_owned();
            for k in (0..zeros).rev() {
                design = design.insert_column(0, 0.0);
                let height = 36 / zeros;
                design.view_mut((k * height, 0), (height, 1)).fill(1.0);
            }
            let found = ridge_path(&folds(&rows), own_zeros, &PENALTIES).unwrap();
            for (j, penalty) in PENALTIES.iter().enumerate() {
                let whole = direct(&design, &target, 36.0 * penalty, zeros);
                let off = found.coefficients.column(j) - whole.rows(zeros, 4);
                assert!(off.amax() < 1e-10, "{own_zeros} {penalty}: {off}");
                let mut score = 0.0;
                for k in 0..3 {
                    let mut kept = design.clone().remove_rows(12 * k, 12);
                    let values = target.clone().remove_rows(12 * k, 12);
                    let mut own = design.rows(12 * k, 12).into_owned();
                    let mut values_here = target.rows(12 * k, 12).into_owned();
                    if own_zeros {
                        kept = kept.remove_column(k);
                        own = own.columns(3, 4).into_owned();
                        for mut column in own.column_iter_mut() {
                            let mean = column.mean();
                            column.add_scalar_mut(-mean);
                        }
                        let mean = values_here.mean();
                        values_here.add_scalar_mut(-mean);
                    }
                    let first = if own_zeros { 2 } else { 1 };
                    let b = direct(&kept, &values, 24.0 * penalty, first);
                    let b = if own_zeros {
                        b.rows(2, 4).into_owned()
                    } else {
                        b
                    };
                    score += (values_here - own * b).norm_squared() / 12.0;
                }
                assert!(
                    (found.scores[j] - score).abs() < 1e-9 * score,
                    "{own_zeros} {penalty}"
                );
            }
        }
    }
}
