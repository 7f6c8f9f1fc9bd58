//! Whitening, Gram matrices, evidence, posterior and information against dense covariances.

use nalgebra::{Cholesky, DMatrix, DVector};
use trueangle::evidence::{Factor, Noise, Rows, State, TERMS, VARIANCES, decays};

use crate::cases::*;

fn rows_of(x: &DMatrix<f64>) -> Rows {
    let mut rows = Rows::zeros(x.nrows(), x.ncols());
    for i in 0..x.nrows() {
        for c in 0..x.ncols() {
            rows.row_mut(i)[c] = x[(i, c)];
        }
    }
    rows
}

fn matrix(rows: &Rows) -> DMatrix<f64> {
    DMatrix::from_fn(rows.len(), rows.columns(), |i, c| rows.row(i)[c])
}

#[test]
fn whitened_columns_are_those_of_the_dense_factor() {
    for (n, width) in [(1, 3), (2, 1), (150, 9)] {
        let time = times(n, n);
        let x = DMatrix::from_fn(n, width, normal);
        for noise in noises() {
            let found = Cholesky::new(dense(&noise, &time)).unwrap();
            let decays = decays(&time);
            let factor = Factor::new(noise, &decays);
            let log_root = found.l().diagonal().map(f64::ln).sum();
            assert!((factor.log_root - log_root).abs() < SAME * n as f64);
            let mut rows = rows_of(&x);
            factor.whiten(0, &mut rows, &mut State::new(x.ncols()));
            let white = found.l().solve_lower_triangular(&x).unwrap();
            assert!((matrix(&rows) - &white).amax() < SAME * white.amax().max(1.0));
            factor.back(0, &mut rows, &mut State::new(x.ncols()));
            let solved = found.solve(&x);
            assert!((matrix(&rows) - &solved).amax() < SAME * solved.amax().max(1.0));
        }
    }
}

/// Nothing overflows, and what is singular is held at the rounding of the total.
#[test]
fn extreme_noises_stay_finite() {
    let time: Vec<f64> = (0..400)
        .map(|i| 1e6 * f64::from(i % 2) + f64::from(i))
        .scan(0.0, |t, step| {
            *t += step;
            Some(*t)
        })
        .collect();
    let same = vec![5.0; 400];
    for time in [time, same] {
        let decays = decays(&time);
        for scale in [1e-200, 1.0, 1e200] {
            for white in [0.0, 1e-30, 1.0] {
                let noise = Noise {
                    white: scale * white,
                    terms: [scale; TERMS],
                };
                let factor = Factor::new(noise, &decays);
                let mut rows = rows_of(&DMatrix::from_element(400, 2, scale.sqrt()));
                factor.whiten(0, &mut rows, &mut State::new(2));
                assert!(factor.log_root.is_finite());
                assert!(matrix(&rows).iter().all(|x| x.is_finite()));
            }
        }
    }
}

#[test]
fn grams_are_those_of_the_dense_inverse() {
    let cases = cases(&LENGTHS);
    let readings = readings(&cases, &ORDERS);
    for noise in noises() {
        for (case, gram) in cases.iter().zip(readings.grams(noise)) {
            let n = case.theta.len();
            let covariance = Cholesky::new(dense(&noise, &in_steps(&case.time))).unwrap();
            let x = harmonics(&case.theta, &ORDERS);
            let y = DVector::from_column_slice(&case.error);
            let ones = DVector::from_element(n, 1.0);
            let own = covariance.solve(&ones);
            let information = ones.dot(&own);
            let projected =
                |c: &DMatrix<f64>| covariance.solve(c) - &own * (own.transpose() * c) / information;
            let y = DMatrix::from_column_slice(n, 1, y.as_slice());
            let expected = [
                (&gram.sums.products, x.tr_mul(&projected(&x))),
                (&gram.sums.moments, x.tr_mul(&projected(&y))),
                (&gram.sums.squares, y.tr_mul(&projected(&y))),
            ];
            for (found, wanted) in expected {
                assert!((found - &wanted).amax() <= SAME * (1.0 + wanted.amax()) * 10.0);
            }
            assert!((gram.information / information - 1.0).abs() < SAME);
            let log_root: f64 = covariance.l().diagonal().map(f64::ln).sum();
            let constant = 0.5 * (n as f64 - 1.0) * std::f64::consts::TAU.ln();
            let scale = -log_root - 0.5 * information.ln() - constant;
            assert!((gram.sums.log_scale - scale).abs() < SAME * n as f64);
        }
    }
}

