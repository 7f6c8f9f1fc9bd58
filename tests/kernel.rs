//! Every path of batch evaluation against the slow truth in `trueangle::direct`.

use std::f64::consts::TAU;

use proptest::prelude::*;
use trueangle::direct;
use trueangle::kernel::{Argument, Batch, Evaluator, InstructionSet, Path, Quantity, TOLERANCE};
use trueangle::{HarmonicSeries, Shaft};

/// Of a constant beside the series: four roundings of half an ulp in a table, one in the
/// truth.
const CONSTANT_ROUNDING: f64 = 2.5 * f64::EPSILON;

/// A few amplitudes that repeat without a pattern, summing to 1.
fn series(period: f64, constant: f64, shafts: &[(f64, &[u32])]) -> HarmonicSeries {
    let count: usize = shafts.iter().map(|(_, orders)| orders.len()).sum();
    let mut i = 0.0f64;
    let shafts = shafts
        .iter()
        .map(|&(cycles, orders)| {
            let (cosine, sine) = orders
                .iter()
                .map(|_| {
                    i += 1.0;
                    let (s, c) = (i * i).sin_cos();
                    (c / count as f64, s / count as f64)
                })
                .unzip();
            Shaft {
                cycles,
                orders: orders.to_vec(),
                cosine,
                sine,
            }
        })
        .collect();
    HarmonicSeries::new(period, constant, shafts).unwrap()
}

fn scaled(series: &HarmonicSeries, factor: f64) -> HarmonicSeries {
    let shafts = series.shafts().iter().cloned().map(|mut shaft| {
        shaft.cosine.iter_mut().for_each(|a| *a *= factor);
        shaft.sine.iter_mut().for_each(|b| *b *= factor);
        shaft
    });
    HarmonicSeries::new(series.period().value(), series.constant(), shafts.collect()).unwrap()
}

/// Angles where paths are most likely to go wrong.
fn hard_angles(period: f64, segments: usize) -> Vec<f64> {
    let step = period / segments as f64;
    let mut angles = vec![
        0.0,
        -0.0,
        f64::MIN_POSITIVE,
        -f64::MIN_POSITIVE,
        5e-324,
        -5e-324,
    ];
    for turns in [0.0, 1.0, -1.0, 7.0, -1e3, 1e6, -1e6] {
        for n in (0..segments).step_by(segments.div_ceil(97)) {
            // Seams lie halfway between centres.
            let seam = turns * period + (n as f64 + 0.5) * step;
            angles.extend([seam, seam.next_up(), seam.next_down(), seam + 0.3 * step]);
        }
        for part in [0.25, 0.5, 0.75, 1.0] {
            let place = (turns + part) * period;
            angles.extend([place, place.next_up(), place.next_down()]);
        }
    }
    for i in 0..2000 {
        angles.push((f64::from(i) * 0.618_033_988_75).fract() * 2e6 - 1e6);
        angles.push((f64::from(i) * 0.618_033_988_75).fract() * period);
    }
    angles
}

fn evaluate(evaluator: &Evaluator, quantity: Quantity, path: Option<&str>, x: &[f64]) -> Vec<f64> {
    let mut out = vec![f64::NAN; x.len()];
    let batch = Batch::apart(x, &mut out).unwrap();
    let route = path.map(|name| name.parse().unwrap());
    evaluator.run(quantity, route, Some(1), batch).unwrap();
    out
}

fn worst(values: &[f64], x: &[f64], truth: impl Fn(f64) -> f64) -> (f64, f64) {
    values
        .iter()
        .zip(x)
        .map(|(&value, &x)| ((value - truth(x)).abs(), x))
        .fold(
            (0.0, 0.0),
            |a, b| if b.0 > a.0 || b.0.is_nan() { b } else { a },
        )
}

fn dense(n: u32) -> Vec<u32> {
    (1..=n).collect()
}

