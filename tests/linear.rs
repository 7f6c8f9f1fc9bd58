//! Linear models against matrices written out reading by reading.

use nalgebra::{DMatrix, DVector};
use trueangle::linear::{
    Left, LinearModel, RunProducts, Sums, best_ratio, cluster_covariance, left_out,
};
use trueangle::lstsq::Triangle;

/// Of sums of some dozen elements of order 1, times a condition of a hundred.
const SAME: f64 = 1e-9;

fn wave(i: usize, j: usize) -> f64 {
    ((i * (2 * j + 3)) as f64).sin() + 0.3 * (j as f64).cos()
}

fn sums(x: &DMatrix<f64>, e: &DVector<f64>) -> Sums {
    Sums {
        gram: x.tr_mul(x),
        moment: x.tr_mul(e),
        squares: e.norm_squared(),
    }
}

/// CR2 and its degrees of freedom by the whole hat matrix; the last column is one that the first
/// cluster alone tells, where its residuals say nothing.
#[test]
fn clusters_are_those_of_the_whole_hat_matrix() {
    for (columns, alone, penalty) in [(3, false, 0.0), (3, false, 2.5), (4, true, 0.0)] {
        let parts: Vec<(DMatrix<f64>, DVector<f64>)> = (0..6)
            .map(|r| {
                let own = |i, j| match j {
                    3 if r > 0 => 0.0,
                    3 if alone => 1.0,
                    _ => wave(7 * r + i, j),
                };
                let e = DVector::from_fn(9 + r, |i, _| ((11 * r + 2 * i) as f64).cos());
                (DMatrix::from_fn(9 + r, columns, own), e)
            })
            .collect();
        let all: Vec<Sums> = parts.iter().map(|(x, e)| sums(x, e)).collect();
        let found = cluster_covariance(&all, penalty).unwrap();
        let gram = all
            .iter()
            .fold(DMatrix::zeros(columns, columns), |g, s| g + &s.gram);
        let inverse = gram.clone().try_inverse().unwrap();
        let held = gram + DMatrix::identity(columns, columns) * penalty;
        let bread = held.try_inverse().unwrap();
        // Of each cluster `A_r X_r (G + p)^-1`: what its residuals are multiplied by.
        let adjusted: Vec<DMatrix<f64>> = parts
            .iter()
            .map(|(x, _)| {
                let n = x.nrows();
                let left = DMatrix::identity(n, n) - x * &inverse * x.transpose();
                let eigen = left.symmetric_eigen();
                let powers = eigen
                    .eigenvalues
                    .map(|v| if v > 1e-6 { v.powf(-0.5) } else { 0.0 });
                let q = &eigen.eigenvectors;
                q * DMatrix::from_diagonal(&powers) * q.transpose() * x * &bread
            })
            .collect();
        let scores = parts.iter().zip(&adjusted).map(|((_, e), a)| a.tr_mul(e));
        let covariance = scores.fold(DMatrix::zeros(columns, columns), |sum, s| {
            sum + &s * s.transpose()
        });
        assert!((found.covariance - &covariance).amax() < SAME * covariance.amax());
        for j in 0..columns {
            let form = DMatrix::from_fn(6, 6, |r, s| {
                let (a, b) = (adjusted[r].column(j), adjusted[s].column(j));
                let (x, z) = (&parts[r].0, &parts[s].0);
                let own = if r == s { a.norm_squared() } else { 0.0 };
                own - x.tr_mul(&a).dot(&(&inverse * z.tr_mul(&b)))
            });
            let freedom = (form.trace().powi(2) / form.norm_squared()).max(1.0);
            // Directions that one cluster alone tells leave rounding of a part in a million.
            let near = if alone { 1e-5 } else { SAME };
            assert!(
                (found.freedom[j] - freedom).abs() < near * freedom,
                "{columns} {penalty} {j}"
            );
        }
    }
}

/// Of more coefficients one factor serves for all clusters: `c / (c - 1)`.
#[test]
fn many_coefficients_have_one_factor_for_all_clusters() {
    let n = 257;
    let all: Vec<Sums> = (0..4)
        .map(|r| Sums {
            gram: DMatrix::from_diagonal(&DVector::from_fn(n, |i, _| 1.5 + wave(i, r))),
            moment: DVector::from_fn(n, |i, _| wave(i + 5, r)),
            squares: 0.0,
        })
        .collect();
    let found = cluster_covariance(&all, 0.0).unwrap();
    assert_eq!(found.freedom, vec![3.0; n]);
    for (i, j) in [(0, 0), (3, 200), (256, 17)] {
        let size = |i: usize| all.iter().map(|s| s.gram[(i, i)]).sum::<f64>();
        let both: f64 = all.iter().map(|s| s.moment[i] * s.moment[j]).sum();
        let expected = 4.0 / 3.0 * both / (size(i) * size(j));
        assert!((found.covariance[(i, j)] - expected).abs() < SAME);
    }
}

/// Of an element of a triangle or of sums: a determinant takes it relative to its least pivot.
const ROUNDING: f64 = 1e-13;

