//! The fit as a whole: what must not change it, and the paths against each other.

use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;
use trueangle::Error;
use trueangle::design::{Design, Frequencies};
use trueangle::fit::{Argument, Method, Options, Run, Solution, fit, sample, scan};
use trueangle::kernel;
use trueangle::series::{HarmonicSeries, Shaft};

/// Of errors of a few degrees: rounding of angles of a turn or two, and of either path.
const SAME: f64 = 1e-12;

fn design(period: f64, orders: &[u32]) -> Design {
    let orders = orders.to_vec();
    Design::new(
        period,
        vec![Frequencies {
            cycles: 1.0,
            orders,
        }],
    )
    .unwrap()
}

/// Readings over one turn of 360, with harmonics 1 and 3, a zero and noise.
fn readings(seed: u64, len: usize) -> (Vec<f64>, Vec<f64>) {
    let mut state = seed | 1;
    let mut uniform = || {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let reference: Vec<f64> = (0..len).map(|_| 360.0 * uniform()).collect();
    let error = |x: &f64| {
        let radians = x.to_radians();
        2.0 + radians.cos() - 0.5 * (3.0 * radians).sin()
    };
    let indicated = reference
        .iter()
        .map(|x| x + error(x) + 0.1 * uniform())
        .collect();
    (reference, indicated)
}

fn solve(
    design: &Design,
    reference: &[f64],
    indicated: &[f64],
    method: Option<Method>,
) -> Solution {
    let run = Run {
        reference,
        indicated,
        weights: None,
    };
    fit(
        design,
        &[run],
        Options {
            method,
            ..Options::default()
        },
    )
    .unwrap()
}

fn close(a: &[f64], b: &[f64], tolerance: f64) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= tolerance)
}

#[test]
fn residuals_are_orthogonal_to_every_harmonic() {
    let design = design(360.0, &[1, 2, 3]);
    for len in [40, 5000] {
        let (reference, indicated) = readings(1, len);
        let found = solve(&design, &reference, &indicated, None);
        let mut products = vec![0.0; 7];
        for (x, y) in reference.iter().zip(&indicated) {
            let mut row = vec![1.0];
            design.extend_row(&mut row, *x, 1.0);
            let fitted: f64 = row[1..]
                .iter()
                .zip(found.coefficients())
                .map(|(r, c)| r * c)
                .sum();
            let residual = y - x - found.constant - fitted;
            for (product, value) in products.iter_mut().zip(&row) {
                *product += residual * value;
            }
        }
        assert!(
            close(&products, &[0.0; 7], 1e-13 * len as f64),
            "{products:?}"
        );
        assert_eq!(
            found.method,
            if len < 1000 {
                Method::Plain
            } else {
                Method::Moments
            }
        );
    }
}

