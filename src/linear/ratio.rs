//! How large an error that every run draws anew is: the best ratio of its variance.

use nalgebra::{DMatrix, DVector, Dyn, SymmetricEigen};

use super::LinearModel;
use crate::interrupt;

/// Ratios of variance (run effect to one reading) that are tried, of a column of power 1: so many
/// a decade over so many decades from the least on. Between the best and its neighbours a parabola
/// tells it.
const PER_DECADE: i32 = 4;
const DECADES: i32 = 13;
const LEAST: i32 = -5;

/// Every so many of them first, as the maximum is broad.
const COARSE: usize = 4;

/// Share of the strongest column's power from which on one counts.
const COUNTS: f64 = 1e-12;

/// Columns up to which all ratios follow from one eigensystem of theirs.
const FEW_COLUMNS: usize = 40;

/// Most of the sum of squares that counts as saved: a logarithm is asked of what is left.
const ALL: f64 = 1.0 - 1e-15;

/// Steps for each eigenvalue: a handful are usual.
const STEPS: usize = 100;

/// What is added to the diagonal of a matrix of at most 1 that rounding may make negative.
const ROUNDING: f64 = 1e-12;

/// A run effect in one run: products of its columns, and of these with what is fitted,
/// orthonormal, and with what that leaves, all under a noise that is white.
pub struct RunProducts {
    /// Of the columns, `k` by `k`.
    pub gram: DMatrix<f64>,
    /// `k` by the fitted columns and one.
    pub moments: DMatrix<f64>,
}

/// A fit of so many readings that leaves this sum of squares.
#[derive(Clone, Copy, Debug)]
pub struct Left {
    /// Readings.
    pub readings: f64,
    /// Sum of squares.
    pub squares: f64,
}

impl Left {
    /// Twice the logarithm of the likelihood ratio that squares saved are worth.
    pub(super) fn deviance(self, saved: f64) -> f64 {
        -self.readings * (-(saved / self.squares).min(ALL)).ln_1p()
    }
}

/// The best ratio of variances beside what is fitted and the deviance that it saves; zeros where
/// none saves anything. None where a number is not finite.
///
/// With the columns of all runs turned to right angles, of power `D`, and `B` their share in the
/// fitted ones, a ratio `t` saves `b' (I / t + D - D^1/2 B B' D^1/2)^-1 b` of the squares, `b` their
/// products with the residual.
pub fn best_ratio(runs: &[RunProducts], left: Left) -> Option<(f64, f64)> {
    let turned = Turned::of(runs)?;
    if turned.power.is_empty() {
        return Some((0.0, 0.0));
    }
    let top = turned.power.iter().fold(0.0, |most: f64, &p| most.max(p));
    let unit = top.max(1e-300);
    let trials: Vec<f64> = (0..=PER_DECADE * DECADES)
        .map(|k| 10.0_f64.powf(f64::from(LEAST) + f64::from(k) / f64::from(PER_DECADE)) / unit)
        .collect();
    let saved = turned.saving()?;
    let deviance = |ratio: f64| {
        interrupt::point();
        let paid: f64 = turned.power.iter().map(|p| (ratio * p).ln_1p()).sum();
        left.deviance(saved(ratio)) - paid
    };
    let coarse: Vec<f64> = trials
        .iter()
        .step_by(COARSE)
        .map(|&t| deviance(t))
        .collect();
    let middle = COARSE * greatest(&coarse);
    let first = middle.saturating_sub(COARSE);
    let near = &trials[first..(middle + COARSE + 1).min(trials.len())];
    let found: Vec<f64> = near.iter().map(|&t| deviance(t)).collect();
    let k = greatest(&found);
    let mut best = (near[k], found[k]);
    if best.1 <= 0.0 {
        return Some((0.0, 0.0));
    }
    if 0 < k && k + 1 < near.len() {
        let steps = vertex(found[k - 1], found[k], found[k + 1]);
        let between = best.0 * (near[1] / near[0]).powf(steps);
        let there = deviance(between);
        if there > best.1 {
            best = (between, there);
        }
    }
    Some(best)
}

/// Where the first of the greatest values stands.
fn greatest(values: &[f64]) -> usize {
    (1..values.len()).fold(0, |best, k| if values[k] > values[best] { k } else { best })
}

/// Where a parabola through three points one apart is highest, from the middle one on.
fn vertex(before: f64, at: f64, after: f64) -> f64 {
    let bend = before - 2.0 * at + after;
    if bend < 0.0 {
        0.5 * (before - after) / bend
    } else {
        0.0
    }
}