/// Columns `Q R` have the determinant of `R' R`, however near to each other they are.
#[test]
fn determinants_are_those_of_the_triangle() {
    let q = DMatrix::from_fn(40, 4, wave).qr().q();
    for (least, of_sums) in [(0.5, true), (1e-4, true), (1e-8, false)] {
        let mut r = DMatrix::from_fn(4, 4, |i, j| if i <= j { 2.0 + wave(i, j) } else { 0.0 });
        r[(2, 2)] = -least;
        let design = &q * &r;
        let expected: f64 = r.diagonal().iter().map(|d| 2.0 * d.abs().ln()).sum();
        let rows = design.clone().insert_column(4, 1.0).transpose();
        let model = LinearModel::of_rows(&Triangle::of_rows(5, rows.as_slice()), 1).unwrap();
        assert!((model.log_determinant - expected).abs() < ROUNDING / least + SAME);
        if of_sums {
            let gram = design.tr_mul(&design);
            let none = DMatrix::zeros(4, 0);
            let model = LinearModel::of_sums(&gram, &none, &[], None, None).unwrap();
            assert!((model.log_determinant - expected).abs() < ROUNDING / (least * least) + SAME);
        }
    }
}

/// A ridge is relative to the mean of the diagonal.
#[test]
fn what_is_left_out_is_fitted_by_the_others() {
    let parts: Vec<_> = (0..4)
        .map(|k| {
            let x = DMatrix::from_fn(10 + k, 3, |i, j| wave(20 * k + i, j));
            let y = DVector::from_fn(10 + k, |i, _| (0.3 * (20 * k + i) as f64).sin());
            (x, y)
        })
        .collect();
    let all: Vec<Sums> = parts.iter().map(|(x, y)| sums(x, y)).collect();
    for ridge in [0.0, 0.05] {
        let (coefficients, squares) = left_out(&all, ridge).unwrap();
        for (k, (x, y)) in parts.iter().enumerate() {
            let others = || (0..4).filter(|&r| r != k);
            let mut gram = others().fold(DMatrix::zeros(3, 3), |g, r| g + &all[r].gram);
            let moment = others().fold(DVector::zeros(3), |m, r| m + &all[r].moment);
            let mean = gram.trace() / 3.0;
            (0..3).for_each(|i| gram[(i, i)] += ridge * mean);
            let expected = gram.lu().solve(&moment).unwrap();
            assert!((coefficients.column(k) - &expected).amax() < SAME);
            assert!((squares[k] - (y - x * expected).norm_squared()).abs() < SAME);
        }
    }
}

/// The deviance of every ratio by the whole system, the greatest of a fine grid.
#[test]
fn the_best_ratio_is_that_of_the_whole_system() {
    // A parabola between trials four a decade apart.
    const NEAR: f64 = 0.02;
    for (runs, k, unit) in [(6, 2, 1.0), (6, 2, 1e3), (24, 2, 1.0), (12, 1, 1e-3)] {
        let n = 10 * runs;
        let q = DMatrix::from_fn(n, 3, wave).qr().q();
        let z = DMatrix::from_fn(n, k, |i, j| unit * wave(i + 7, j + 4));
        let y = DVector::from_fn(n, |i, _| {
            let run = 2.0 * (1.7 * (i / 10) as f64).sin();
            ((i * i) as f64).cos() + run * z[(i, 0)] / unit
        });
        let r = &y - &q * q.tr_mul(&y);
        let mut own = DMatrix::zeros(n, runs * k);
        let mut parts = Vec::new();
        for run in 0..runs {
            let part = z.rows(10 * run, 10);
            own.view_mut((10 * run, run * k), (10, k)).copy_from(&part);
            let mut moments = part.tr_mul(&q.rows(10 * run, 10)).insert_column(3, 0.0);
            moments.set_column(3, &part.tr_mul(&r.rows(10 * run, 10)));
            let gram = part.tr_mul(&part);
            parts.push(RunProducts { gram, moments });
        }
        let (readings, squares) = (n as f64, r.norm_squared());
        let (ratio, deviance) = best_ratio(&parts, Left { readings, squares }).unwrap();
        let (moment, through) = (own.tr_mul(&r), own.tr_mul(&q));
        let gram = own.tr_mul(&own);
        let of = |t: f64| {
            let unit = DMatrix::<f64>::identity(runs * k, runs * k);
            let inner = &unit / t + &gram - &through * through.transpose();
            let saved = moment.dot(&inner.lu().solve(&moment).unwrap());
            let paid = (unit + &gram * t).determinant().ln();
            readings * (squares / (squares - saved)).ln() - paid
        };
        assert!(
            (of(ratio) - deviance).abs() < 1e-6 * deviance,
            "{runs} {k} {unit}"
        );
        let grid = (0..160).map(|i| of(10.0_f64.powf(-4.0 + 0.05 * f64::from(i)) / unit.powi(2)));
        let best = grid.fold(0.0, f64::max);
        assert!(
            deviance > 1.0 && deviance > best - NEAR,
            "{runs} {k} {unit}: {deviance} {best}"
        );
    }
}