/// Of `[constant, A, B, ...]` and of every zero, by the inverse of all columns together: runs of
/// unlike zeros and lengths over parts of the turn, weighted.
#[test]
fn errors_are_those_of_the_dense_inverse() {
    const ROUNDING: f64 = 1e-9;
    let design = design(360.0, &[1, 3]);
    let (reference, indicated) = readings(5, 300);
    let reference: Vec<f64> = reference.iter().map(|x| x * x / 500.0).collect();
    let weights: Vec<f64> = (0..300).map(|i| f64::from(i % 4)).collect();
    let ends = [0, 60, 140, 300];
    let zeros = [0.0, 1.5, -40.0];
    let run = |i: usize| (0..3).find(|&r| i < ends[r + 1]).unwrap();
    let (noise, _) = readings(6, 300);
    let indicated: Vec<f64> = (0..300)
        .map(|i| reference[i] + zeros[run(i)] + 0.01 * noise[i] + 0.001 * indicated[i])
        .collect();
    let runs: Vec<Run> = (0..3)
        .map(|r| Run {
            reference: &reference[ends[r]..ends[r + 1]],
            indicated: &indicated[ends[r]..ends[r + 1]],
            weights: Some(&weights[ends[r]..ends[r + 1]]),
        })
        .collect();
    let found = fit(&design, &runs, Options::default()).unwrap();
    let rows: Vec<f64> = (0..300)
        .flat_map(|i| {
            let mut row = vec![0.0; 3];
            row[run(i)] = 1.0;
            design.extend_row(&mut row, reference[i], 1.0);
            row
        })
        .collect();
    let x = DMatrix::from_row_slice(300, 7, &rows);
    let y = DVector::from_fn(300, |i, _| indicated[i] - reference[i]);
    let weighted = DMatrix::from_fn(300, 7, |i, j| weights[i] * x[(i, j)]);
    let inverse = x.tr_mul(&weighted).try_inverse().unwrap();
    let solution = &inverse * weighted.tr_mul(&y);
    let left = y - &x * &solution;
    let squares: f64 = left.iter().zip(&weights).map(|(e, w)| w * e * e).sum();
    // Every fourth reading has no weight.
    let variance = squares / (225.0 - 7.0);
    assert!((found.residual_variance / variance - 1.0).abs() < ROUNDING);
    assert!(close(&found.offsets, &solution.as_slice()[..3], ROUNDING));
    assert!(close(
        found.coefficients(),
        &solution.as_slice()[3..],
        ROUNDING
    ));
    let std: Vec<f64> = (0..3)
        .map(|r| (variance * inverse[(r, r)]).sqrt())
        .collect();
    assert!(close(&found.offset_std, &std, ROUNDING * std[0]));
    // The constant is the circular mean of the zeros.
    let turns: Vec<f64> = found.offsets.iter().map(|o| o.to_radians()).collect();
    let (sine, cosine) = turns
        .iter()
        .fold((0.0, 0.0), |(s, c), o| (s + o.sin(), c + o.cos()));
    assert!((found.constant - sine.atan2(cosine).to_degrees()).abs() < ROUNDING);
    let mut map = DMatrix::zeros(5, 7);
    for (r, zero) in turns.iter().enumerate() {
        map[(0, r)] = (zero - sine.atan2(cosine)).cos() / sine.hypot(cosine);
    }
    (0..4).for_each(|j| map[(1 + j, 3 + j)] = 1.0);
    let covariance = &map * inverse * map.transpose() * variance;
    let size = covariance.amax();
    assert!(close(
        &found.covariance(),
        covariance.as_slice(),
        ROUNDING * size
    ));
    let scaled = DMatrix::from_fn(300, 7, |i, j| weights[i].sqrt() * x[(i, j)]);
    let values = scaled.singular_values();
    let condition = values.max() / values.min();
    assert!((found.condition_number() / condition - 1.0).abs() < 1e-3);
    assert!(
        found.is_conditioned_below(1.01 * condition)
            && !found.is_conditioned_below(0.9 * condition)
    );
}

/// Zeros that lie around the whole turn have no mean: the first stands for it, and its error for
/// the error. So does a zero alone.
#[test]
fn zeros_without_a_mean_have_the_first_for_it() {
    /// Of zeros half a turn less 0.1 apart: the mean is as sharp as they are.
    const ROUNDING: f64 = 1e-9;
    let design = design(360.0, &[1]);
    let (reference, noisy) = readings(7, 200);
    let of = |zeros: &[f64]| {
        let shift = |zero: &f64| noisy.iter().map(|y| y + zero).collect::<Vec<_>>();
        let shifted: Vec<_> = zeros.iter().map(shift).collect();
        let run = |indicated| Run {
            reference: &reference,
            indicated,
            weights: None,
        };
        let runs: Vec<_> = shifted.iter().map(|indicated| run(indicated)).collect();
        fit(&design, &runs, Options::default()).unwrap()
    };
    for zeros in [&[31.0][..], &[31.0, -149.0], &[10.0, 130.0, -110.0]] {
        let found = of(zeros);
        assert_eq!(found.constant, found.offsets[0]);
        let share = found.covariance()[0] / found.offset_std[0].powi(2);
        assert!((share - 1.0).abs() < ROUNDING, "{zeros:?}: {share}");
    }
    let near = of(&[31.0, -149.1]);
    let middle = near.offsets[0] + 0.5 * (near.offsets[1] - near.offsets[0] + 360.0);
    assert!(
        (near.constant - middle).abs() < ROUNDING,
        "{}",
        near.constant
    );
}

#[test]
fn ridge_that_leaves_an_order_undetermined_is_refused() {
    let reference: Vec<f64> = (0..72).map(|i| 10.0 * f64::from(i)).collect();
    let design = design(360.0, &[1, 18]);
    let run = Run {
        reference: &reference,
        indicated: &reference,
        weights: None,
    };
    let options = Options {
        ridge: Some(&[1.0, 1.0, 0.0, 0.0]),
        ..Options::default()
    };
    assert!(matches!(
        fit(&design, &[run], options),
        Err(Error::Rank { .. })
    ));
}