/// Columns of all runs at right angles.
struct Turned {
    power: Vec<f64>,
    /// Shares in what is fitted, a row for each, and products with the residual.
    fitted: DMatrix<f64>,
    residual: DVector<f64>,
}

impl Turned {
    fn of(runs: &[RunProducts]) -> Option<Self> {
        // A matrix without columns has no eigensystem.
        let runs: Vec<_> = runs.iter().filter(|run| !run.gram.is_empty()).collect();
        let eigen = |run: &&RunProducts| eigensystem(run.gram.clone());
        let found = runs.iter().map(eigen).collect::<Option<Vec<_>>>()?;
        let values = found.iter().flat_map(|one| one.eigenvalues.iter());
        let limit = COUNTS * values.fold(1e-300, |most: f64, &value| most.max(value));
        let (mut power, mut rows) = (Vec::new(), Vec::new());
        for (run, one) in runs.iter().zip(&found) {
            let moments = one.eigenvectors.tr_mul(&run.moments);
            for (row, &value) in moments.row_iter().zip(one.eigenvalues.iter()) {
                if value > limit {
                    power.push(value);
                    rows.push(row / value.sqrt());
                }
            }
        }
        let columns = runs.first().map_or(1, |run| run.moments.ncols());
        let fitted = DMatrix::from_fn(rows.len(), columns - 1, |i, j| rows[i][j]);
        let residual = DVector::from_fn(rows.len(), |i, _| rows[i][columns - 1]);
        Some(Self {
            power,
            fitted,
            residual,
        })
    }

    /// Squares saved at a ratio.
    fn saving(&self) -> Option<Box<dyn Fn(f64) -> f64 + '_>> {
        if self.power.len() <= FEW_COLUMNS {
            self.of_few()
        } else {
            Some(Box::new(|ratio| self.of_many(ratio)))
        }
    }

    /// By the eigensystem of the columns beside the fitted ones.
    fn of_few(&self) -> Option<Box<dyn Fn(f64) -> f64>> {
        let root = DVector::from_iterator(self.power.len(), self.power.iter().map(|p| p.sqrt()));
        let mut beside = -(&self.fitted * self.fitted.transpose());
        add_to_diagonal(&mut beside, 1.0);
        beside.component_mul_assign(&(&root * root.transpose()));
        let found = eigensystem(beside)?;
        let moments = root.component_mul(&self.residual);
        let squares = found.eigenvectors.tr_mul(&moments).map(|m| m * m);
        let values = found.eigenvalues.map(|value| value.max(0.0));
        Some(Box::new(move |ratio| {
            let pairs = values.iter().zip(squares.iter());
            pairs.map(|(v, s)| s * ratio / (1.0 + ratio * v)).sum()
        }))
    }

    /// By a system of the size of the fitted columns.
    fn of_many(&self, ratio: f64) -> f64 {
        let shrink = self.power.iter().map(|p| ratio * p / (1.0 + ratio * p));
        let shrink = DVector::from_iterator(self.power.len(), shrink);
        let own: f64 = shrink
            .iter()
            .zip(self.residual.iter())
            .map(|(s, r)| s * r * r)
            .sum();
        let mut scaled = self.fitted.clone();
        for mut column in scaled.column_iter_mut() {
            column.component_mul_assign(&shrink);
        }
        let cross = scaled.tr_mul(&self.residual);
        let mut inner = -self.fitted.tr_mul(&scaled);
        add_to_diagonal(&mut inner, 1.0 + ROUNDING);
        let right = DMatrix::from_column_slice(cross.len(), 1, cross.as_slice());
        let found = LinearModel::of_sums(&inner, &right, &[0.0], None, None);
        own + found.map_or(f64::NAN, |model| cross.dot(&model.coefficients().column(0)))
    }
}

/// Values and vectors of a symmetric matrix; None where a number is not finite.
pub(super) fn eigensystem(matrix: DMatrix<f64>) -> Option<SymmetricEigen<f64, Dyn>> {
    let steps = STEPS * (matrix.nrows() + 1);
    let finite = matrix.iter().all(|value| value.is_finite());
    finite.then(|| SymmetricEigen::try_new(matrix, f64::EPSILON, steps))?
}