#[test]
fn tables_stay_within_their_tolerance() {
    let sparse = [1, 2, 100, 200, 202, 400];
    let cases: [&[(f64, &[u32])]; 8] = [
        &[(1.0, &[1])],
        &[(1.0, &dense(17))],
        &[(1.0, &sparse)],
        &[(1.0, &[17])],
        &[(1.0, &[512])],
        &[(1.0, &dense(512))],
        &[(1.0, &[1, 2]), (100.0, &[1, 2, 4]), (101.0, &[1, 2])],
        &[],
    ];
    for period in [TAU, 360.0, 1.0, 65536.0] {
        for shafts in cases {
            let series = series(period, 0.0, shafts);
            let evaluator = Evaluator::new(series.clone(), Argument::Reference);
            let table = evaluator.table(Quantity::Error).expect("periodic");
            let x = hard_angles(period, table.segments());
            let values = evaluate(&evaluator, Quantity::Error, Some("table"), &x);
            let (error, at) = worst(&values, &x, |x| direct::error(&series, x));
            assert!(
                error <= TOLERANCE * series.amplitude_sum(),
                "{error:e} at {at}"
            );
        }
    }
}

#[test]
fn inverse_tables_stay_within_their_tolerance() {
    for (factor, shafts) in [
        (1e-4, vec![(1.0, dense(17))]),
        (1e-2, vec![(1.0, dense(17))]),
        (0.05, vec![(1.0, dense(17))]),
        (0.5, vec![(1.0, vec![1])]),
        (0.9, vec![(1.0, vec![1])]),
        (1e-4, vec![(1.0, vec![1, 2, 100, 200, 202, 400])]),
        (1e-4, vec![(1.0, dense(512))]),
    ] {
        let shafts: Vec<(f64, &[u32])> = shafts.iter().map(|(f, k)| (*f, &k[..])).collect();
        let series = scaled(&series(TAU, 0.0, &shafts), factor);
        let evaluator = Evaluator::new(series.clone(), Argument::Reference);
        let slope = evaluator.slope_bound();
        let table = evaluator
            .table(Quantity::Correction)
            .expect("periodic, not steep");
        let step = TAU / table.segments() as f64;
        let near: Vec<f64> = (-500..500).map(|i| f64::from(i) * 0.0037 * step).collect();
        let around: Vec<f64> = (0..20_000).map(|i| f64::from(i) * TAU / 19_777.3).collect();
        for x in [near, around] {
            let mut g = vec![f64::NAN; x.len()];
            let batch = Batch::apart(&x, &mut g).unwrap();
            table.values(InstructionSet::best(), batch);
            for (x, g) in x.iter().zip(&g) {
                // g = error(x - g) is the definition: what is left over is at most
                // 1 + slope times the error of g, and the rounding of x - g.
                let left = (g - direct::error(&series, x - g)).abs();
                let allowed = TOLERANCE * series.amplitude_sum() * (1.0 + slope)
                    + slope * 0.5 * f64::EPSILON * x.abs();
                assert!(left <= allowed, "{left:e} beyond {allowed:e} at {x}");
            }
            let theta = evaluate(&evaluator, Quantity::Correction, Some("table"), &x);
            let difference: Vec<f64> = x.iter().zip(&g).map(|(x, g)| x - g).collect();
            assert_eq!(theta, difference);
        }
    }
}

#[test]
fn every_instruction_set_and_path_agrees() {
    let series = scaled(
        &series(TAU, 0.3, &[(1.0, &dense(17)), (50.0, &[1, 2])]),
        1e-3,
    );
    let allowed = TOLERANCE * series.amplitude_sum() + CONSTANT_ROUNDING * 0.3;
    let evaluator = Evaluator::new(series.clone(), Argument::Reference);
    let x = hard_angles(TAU, 1024);
    let fused: Vec<_> = [InstructionSet::Avx2, InstructionSet::Avx512]
        .into_iter()
        .filter(|set| set.is_available())
        .collect();
    for path in ["table", "exact"] {
        let best = evaluate(&evaluator, Quantity::Error, Some(path), &x);
        for set in &fused {
            let name = format!("{path}-{}", set.name());
            let values = evaluate(&evaluator, Quantity::Error, Some(&name), &x);
            assert_eq!(values, best, "{name}");
        }
        let name = format!("{path}-portable");
        let values = evaluate(&evaluator, Quantity::Error, Some(&name), &x);
        let (error, at) = worst(&values, &x, |x| direct::error(&series, x));
        assert!(error <= allowed, "{name}: {error:e} at {at}");
    }
}