#[test]
fn numbers_that_are_not_finite_are_named_on_every_path() {
    for len in [30, 5000] {
        let (reference, mut indicated) = readings(2, len);
        indicated[17] = f64::NAN;
        let run = Run {
            reference: &reference,
            indicated: &indicated,
            weights: None,
        };
        for method in [
            None,
            Some(Method::Plain),
            Some(Method::Moments),
            Some(Method::Qr),
        ] {
            let options = Options {
                method,
                ..Options::default()
            };
            let Err(Error::NotFinite { what, index, .. }) =
                fit(&design(360.0, &[1]), &[run], options)
            else {
                panic!("{method:?} took a NaN");
            };
            assert_eq!((what, index), ("indicated", 17));
        }
    }
}

#[test]
fn counts_are_told_from_other_numbers() {
    let (reference, indicated) = readings(3, 4000);
    let counts: Vec<f64> = reference.iter().map(|x| x.round()).collect();
    let by_counts = solve(&design(360.0, &[1]), &counts, &indicated, None);
    assert_eq!(by_counts.method, Method::Counts);
    // One angle between two counts, and one too far to be told from its neighbours.
    for odd in [counts[9] + 0.5, 360.0 * 2f64.powi(52)] {
        let mut other = counts.clone();
        other[9] = odd;
        let found = solve(&design(360.0, &[1]), &other, &indicated, None);
        assert_eq!(found.method, Method::Moments, "{odd}");
    }
    let run = Run {
        reference: &reference,
        indicated: &indicated,
        weights: None,
    };
    let options = Options {
        method: Some(Method::Counts),
        ..Options::default()
    };
    let refused = fit(&design(360.0, &[1]), &[run], options);
    assert!(matches!(refused, Err(Error::Method)));
}

#[test]
fn a_scan_sees_the_residuals_that_count() {
    let (reference, mut indicated) = readings(5, 150_000);
    // Two readings stand out; the greater has weight 0.
    indicated[70_000] += 40.0;
    indicated[140_001] -= 50.0;
    let weights: Vec<f64> = (0..reference.len())
        .map(|i| (i % 3) as f64 * if i == 140_001 { 0.0 } else { 1.0 })
        .collect();
    let shaft = Shaft {
        cycles: 1.0,
        orders: vec![1],
        cosine: vec![1.0],
        sine: vec![0.0],
    };
    let series = HarmonicSeries::new(360.0, 2.0, vec![shaft]).unwrap();
    let fitted = kernel::Evaluator::new(series.clone(), kernel::Argument::Reference);
    let residual = |i: usize| {
        let rest = indicated[i] - reference[i] - series.evaluate(reference[i]).0 - 0.25;
        (rest + 180.0).rem_euclid(360.0) - 180.0
    };
    for weights in [None, Some(&weights[..])] {
        let run = Run {
            reference: &reference,
            indicated: &indicated,
            weights,
        };
        let counts = |i: &usize| weights.is_none_or(|w| w[*i] > 0.0);
        let look = |stride, threads| {
            scan(&fitted, &run, Argument::Reference, 0.25, stride, threads).unwrap()
        };
        let all = look(1, 2);
        let slow: Vec<f64> = (0..reference.len()).filter(counts).map(residual).collect();
        assert!(close(&all.sample, &slow, SAME) && all.sample.len() == slow.len());
        let most = slow
            .iter()
            .fold(0.0f64, |most, value| most.max(value.abs()));
        assert!((all.largest - most).abs() < SAME);
        let few = look(37, 1);
        assert_eq!(few, look(37, 2));
        assert_eq!(few.largest, all.largest);
        assert!((few.sample.len() as f64 / (slow.len() as f64 / 37.0) - 1.0).abs() < 0.01);
        // Within a part it is every so many, also without a look at the others.
        let short = Run {
            reference: &reference[..60_000],
            indicated: &indicated[..60_000],
            weights: weights.map(|w| &w[..60_000]),
        };
        let slow: Vec<f64> = (0..60_000)
            .filter(counts)
            .map(residual)
            .step_by(37)
            .collect();
        let kept = scan(&fitted, &short, Argument::Reference, 0.25, 37, 1).unwrap();
        let alone = sample(&fitted, &short, Argument::Reference, 0.25, 37, 1).unwrap();
        for found in [&kept.sample, &alone] {
            assert!(found.len() == slow.len() && close(found, &slow, SAME));
        }
    }
}

