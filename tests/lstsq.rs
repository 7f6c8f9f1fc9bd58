//! Least squares against its defining identity and certified outside numbers.

use nalgebra::DMatrix;
use proptest::prelude::*;
use trueangle::lstsq::{Reduction, System, Triangle};

/// Of residuals and columns of order 1: normal equations hold to rounding.
const ORTHOGONAL: f64 = 1e-11;

/// The system of one run: rows `[1, columns | target]`.
fn system(columns: usize, rows: &[f64]) -> System {
    let (pivot, shared) = Triangle::of_rows(columns, rows).eliminate();
    System {
        runs: vec![pivot],
        shared,
    }
}

/// NIST StRD "Longley" (n = 16, 6 predictors, condition number about 5e9 unscaled).
#[test]
fn longley_has_its_certified_coefficients() {
    /// Certified digits kept: the problem loses nine of the sixteen (9 + 7 = 16).
    const KEPT: f64 = 1e-7;
    #[rustfmt::skip]
    let data = [
        [60323.0,  83.0, 234289.0, 2356.0, 1590.0, 107608.0, 1947.0],
        [61122.0,  88.5, 259426.0, 2325.0, 1456.0, 108632.0, 1948.0],
        [60171.0,  88.2, 258054.0, 3682.0, 1616.0, 109773.0, 1949.0],
        [61187.0,  89.5, 284599.0, 3351.0, 1650.0, 110929.0, 1950.0],
        [63221.0,  96.2, 328975.0, 2099.0, 3099.0, 112075.0, 1951.0],
        [63639.0,  98.1, 346999.0, 1932.0, 3594.0, 113270.0, 1952.0],
        [64989.0,  99.0, 365385.0, 1870.0, 3547.0, 115094.0, 1953.0],
        [63761.0, 100.0, 363112.0, 3578.0, 3350.0, 116219.0, 1954.0],
        [66019.0, 101.2, 397469.0, 2904.0, 3048.0, 117388.0, 1955.0],
        [67857.0, 104.6, 419180.0, 2822.0, 2857.0, 118734.0, 1956.0],
        [68169.0, 108.4, 442769.0, 2936.0, 2798.0, 120445.0, 1957.0],
        [66513.0, 110.8, 444546.0, 4681.0, 2637.0, 121950.0, 1958.0],
        [68655.0, 112.6, 482704.0, 3813.0, 2552.0, 123366.0, 1959.0],
        [69564.0, 114.2, 502601.0, 3931.0, 2514.0, 125368.0, 1960.0],
        [69331.0, 115.7, 518173.0, 4806.0, 2572.0, 127852.0, 1961.0],
        [70551.0, 116.9, 554894.0, 4007.0, 2827.0, 130081.0, 1962.0],
    ];
    let certified = [
        15.0618722713733,
        -0.358191792925910e-01,
        -2.02022980381683,
        -1.03322686717359,
        -0.511041056535807e-01,
        1829.15146461355,
    ];
    let certified_std = [
        84.9149257747669,
        0.334910077722432e-01,
        0.488399681651699,
        0.214274163161675,
        0.226073200069370,
        455.478499142212,
    ];
    let mut rows = Vec::new();
    for [y, x @ ..] in data {
        rows.push(1.0);
        rows.extend(x);
        rows.push(y);
    }
    let estimate = system(8, &rows).solve(None).unwrap();
    for (found, certified) in estimate.coefficients.iter().zip(certified) {
        assert!(
            (found / certified - 1.0).abs() < KEPT,
            "{found} {certified}"
        );
    }
    let intercept = -3482258.63459582;
    assert!((estimate.offsets[0] / intercept - 1.0).abs() < KEPT);
    let variance = estimate.squares / (16.0 - estimate.unknowns);
    assert!((variance.sqrt() / 304.854073561965 - 1.0).abs() < KEPT);
    let covariance = estimate.covariance(&[1.0]);
    for (j, certified) in certified_std.into_iter().enumerate() {
        let found = (variance * covariance[(j + 1) * 8]).sqrt();
        assert!(
            (found / certified - 1.0).abs() < KEPT,
            "{found} {certified}"
        );
    }
    let found = (variance * covariance[0]).sqrt();
    assert!((found / 890420.383607373 - 1.0).abs() < KEPT);
}

