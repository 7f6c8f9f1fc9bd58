//! Covariance for any correlation within clusters of readings: scores summed over each.

use nalgebra::{DMatrix, DVector};

use super::LinearModel;
use super::groups::Sums;
use crate::interrupt;

/// A cluster whose leverage in some direction comes this close to 1 alone decides on it: its
/// residual says nothing there.
const ALONE: f64 = 1.0 - 1e-6;

/// With more coefficients the adjustment of each cluster is left out (CR1): its factor for all.
const MOST: usize = 256;

/// Covariance of the coefficients, and degrees of freedom of each one's variance.
#[derive(Clone, Debug)]
pub struct Robust {
    /// Of the coefficients.
    pub covariance: DMatrix<f64>,
    /// Of the variance of each.
    pub freedom: Vec<f64>,
}

/// CR2 of Bell and McCaffrey with their degrees of freedom, `sums.moment` the scores `X' W e`
/// about the common fit and `penalty` what a ridge added to the diagonal.
///
/// None where the clusters together do not determine all coefficients.
pub fn cluster_covariance(clusters: &[Sums], penalty: f64) -> Option<Robust> {
    let (count, first) = (clusters.len() as f64, clusters.first()?);
    let n = first.moment.len();
    let gram = clusters[1..]
        .iter()
        .fold(first.gram.clone(), |sum, c| sum + &c.gram);
    let model = model(&gram)?;
    if model.rank() < n {
        return None;
    }
    let root = model.root();
    let bread = if penalty > 0.0 {
        let held = &gram + DMatrix::identity(n, n) * penalty;
        self::model(&held)?.inverse()
    } else {
        model.inverse()
    };
    if n > MOST {
        let mut scores = DMatrix::zeros(clusters.len(), n);
        for (mut row, cluster) in scores.row_iter_mut().zip(clusters) {
            row.copy_from(&cluster.moment.transpose());
        }
        let half = scores * bread * (count / (count - 1.0)).sqrt();
        return Some(Robust {
            covariance: half.tr_mul(&half),
            freedom: vec![count - 1.0; n],
        });
    }
    let towards = root.tr_mul(&gram) * bread;
    let (mut scores, mut own) = (DMatrix::zeros(clusters.len(), n), Vec::new());
    let mut through = Vec::new();
    for (mut row, cluster) in scores.row_iter_mut().zip(clusters) {
        interrupt::point();
        let share = root.tr_mul(&cluster.gram) * root;
        let found = (0.5 * (&share + share.transpose())).symmetric_eigen();
        let leverage = found.eigenvalues.map(|value| value.clamp(0.0, 1.0));
        let left = leverage.map(|value| {
            if value < ALONE {
                1.0 - value
            } else {
                f64::INFINITY
            }
        });
        let turned = found.eigenvectors.tr_mul(&towards);
        let score = found.eigenvectors.tr_mul(&root.tr_mul(&cluster.moment));
        row.copy_from(
            &turned
                .tr_mul(&score.zip_map(&left, |s, l| s / l.sqrt()))
                .transpose(),
        );
        let squares = turned.component_mul(&turned);
        own.push(squares.tr_mul(&leverage.component_div(&left)));
        let weights = leverage.zip_map(&left, |value, l| value / l.sqrt());
        through.push(found.eigenvectors * DMatrix::from_diagonal(&weights) * turned);
    }
    Some(Robust {
        covariance: scores.tr_mul(&scores),
        freedom: (0..n).map(|j| freedom(j, &own, &through)).collect(),
    })
}

fn model(gram: &DMatrix<f64>) -> Option<LinearModel> {
    let none = DMatrix::zeros(gram.ncols(), 0);
    LinearModel::of_sums(gram, &none, &[], None, None)
}

/// Satterthwaite's `(tr B)^2 / tr B^2` of a coefficient's sum of squares.
///
/// `B_rs = own_r [r = s] - through_r' through_s` under white noise.
fn freedom(j: usize, own: &[DVector<f64>], through: &[DMatrix<f64>]) -> f64 {
    let columns: Vec<_> = through.iter().map(|part| part.column(j)).collect();
    let towards = DMatrix::from_columns(&columns);
    let mut form = -towards.tr_mul(&towards);
    for (r, part) in own.iter().enumerate() {
        form[(r, r)] += part[j];
    }
    let square = form.norm_squared();
    let found = if square > 0.0 {
        form.trace().powi(2) / square
    } else {
        1.0
    };
    found.max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clusters() -> Vec<(DMatrix<f64>, DVector<f64>)> {
        (0..6)
            .map(|r| {
                let x = DMatrix::from_fn(9 + r, 2, |i, j| {
                    (((7 * r + i) * (2 * j + 3)) as f64).sin() + j as f64
                });
                let e = DVector::from_fn(9 + r, |i, _| ((11 * r + 2 * i) as f64).cos());
                (x, e)
            })
            .collect()
    }

    /// The definition, reading by reading: `A_r = (I - X_r G^-1 X_r')^-1/2`.
    #[test]
    fn covariance_is_that_of_adjusted_residuals() {
        let parts = clusters();
        let sums: Vec<_> = parts
            .iter()
            .map(|(x, e)| Sums {
                gram: x.tr_mul(x),
                moment: x.tr_mul(e),
                squares: 0.0,
            })
            .collect();
        let found = cluster_covariance(&sums, 0.0).unwrap();
        let gram = sums.iter().fold(DMatrix::zeros(2, 2), |g, s| g + &s.gram);
        let bread = gram.try_inverse().unwrap();
        let mut middle = DMatrix::zeros(2, 2);
        for (x, e) in &parts {
            let n = x.nrows();
            let left = DMatrix::identity(n, n) - x * &bread * x.transpose();
            let eigen = left.symmetric_eigen();
            let powers = eigen.eigenvalues.map(|v| 1.0 / v.sqrt());
            let adjust = &eigen.eigenvectors
                * DMatrix::from_diagonal(&powers)
                * eigen.eigenvectors.transpose();
            let score = x.tr_mul(&(adjust * e));
            middle += &score * score.transpose();
        }
        let expected = &bread * middle * &bread;
        assert!((found.covariance - &expected).amax() < 1e-12 * expected.amax());
        assert!(found.freedom.iter().all(|f| (1.0..6.0).contains(f)));
    }

    #[test]
    fn coefficients_that_nobody_tells_apart_have_none() {
        let mut sums: Vec<_> = clusters()
            .iter()
            .map(|(x, e)| Sums {
                gram: x.tr_mul(x),
                moment: x.tr_mul(e),
                squares: 0.0,
            })
            .collect();
        for one in &mut sums {
            one.gram.fill(one.gram[(0, 0)]);
        }
        assert!(cluster_covariance(&sums, 0.0).is_none());
    }
}
