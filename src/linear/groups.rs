//! Groups of readings by their sums, and what each looks like to the fit of the others.

use nalgebra::{DMatrix, DVector};

use super::LinearModel;
use crate::interrupt;

/// Normal equations of a group of readings.
#[derive(Clone, Debug)]
pub struct Sums {
    /// `X' W X`.
    pub gram: DMatrix<f64>,
    /// `X' W y`.
    pub moment: DVector<f64>,
    /// `y' W y`.
    pub squares: f64,
}

impl Sums {
    fn with(mut self, other: &Self) -> Self {
        self.gram += &other.gram;
        self.moment += &other.moment;
        self.squares += other.squares;
        self
    }

    /// Sum of squares that coefficients leave of this group.
    pub fn left_by(&self, coefficients: &DVector<f64>) -> f64 {
        let through = &self.gram * coefficients;
        self.squares + coefficients.dot(&through) - 2.0 * coefficients.dot(&self.moment)
    }
}

/// Every group with all the others merged, none where there are no others.
///
/// Halves are merged into halves: nothing is subtracted, so that a group that outweighs all
/// others takes no digits of them, and no more than the logarithm of the number of groups is
/// kept at a time.
pub fn others<T: Clone>(
    groups: &[T],
    merge: &impl Fn(T, &T) -> T,
    visit: &mut impl FnMut(usize, Option<&T>),
) {
    descend(groups, 0, None, merge, visit);
}

fn descend<T: Clone>(
    groups: &[T],
    first: usize,
    outside: Option<&T>,
    merge: &impl Fn(T, &T) -> T,
    visit: &mut impl FnMut(usize, Option<&T>),
) {
    if groups.len() < 2 {
        if !groups.is_empty() {
            interrupt::point();
            visit(first, outside);
        }
        return;
    }
    let half = groups.len() / 2;
    let beside = |some: &[T]| {
        let (start, rest) = match outside {
            Some(outside) => (outside.clone(), some),
            None => (some[0].clone(), &some[1..]),
        };
        rest.iter().fold(start, merge)
    };
    let (left, right) = groups.split_at(half);
    descend(left, first, Some(&beside(right)), merge, visit);
    descend(right, first + half, Some(&beside(left)), merge, visit);
}

/// Coefficients of the fit of the other groups and the sum of squares that they leave of the
/// one left out, group by group; None where a number is not finite, or for a single group.
///
/// `ridge` is added to the diagonal, relative to its mean.
pub fn left_out(groups: &[Sums], ridge: f64) -> Option<(DMatrix<f64>, Vec<f64>)> {
    let n = groups.first()?.moment.len();
    let mut coefficients = DMatrix::zeros(n, groups.len());
    let mut squares = vec![f64::NAN; groups.len()];
    let mut finite = true;
    others(groups, &Sums::with, &mut |i, rest| {
        let found = rest.and_then(|rest| rest.solved(ridge));
        let Some(found) = found else {
            finite = false;
            return;
        };
        squares[i] = groups[i].left_by(&found);
        coefficients.set_column(i, &found);
    });
    finite.then_some((coefficients, squares))
}

impl Sums {
    fn solved(&self, ridge: f64) -> Option<DVector<f64>> {
        let n = self.moment.len();
        let mut gram = self.gram.clone();
        if ridge > 0.0 {
            let added = ridge * (gram.trace() / n as f64).max(f64::MIN_POSITIVE);
            (0..n).for_each(|i| gram[(i, i)] += added);
        }
        let moment = DMatrix::from_column_slice(n, 1, self.moment.as_slice());
        let model = LinearModel::of_sums(&gram, &moment, &[self.squares], None, None)?;
        Some(model.coefficients().column(0).into_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_group_meets_all_others_once() {
        for count in [0, 1, 2, 3, 7, 64] {
            let groups: Vec<Vec<usize>> = (0..count).map(|i| vec![i]).collect();
            let merge = |mut a: Vec<usize>, b: &Vec<usize>| {
                a.extend(b);
                a
            };
            let mut seen = Vec::new();
            others(&groups, &merge, &mut |i, rest| {
                let mut rest = rest.cloned().unwrap_or_default();
                rest.sort_unstable();
                let expected: Vec<_> = (0..count).filter(|&j| j != i).collect();
                assert_eq!(rest, expected);
                seen.push(i);
            });
            assert_eq!(seen, (0..count).collect::<Vec<_>>());
        }
    }

    #[test]
    fn what_is_left_of_a_group_is_what_a_fit_of_the_other_rows_leaves() {
        let design = DMatrix::from_fn(40, 3, |i, j| ((i * (2 * j + 3)) as f64).cos());
        let target = DVector::from_fn(40, |i, _| (0.3 * i as f64).sin());
        let part = |k: usize| (design.rows(10 * k, 10), target.rows(10 * k, 10));
        let groups: Vec<_> = (0..4)
            .map(|k| {
                let (x, y) = part(k);
                let (gram, moment) = (x.tr_mul(&x), x.tr_mul(&y));
                let squares = y.norm_squared();
                Sums {
                    gram,
                    moment,
                    squares,
                }
            })
            .collect();
        let (coefficients, squares) = left_out(&groups, 0.0).unwrap();
        for (k, square) in squares.iter().enumerate() {
            let kept = design.clone().remove_rows(10 * k, 10);
            let values = target.clone().remove_rows(10 * k, 10);
            let expected = kept.svd(true, true).solve(&values, 1e-12).unwrap();
            assert!((coefficients.column(k) - &expected).amax() < 1e-12);
            let (x, y) = part(k);
            let left = (y - x * expected).norm_squared();
            assert!((square - left).abs() < 1e-11 * left);
        }
        assert!(left_out(&groups[..1], 0.0).is_none());
    }
}