/// Beyond the size of singular values, the condition number comes from a power iteration: never
/// greater than theirs, some per cent low at most. With a column of zeros it is infinite.
#[test]
fn a_large_system_has_the_condition_of_its_singular_values() {
    const COLUMNS: usize = 140;
    const READINGS: usize = 200;
    const LOW: f64 = 0.97;
    let mut state = 1u64;
    let mut uniform = || {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    // The greatest singular value is that of a column, then of the zeros, then the least is.
    for (runs, size, least) in [
        (1, 1.0, 0.1),
        (3, 1.0, 0.1),
        (3, 0.01, 0.1),
        (3, 100.0, 1.0),
        (1, 1.0, 0.0),
    ] {
        let mut dense = DMatrix::zeros(runs * READINGS, runs + COLUMNS);
        let (mut pivots, mut reduction) = (Vec::new(), Reduction::default());
        for run in 0..runs {
            let mut rows = Vec::new();
            for i in run * READINGS..(run + 1) * READINGS {
                dense[(i, run)] = 1.0;
                rows.push(1.0);
                for j in 0..COLUMNS {
                    let scale = size * [10.0, least, 1.0][j.min(2)];
                    let value = scale * (uniform() - 0.3);
                    dense[(i, runs + j)] = value;
                    rows.push(value);
                }
                rows.push(0.0);
            }
            let (pivot, shared) = Triangle::of_rows(COLUMNS + 2, &rows).eliminate();
            pivots.push(pivot);
            reduction.push(shared);
        }
        let system = System {
            runs: pivots,
            shared: reduction.finish().unwrap(),
        };
        let found = system.condition_number();
        if least == 0.0 {
            assert_eq!(found, f64::INFINITY);
            continue;
        }
        let values = dense.singular_values();
        let share = found * values.min() / values.max();
        assert!(share > LOW && share < 1.0 + ORTHOGONAL, "{runs}: {share}");
        assert_eq!(system.condition_bound(), f64::INFINITY);
        assert_eq!(system.near_condition_bound(), f64::INFINITY);
    }
}

proptest! {
    /// The residual is orthogonal to every column, and its square is the sum reported;
    /// blocks and their order do not matter.
    #[test]
    fn normal_equations_hold(
        values in prop::collection::vec(-1.0f64..1.0, 60 * 4),
        cuts in prop::collection::vec(0usize..60, 3),
    ) {
        let rows: Vec<f64> = values.chunks(4).flat_map(|r| [1.0, r[0], r[1], r[2], r[3]]).collect();
        let mut cuts = cuts;
        cuts.extend([0, 60]);
        cuts.sort_unstable();
        let mut reduction = Reduction::default();
        for pair in cuts.windows(2) {
            reduction.push(Triangle::of_rows(5, &rows[5 * pair[0]..5 * pair[1]]));
        }
        let (pivot, shared) = reduction.finish().unwrap().eliminate();
        let blocks = System { runs: vec![pivot], shared };
        // Of n unknowns, the bounds are at most n and sqrt(n) times too great.
        let condition = blocks.condition_number() * (1.0 - ORTHOGONAL);
        let (bound, near) = (blocks.condition_bound(), blocks.near_condition_bound());
        prop_assert!(condition <= bound && condition <= near);
        prop_assume!(blocks.condition_number() < 1e6);
        prop_assert!(bound * (1.0 - ORTHOGONAL) <= 5.0 * blocks.condition_number());
        prop_assert!(near * (1.0 - ORTHOGONAL) <= 5f64.sqrt() * blocks.condition_number());
        prop_assume!(blocks.condition_number() < 100.0);
        let estimate = blocks.solve(None).unwrap();
        let unknowns: Vec<f64> = [&estimate.offsets[..], &estimate.coefficients].concat();
        let residuals: Vec<f64> = rows
            .chunks(5)
            .map(|r| r[4] - (0..4).map(|j| r[j] * unknowns[j]).sum::<f64>())
            .collect();
        for j in 0..4 {
            let product: f64 = rows.chunks(5).zip(&residuals).map(|(r, e)| r[j] * e).sum();
            prop_assert!(product.abs() < ORTHOGONAL);
        }
        let squares: f64 = residuals.iter().map(|e| e * e).sum();
        prop_assert!((squares - estimate.squares).abs() < ORTHOGONAL);
        let whole = system(5, &rows).solve(None).unwrap();
        for (a, b) in whole.coefficients.iter().zip(&estimate.coefficients) {
            prop_assert!((a - b).abs() < ORTHOGONAL);
        }
    }

    /// `R' R` of the triangle is the Gram matrix it was made of.
    #[test]
    fn gram_matrix_and_rows_agree(values in prop::collection::vec(-1.0f64..1.0, 200)) {
        let rows: Vec<f64> = values.chunks(4).flatten().copied().collect();
        let mut gram = vec![0.0; 16];
        for row in rows.chunks(4) {
            for i in 0..4 {
                for j in 0..4 {
                    gram[4 * i + j] += row[i] * row[j];
                }
            }
        }
        let zero = || Vec::new();
        let from_gram = System { runs: zero(), shared: Triangle::from_gram(4, gram).unwrap() };
        let from_rows = System { runs: zero(), shared: Triangle::of_rows(4, &rows) };
        prop_assume!(from_rows.condition_number() < 100.0);
        let (a, b) = (from_gram.solve(None).unwrap(), from_rows.solve(None).unwrap());
        for (a, b) in a.coefficients.iter().zip(&b.coefficients) {
            prop_assert!((a - b).abs() < ORTHOGONAL);
        }
        prop_assert!((a.squares - b.squares).abs() < ORTHOGONAL);
    }
}