/// All readings in one: their covariance without coefficients that all runs share, and the columns
/// of the zeros.
fn joined(
    cases: &[Case],
    noise: &Noise,
    orders: &[f64],
    omega: &[f64],
) -> (DMatrix<f64>, DMatrix<f64>) {
    let n = cases.iter().map(|case| case.theta.len()).sum();
    let (mut covariance, mut zeros) = (DMatrix::zeros(n, n), DMatrix::zeros(n, cases.len()));
    let mut start = 0;
    for (r, case) in cases.iter().enumerate() {
        let own = case.theta.len();
        let x = harmonics(&case.theta, orders);
        let each = DVector::from_fn(x.ncols(), |i, _| omega[i / 2]);
        let effects = DMatrix::from_diagonal(&each);
        let part = dense(noise, &in_steps(&case.time)) + &x * effects * x.transpose();
        covariance
            .view_mut((start, start), (own, own))
            .copy_from(&part);
        zeros.view_mut((start, r), (own, 1)).fill(1.0);
        start += own;
    }
    (covariance, zeros)
}

/// Log density of the readings with flat priors of their zeros, and `V^-1 y` without these.
fn density(
    covariance: DMatrix<f64>,
    zeros: &DMatrix<f64>,
    y: &DMatrix<f64>,
) -> (f64, DMatrix<f64>) {
    let found = Cholesky::new(covariance).unwrap();
    let own = found.solve(zeros);
    let inner = Cholesky::new(zeros.tr_mul(&own)).unwrap();
    let solved = found.solve(y) - &own * inner.solve(&own.tr_mul(y));
    let log = |found: &Cholesky<f64, nalgebra::Dyn>| found.l().diagonal().map(f64::ln).sum();
    let free = (y.nrows() - zeros.ncols()) as f64;
    let square = y.column(0).dot(&solved.column(0));
    let constant = free * std::f64::consts::TAU.ln();
    (
        -log(&found) - log(&inner) - 0.5 * (square + constant),
        solved,
    )
}

/// Errors of all runs, and the columns of all readings.
fn whole(cases: &[Case]) -> (DMatrix<f64>, DMatrix<f64>) {
    let error: Vec<f64> = cases.iter().flat_map(|case| case.error.clone()).collect();
    let theta: Vec<f64> = cases.iter().flat_map(|case| case.theta.clone()).collect();
    let y = DMatrix::from_column_slice(error.len(), 1, &error);
    (y, harmonics(&theta, &ORDERS))
}