fn add_to_diagonal(matrix: &mut DMatrix<f64>, value: f64) {
    (0..matrix.nrows()).for_each(|i| matrix[(i, i)] += value);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By how much the parabola between trial ratios may miss the greatest deviance: one is what
    /// a standard error is worth.
    const NEAR: f64 = 0.02;

    /// Runs of ten readings with `k` columns of a run effect each, beside three fitted columns:
    /// products run by run, all columns with what is fitted taken out, the residual, all columns.
    fn case(runs: usize, k: usize) -> (Vec<RunProducts>, DMatrix<f64>, DVector<f64>, DMatrix<f64>) {
        let n = 10 * runs;
        let wave = |i: usize, j: usize| ((i * (2 * j + 3)) as f64).sin() + 0.3 * (j as f64).cos();
        let q = DMatrix::from_fn(n, 3, wave).qr().q();
        let z = DMatrix::from_fn(n, k, |i, j| wave(i + 7, j + 4));
        let y = DVector::from_fn(n, |i, _| {
            ((i * i) as f64).cos() + 2.0 * ((i / 10) as f64).sin()
        });
        let r = &y - &q * q.tr_mul(&y);
        let mut own = DMatrix::zeros(n, runs * k);
        let mut parts = Vec::new();
        for run in 0..runs {
            let (a, part) = (10 * run, z.rows(10 * run, 10));
            own.view_mut((a, run * k), (10, k)).copy_from(&part);
            let mut moments = DMatrix::zeros(k, 4);
            moments
                .columns_mut(0, 3)
                .copy_from(&part.tr_mul(&q.rows(a, 10)));
            moments.set_column(3, &part.tr_mul(&r.rows(a, 10)));
            let gram = part.tr_mul(&part);
            parts.push(RunProducts { gram, moments });
        }
        let beside = &own - &q * q.tr_mul(&own);
        (parts, beside, r, own)
    }

    /// `b' (I / t + Z' (I - Q Q') Z)^-1 b`, all at once.
    #[test]
    fn squares_saved_are_those_of_the_whole_system_however_many_columns() {
        for (runs, k) in [(3, 2), (4, 1), (25, 2)] {
            let (parts, beside, r, own) = case(runs, k);
            let moment = own.tr_mul(&r);
            let turned = Turned::of(&parts).unwrap();
            assert_eq!(turned.power.len(), runs * k);
            for ratio in [1e-3, 0.4, 50.0] {
                let mut inner = beside.tr_mul(&own);
                add_to_diagonal(&mut inner, 1.0 / ratio);
                let expected = moment.dot(&inner.lu().solve(&moment).unwrap());
                for found in [turned.saving().unwrap()(ratio), turned.of_many(ratio)] {
                    assert!(
                        (found - expected).abs() < 1e-9 * expected,
                        "{runs} {k} {ratio}"
                    );
                }
            }
        }
    }

    #[test]
    fn no_ratio_near_the_best_saves_more() {
        let (parts, _, r, _) = case(6, 2);
        let (readings, squares) = (r.len() as f64, r.norm_squared());
        let left = Left { readings, squares };
        let (ratio, deviance) = best_ratio(&parts, left).unwrap();
        assert!(ratio > 0.0 && deviance > 0.0);
        let turned = Turned::of(&parts).unwrap();
        for factor in [0.8, 0.95, 1.05, 1.25] {
            let near = factor * ratio;
            let paid: f64 = turned.power.iter().map(|p| (near * p).ln_1p()).sum();
            assert!(left.deviance(turned.saving().unwrap()(near)) - paid < deviance + NEAR);
        }
    }

    #[test]
    fn columns_of_zeros_save_nothing() {
        let (mut parts, _, r, _) = case(4, 1);
        for part in &mut parts {
            part.gram.fill(0.0);
            part.moments.fill(0.0);
        }
        let left = Left {
            readings: 40.0,
            squares: r.norm_squared(),
        };
        assert_eq!(best_ratio(&parts, left), Some((0.0, 0.0)));
        for part in &mut parts {
            part.gram = DMatrix::zeros(0, 0);
            part.moments = DMatrix::zeros(0, 4);
        }
        assert_eq!(best_ratio(&parts, left), Some((0.0, 0.0)));
    }

    #[test]
    fn what_is_not_finite_has_no_ratio() {
        let (mut parts, _, r, _) = case(4, 1);
        parts[2].gram[(0, 0)] = f64::NAN;
        let left = Left {
            readings: 40.0,
            squares: r.norm_squared(),
        };
        assert_eq!(best_ratio(&parts, left), None);
    }
}
