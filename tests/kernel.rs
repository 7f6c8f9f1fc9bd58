//! Every path of batch evaluation against the slow truth in `trueangle::direct`.

use std::f64::consts::TAU;

use proptest::prelude::*;
use trueangle::direct;
use trueangle::kernel::{Argument, Batch, Evaluator, InstructionSet, Quantity, TOLERANCE};
use trueangle::{HarmonicSeries, Shaft};

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
            let evaluator = Evaluator::new(series.clone(), Argument::Reference, TOLERANCE);
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
        let evaluator = Evaluator::new(series.clone(), Argument::Reference, TOLERANCE);
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
        let allowed = TOLERANCE * series.amplitude_sum() + f64::EPSILON * constant.abs();
        let evaluator = Evaluator::new(series.clone(), Argument::Indicated, TOLERANCE);
        for path in [None, Some("exact")] {
            let values = evaluate(&evaluator, Quantity::Error, path, &angles);
            let (error, at) = worst(&values, &angles, |x| direct::error(&series, x));
            prop_assert!(error <= allowed, "{path:?}: {error:e} at {at}");
        }
    }
}