#[test]
fn evidence_and_posterior_are_those_of_the_dense_covariance() {
    let cases = cases(&LENGTHS);
    let readings = readings(&cases, &ORDERS);
    let (y, x) = whole(&cases);
    for noise in noises() {
        let grams = readings.grams(noise);
        for model in models() {
            let (own, zeros) = joined(&cases, &noise, &ORDERS, &model.omega);
            let prior = DMatrix::from_diagonal(&DVector::from_fn(8, |i, _| model.tau[i / 2]));
            let all = own + &x * &prior * x.transpose();
            let (wanted, solved) = density(all.clone(), &zeros, &y);
            let found = model.posterior(&grams).unwrap();
            let near = SAME * wanted.abs();
            assert!(
                (found.log_evidence - wanted).abs() < near,
                "{}",
                found.log_evidence - wanted
            );
            let mean = &prior * x.tr_mul(&solved);
            // `T - T X' V^-1 X T`.
            let (_, solved) = density(all, &zeros, &(&x * &prior));
            let covariance = &prior - &prior * x.tr_mul(&solved);
            for (i, &c) in found.columns.iter().enumerate() {
                let apart = found.mean[(i, 0)] - mean[c];
                assert!(apart.abs() < 10.0 * SAME, "{apart:e}");
                for (k, &d) in found.columns.iter().enumerate() {
                    let apart = found.covariance()[(k, i)] - covariance[(d, c)];
                    assert!(apart.abs() < SAME * prior[(c, c)], "{apart:e}");
                }
            }
            let active = model
                .active()
                .iter()
                .map(|&k| model.widths[k])
                .sum::<usize>();
            assert_eq!(found.columns.len(), active);
        }
    }
}

#[test]
fn sums_of_runs_add_up() {
    let readings = readings(&cases(&LENGTHS), &ORDERS);
    let grams = readings.grams(noises()[0]);
    let mut total = grams[0].sums.clone();
    for gram in &grams[1..] {
        total.merge(&gram.sums);
    }
    let all = models()[0].sums(&grams);
    assert!((all.products - total.products).amax() < SAME);
    assert!((all.moments - total.moments).amax() < SAME);
    assert!((all.squares - total.squares).amax() < SAME * 1e2);
    assert!((all.log_scale - total.log_scale).abs() < SAME);
}

/// Gradient by differences of the evidence, information from dense covariances.
#[test]
fn gradient_and_information_are_those_of_the_dense_covariance() {
    let cases = cases(&LENGTHS);
    let readings = readings(&cases, &ORDERS);
    let (y, x) = whole(&cases);
    for noise in [noises()[0], noises()[2]] {
        for model in models() {
            let grams = readings.grams(noise);
            let posterior = model.posterior(&grams).unwrap();
            let found = readings
                .information(noise, &model, &grams, &posterior)
                .unwrap();
            let evidence = |variances: [f64; VARIANCES]| {
                let grams = readings.grams(Noise::of(variances));
                model.posterior(&grams).unwrap().log_evidence
            };
            // Richardson's differences: their error is of the fourth power of the step.
            for j in 0..VARIANCES {
                let moved = |step: f64| {
                    let mut variances = noise.variances();
                    variances[j] *= step.exp();
                    evidence(variances)
                };
                let slope = |step: f64| (moved(step) - moved(-step)) / (2.0 * step);
                let wanted = (4.0 * slope(1e-3) - slope(2e-3)) / 3.0;
                let near = 1e-7 * (1.0 + wanted.abs());
                assert!(
                    (found.gradient[j] - wanted).abs() < near,
                    "{j}: {} {wanted}",
                    found.gradient[j]
                );
            }
            let (own, zeros) = joined(&cases, &noise, &ORDERS, &model.omega);
            let prior = DMatrix::from_diagonal(&DVector::from_fn(8, |i, _| model.tau[i / 2]));
            let all = own + &x * &prior * x.transpose();
            let (_, solved) = density(all.clone(), &zeros, &y);
            let unit = |j: usize| {
                let mut variances = [0.0; VARIANCES];
                variances[j] = noise.variances()[j];
                let (own, _) = joined(&cases, &Noise::of(variances), &ORDERS, &[0.0; 4]);
                own * &solved
            };
            let v = DMatrix::from_columns(
                &(0..VARIANCES)
                    .map(|j| unit(j).column(0).into_owned())
                    .collect::<Vec<_>>(),
            );
            let (_, left) = density(all, &zeros, &v);
            let wanted = 0.5 * v.tr_mul(&left);
            assert!((&found.average - &wanted).amax() < 1e-8 * (1.0 + wanted.amax()));
        }
    }
}