#[test]
fn the_exact_path_takes_any_shafts_and_slopes() {
    for shafts in [
        vec![(1.0, dense(17)), (100.5, vec![1, 2, 4])],
        vec![(std::f64::consts::PI, vec![1, 17, 18, 40])],
        vec![(1.0, vec![1, 2, 100, 200, 202, 400])],
        vec![(1.0, dense(512))],
    ] {
        let shafts: Vec<(f64, &[u32])> = shafts.iter().map(|(f, k)| (*f, &k[..])).collect();
        for period in [TAU, 360.0] {
            let series = series(period, 0.0, &shafts);
            let evaluator = Evaluator::new(series.clone(), Argument::Indicated);
            let x = hard_angles(period, 64);
            let values = evaluate(&evaluator, Quantity::Error, Some("exact"), &x);
            let (error, at) = worst(&values, &x, |x| direct::error(&series, x));
            assert!(error <= TOLERANCE, "{error:e} at {at}");

            let slopes = evaluate(&evaluator, Quantity::Slope, None, &x);
            let slope_sum: f64 = series
                .lines()
                .map(|line| TAU / period * line.order * line.amplitude())
                .sum();
            let (error, at) = worst(&slopes, &x, |x| direct::slope(&series, x));
            assert!(error <= TOLERANCE * slope_sum, "slope: {error:e} at {at}");
        }
    }
}

#[test]
fn the_exact_path_corrects_without_a_table() {
    for factor in [1e-3, 1e-2, 0.2] {
        let series = scaled(&series(TAU, 0.1, &[(1.0, &[1, 2]), (2.5, &[1])]), factor);
        let evaluator = Evaluator::new(series.clone(), Argument::Reference);
        let x: Vec<f64> = (0..2001).map(|i| f64::from(i) * 0.01 - 10.0).collect();
        let theta = evaluate(&evaluator, Quantity::Correction, None, &x);
        for (x, theta) in x.iter().zip(&theta) {
            let left = (theta + direct::error(&series, *theta) - x).abs();
            // Both sides of the identity are rounded to the ulp of an angle around 10.
            assert!(left <= 4.0 * f64::EPSILON * 10.0, "{left:e} at {x}");
            assert!((theta - evaluator.correct_one(*x)).abs() <= 4.0 * f64::EPSILON * 10.0);
        }
    }
}

/// The slow way of both arguments against the way that is taken by itself.
#[test]
fn the_direct_path_corrects_as_the_others_do() {
    let series = scaled(&series(360.0, 0.3, &[(1.0, &[1, 2]), (50.0, &[1])]), 0.4);
    let x = hard_angles(360.0, 64);
    let x: Vec<f64> = x.into_iter().filter(|x| x.abs() < 1e4).collect();
    for argument in [Argument::Indicated, Argument::Reference] {
        let evaluator = Evaluator::new(series.clone(), argument);
        let slow = evaluate(&evaluator, Quantity::Correction, Some("direct"), &x);
        let quick = evaluate(&evaluator, Quantity::Correction, None, &x);
        for ((slow, quick), x) in slow.iter().zip(&quick).zip(&x) {
            let off = (slow - quick).abs();
            // Amplitudes of 0.4 in all, and angles that are themselves rounded.
            assert!(
                off <= TOLERANCE + 4.0 * f64::EPSILON * x.abs(),
                "{off:e} at {x}"
            );
        }
    }
}

