//! What columns save beside a fit, against products and least squares as they are defined.

use nalgebra::{DMatrix, DVector};
use trueangle::linear::{Beside, Correlated, Left, Order, RunProducts, best_ratio};

const N: usize = 700;
/// One longer than what is held at once, one of a single reading, one that ends off a vector.
const BOUNDS: [(usize, usize); 3] = [(0, 601), (601, 602), (602, N)];
const RHO: f64 = 0.6;

/// Sums of some hundred products of numbers of size 1.
const ROUNDING: f64 = 1e-10;

/// Numbers without a pattern, rows of `k`.
fn noise(k: usize, seed: f64) -> DMatrix<f64> {
    DMatrix::from_fn(N, k, |i, j| {
        let turns = (1.0 + (i * (j + 2)) as f64 * 0.618 + seed).sin() * 43758.5453;
        turns - turns.floor() - 0.5
    })
}

fn rows(x: &DMatrix<f64>) -> Vec<f64> {
    x.transpose().as_slice().to_vec()
}

struct Case {
    roots: Vec<f64>,
    q: DMatrix<f64>,
    r: DVector<f64>,
    shapes: DMatrix<f64>,
    shares: Vec<f64>,
}

impl Case {
    fn new(effects: usize) -> Self {
        let roots: Vec<f64> = (0..N).map(|i| 1.0 + 0.1 * (i % 7) as f64).collect();
        let mut case = Self {
            roots,
            q: DMatrix::zeros(N, 0),
            r: DVector::zeros(N),
            shapes: noise(effects, 5.0) * 0.02,
            shares: (0..3 * effects).map(|i| 0.2 + 0.1 * i as f64).collect(),
        };
        case.q = case.mapped(&noise(5, 1.0)).qr().q();
        let y = noise(1, 2.0).column(0).into_owned();
        case.r = &y - &case.q * case.q.tr_mul(&y);
        case
    }

    fn noise(&self) -> Correlated<'_> {
        Correlated {
            bounds: &BOUNDS,
            rho: RHO,
            roots: Some(&self.roots),
        }
    }

    fn mapped(&self, x: &DMatrix<f64>) -> DMatrix<f64> {
        let mut out = vec![0.0; x.len()];
        self.noise().filtered(&rows(x), x.ncols(), &mut out);
        DMatrix::from_row_slice(N, x.ncols(), &out)
    }

    fn beside(&self) -> Beside {
        let taken = (self.shapes.as_slice(), &self.shares[..]);
        let (q, r) = (self.q.as_slice(), self.r.as_slice());
        Beside::new(self.noise(), q, r, taken, self.r.norm_squared(), 1e-4)
    }

    /// Products run by run, as they are defined.
    fn products(&self, x: &DMatrix<f64>) -> Vec<RunProducts> {
        let (mapped, seen) = (
            self.mapped(x),
            DMatrix::from_fn(N, 6, |i, j| if j < 5 { self.q[(i, j)] } else { self.r[i] }),
        );
        let runs = BOUNDS.iter().enumerate();
        runs.map(|(run, &(a, b))| {
            let own = mapped.rows(a, b - a);
            let part = x.rows(a, b - a).tr_mul(&self.shapes.rows(a, b - a));
            let shares = &self.shares[run * part.ncols()..(run + 1) * part.ncols()];
            let c = DMatrix::from_diagonal(&DVector::from_column_slice(shares));
            RunProducts {
                gram: own.tr_mul(&own) - &part * c * part.transpose(),
                moments: own.tr_mul(&seen.rows(a, b - a)),
            }
        })
        .collect()
    }
}

#[test]
fn columns_save_what_least_squares_takes_off_the_residual() {
    let case = Case::new(0);
    let beside = case.beside();
    for k in [1, 2, 3, 6] {
        let x = noise(k, 3.0);
        let mapped = case.mapped(&x);
        let left = &mapped - &case.q * case.q.tr_mul(&mapped);
        let moment = left.tr_mul(&case.r);
        let wanted = left.tr_mul(&left).lu().solve(&moment).unwrap();
        let (deviance, coefficients) = beside.gain((&rows(&x), k));
        let share = moment.dot(&wanted) / case.r.norm_squared();
        assert!((deviance + N as f64 * (-share).ln_1p()).abs() < ROUNDING * N as f64);
        assert!((DVector::from_vec(coefficients) - wanted).amax() < ROUNDING);
    }
}

#[test]
fn products_are_those_of_mapped_columns_less_what_run_effects_take() {
    for effects in [0, 2] {
        let case = Case::new(effects);
        let beside = case.beside();
        for k in [1, 2, 5] {
            let x = noise(k, 4.0);
            let runs = case.products(&x);
            let found = beside.powers((&rows(&x), k));
            for j in 0..k {
                let before: f64 = runs.iter().map(|run| run.gram[(j, j)]).sum();
                let all = runs.iter().map(|run| run.moments.row(j).into_owned());
                let all = all.reduce(|a, b| a + b).unwrap();
                let after = before - all.columns(0, 5).norm_squared();
                assert!((found.before[j] - before).abs() < ROUNDING);
                assert!((found.after[j] - after).abs() < ROUNDING);
                assert!((found.moment[j] - all[5]).abs() < ROUNDING);
            }
            let (ratio, deviance) = beside.ratio((&rows(&x), k), Order::Readings).unwrap();
            // A matrix is held column by column.
            let columns = beside.ratio((x.as_slice(), k), Order::Columns).unwrap();
            assert!(
                (columns.0 - ratio).abs() <= 1e-8 * ratio && (columns.1 - deviance).abs() < 1e-8
            );
            let left = Left {
                readings: N as f64,
                squares: case.r.norm_squared(),
            };
            let (a, b) = best_ratio(&runs, left).unwrap();
            assert!((ratio - a).abs() <= 1e-8 * a && (deviance - b).abs() < 1e-8);
        }
    }
}

#[test]
fn what_the_fit_or_another_column_has_saves_nothing() {
    let case = Case::new(0);
    let beside = case.beside();
    let known = noise(5, 1.0);
    let twice = DMatrix::from_columns(&[noise(1, 3.0).column(0), noise(1, 3.0).column(0)]);
    for x in [
        known.columns(0, 1).into_owned(),
        twice,
        DMatrix::zeros(N, 1),
    ] {
        let (deviance, coefficients) = beside.gain((&rows(&x), x.ncols()));
        assert_eq!(deviance, 0.0);
        assert!(coefficients.iter().all(|&c| c == 0.0));
    }
}