proptest! {
    /// Means of counts are sufficient: the same answer as from every reading by itself, on
    /// a full turn and on an arc, over many turns, with weights.
    #[test]
    fn counts_agree_with_their_readings(
        seed in any::<u64>(),
        arc in prop::sample::select(vec![1.0, 0.4]),
        weighted in any::<bool>(),
        swap in any::<bool>(),
    ) {
        const UNIT: f64 = 1000.0;
        let (reference, indicated) = readings(seed, 20_000);
        let turns = |i: usize| UNIT * (i % 7) as f64 - 3.0 * UNIT;
        let x: Vec<f64> = reference.iter().enumerate()
            .map(|(i, x)| (x / 360.0 * UNIT * arc).round() + turns(i)).collect();
        let y: Vec<f64> = indicated.iter().zip(&reference).zip(&x)
            .map(|((y, r), x)| x + (y - r) / 360.0 * UNIT).collect();
        let weights: Vec<f64> = (0..x.len()).map(|i| (i % 4) as f64).collect();
        let weights = weighted.then_some(&weights[..]);
        let (argument, run) = if swap {
            (Argument::Indicated, Run { reference: &y, indicated: &x, weights })
        } else {
            (Argument::Reference, Run { reference: &x, indicated: &y, weights })
        };
        let design = design(UNIT, &[1, 2, 3]);
        let by = |method, threads| {
            let options = Options { argument, method, threads, ..Options::default() };
            fit(&design, &[run], options).unwrap()
        };
        let counts = by(None, 2);
        prop_assert_eq!(counts.method, Method::Counts);
        let plain = by(Some(Method::Plain), 1);
        let tolerance = SAME * plain.condition_number() * UNIT / 360.0;
        prop_assert!(close(plain.coefficients(), counts.coefficients(), tolerance));
        prop_assert!((plain.constant - counts.constant).abs() < tolerance);
        prop_assert!((plain.residual_variance / counts.residual_variance - 1.0).abs() < 1e-10);
        prop_assert_eq!(plain.degrees_of_freedom, counts.degrees_of_freedom);
        let one = by(None, 1);
        prop_assert_eq!(one.coefficients(), counts.coefficients());
    }

    #[test]
    fn zero_turns_order_and_sign_do_not_matter(
        seed in any::<u64>(),
        len in prop::sample::select(vec![60usize, 900]),
        zero in -180.0f64..180.0,
        turns in -5i32..5,
        indicated_argument in any::<bool>(),
    ) {
        let design = design(360.0, &[1, 3]);
        let (reference, indicated) = readings(seed, len);
        let base = solve(&design, &reference, &indicated, None);

        let moved: Vec<f64> = indicated.iter().rev()
            .map(|y| (y + zero + 360.0 * f64::from(turns)).rem_euclid(360.0)).collect();
        let reversed: Vec<f64> = reference.iter().rev().copied().collect();
        let other = solve(&design, &reversed, &moved, None);
        prop_assert!(close(base.coefficients(), other.coefficients(), SAME));

        // Reference and indicated angles change places: the error changes its sign.
        let argument = if indicated_argument { Argument::Indicated } else { Argument::Reference };
        let twin = if indicated_argument { Argument::Reference } else { Argument::Indicated };
        let run = Run { reference: &reference, indicated: &indicated, weights: None };
        let swapped = Run { reference: &indicated, indicated: &reference, weights: None };
        let one = fit(&design, &[run], Options { argument, ..Options::default() }).unwrap();
        let two = fit(&design, &[swapped], Options { argument: twin, ..Options::default() }).unwrap();
        let negated: Vec<f64> = two.coefficients().iter().map(|c| -c).collect();
        prop_assert!(close(one.coefficients(), &negated, SAME));
    }

    #[test]
    fn paths_agree(seed in any::<u64>(), unit in prop::sample::select(vec![1.0, 360.0, 65536.0])) {
        let (reference, indicated) = readings(seed, 3000);
        let scaled = |v: &[f64]| v.iter().map(|x| x * (unit / 360.0)).collect::<Vec<_>>();
        let (x, y) = (scaled(&reference), scaled(&indicated));
        let design = design(unit, &[1, 2, 3, 5]);
        let plain = solve(&design, &x, &y, Some(Method::Plain));
        for method in [Method::Moments, Method::Qr] {
            let found = solve(&design, &x, &y, Some(method));
            prop_assert!(close(plain.coefficients(), found.coefficients(), SAME * unit / 360.0));
            prop_assert!((plain.residual_variance / found.residual_variance - 1.0).abs() < 1e-10);
            prop_assert!((plain.constant - found.constant).abs() < SAME * unit / 360.0);
        }
    }
}