#[test]
fn counts_are_looked_up_and_agree_with_the_table() {
    for period in [4096.0, 1000.0, 1_048_576.0] {
        let series = series(period, 0.5, &[(1.0, &dense(17))]);
        let evaluator = Evaluator::new(series, Argument::Reference);
        let x: Vec<i32> = (-3_000_000..3_000_000).step_by(17).collect();
        for quantity in [Quantity::Error, Quantity::Correction] {
            let mut values = [vec![f64::NAN; x.len()], vec![f64::NAN; x.len()]];
            for (path, values) in ["counts", "table"].iter().zip(&mut values) {
                let batch = Batch::apart(&x, values).unwrap();
                let route = Some(path.parse().unwrap());
                evaluator.run(quantity, route, None, batch).unwrap();
            }
            assert_eq!(values[0], values[1]);
        }
        let route = evaluator.route::<i32, f64>(Quantity::Error, x.len());
        assert_eq!(route.to_string(), "counts");
        assert_eq!(
            evaluator.route::<i32, f64>(Quantity::Error, 10).path,
            Path::Table
        );
        let extremes = [i64::MIN, i64::MAX, -1, 0];
        let mut values = [0.0f64; 4];
        let batch = Batch::apart(&extremes, &mut values).unwrap();
        let route = Some("counts".parse().unwrap());
        evaluator.run(Quantity::Error, route, None, batch).unwrap();
        assert!(values.iter().all(|v| v.is_finite()));
    }
}

#[test]
fn what_is_not_finite_gives_nan_and_leaves_its_neighbours() {
    let series = series(TAU, 0.0, &[(1.0, &dense(5))]);
    let evaluator = Evaluator::new(series, Argument::Indicated);
    for path in [
        "table",
        "exact",
        "direct",
        "table-portable",
        "exact-portable",
    ] {
        let clean: Vec<f64> = (0..100).map(f64::from).collect();
        let expected = evaluate(&evaluator, Quantity::Error, Some(path), &clean);
        let mut x = clean.clone();
        for (i, bad) in [
            (0, f64::NAN),
            (9, f64::INFINITY),
            (50, f64::NEG_INFINITY),
            (99, -f64::NAN),
        ] {
            x[i] = bad;
        }
        x[33] = 1e300;
        let values = evaluate(&evaluator, Quantity::Error, Some(path), &x);
        for i in 0..100 {
            match i {
                33 => assert!(values[i].abs() <= 1.0, "{path}"),
                _ if x[i].is_finite() => assert_eq!(values[i], expected[i], "{path}"),
                _ => assert!(values[i].is_nan(), "{path}"),
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_series_at_any_angle(
        lines in proptest::collection::vec((1u32..520, -1.0..1.0f64, -1.0..1.0f64), 0..20),
        constant in -1.0..1.0f64,
        angles in proptest::collection::vec(-1e7..1e7f64, 1..40),
        degrees in any::<bool>(),
    ) {
        let mut lines = lines;
        lines.sort_by_key(|l| l.0);
        lines.dedup_by_key(|l| l.0);
        let shaft = Shaft {
            cycles: 1.0,
            orders: lines.iter().map(|l| l.0).collect(),
            cosine: lines.iter().map(|l| l.1).collect(),
            sine: lines.iter().map(|l| l.2).collect(),
        };
        let period = if degrees { 360.0 } else { TAU };
        let series = HarmonicSeries::new(period, constant, vec![shaft]).unwrap();
        let allowed = TOLERANCE * series.amplitude_sum() + CONSTANT_ROUNDING * constant.abs();
        let evaluator = Evaluator::new(series.clone(), Argument::Indicated);
        for path in [None, Some("exact")] {
            let values = evaluate(&evaluator, Quantity::Error, path, &angles);
            let (error, at) = worst(&values, &angles, |x| direct::error(&series, x));
            prop_assert!(error <= allowed, "{path:?}: {error:e} at {at}");
        }
    }
}
