//! The path of f32 against the slow truth in `trueangle::direct` and the path of f64.

use std::f64::consts::TAU;

use trueangle::direct;
use trueangle::kernel::{Argument, Batch, Evaluator, InstructionSet, Path, Quantity};
use trueangle::{HarmonicSeries, Shaft};

/// What the bound may be of the sum of amplitudes and the constant: half an ulp for what
/// the cubics leave out, one each for the coefficients and for the result, and a bit for
/// steep rows.
const USEFUL: f64 = 2.0 * f32::EPSILON as f64;

fn evaluator(period: f64, size: f64, constant: f64, orders: &[u32]) -> Evaluator {
    let phases = (1..=orders.len()).map(|i| ((i * i) as f64).sin_cos());
    let size = size / orders.len() as f64;
    let (sine, cosine) = phases.map(|(s, c)| (s * size, c * size)).unzip();
    let shaft = Shaft {
        cycles: 1.0,
        orders: orders.to_vec(),
        cosine,
        sine,
    };
    let series = HarmonicSeries::new(period, constant, vec![shaft]).unwrap();
    Evaluator::new(series, Argument::Reference)
}

/// Seams, whole turns and their neighbours, denormals, near and far angles.
fn hard_angles(period: f64, segments: usize) -> Vec<f32> {
    let step = period / segments as f64;
    let least = f32::from_bits(1);
    let mut angles = vec![0.0, -0.0, f32::MIN_POSITIVE, least, -least];
    for turns in [0.0, 1.0, -1.0, 7.0, -1e3, 1e6, -1e6] {
        for n in (0..segments).step_by(segments.div_ceil(97)) {
            let seam = (turns * period + (n as f64 + 0.5) * step) as f32;
            angles.extend([seam, seam.next_up(), seam.next_down()]);
        }
    }
    for i in 0..5000 {
        let part = (f64::from(i) * 0.618_033_988_75).fract();
        angles.extend([part * period, (2.0 * part - 1.0) * 1e6 * period].map(|x| x as f32));
    }
    angles.extend([1e20, -f32::MAX]);
    angles
}

fn evaluate(evaluator: &Evaluator, quantity: Quantity, path: Option<&str>, x: &[f32]) -> Vec<f32> {
    let mut out = vec![f32::NAN; x.len()];
    let route = path.map(|name| name.parse().unwrap());
    let batch = Batch::apart(x, &mut out).unwrap();
    evaluator.run(quantity, route, Some(1), batch).unwrap();
    out
}

fn sets() -> impl Iterator<Item = InstructionSet> {
    let sets = [
        InstructionSet::Portable,
        InstructionSet::Avx2,
        InstructionSet::Avx512,
    ];
    sets.into_iter().filter(|set| set.is_available())
}

#[test]
fn cubics_stay_within_their_bound() {
    let dense: Vec<u32> = (1..=17).collect();
    let many: Vec<u32> = (1..=512).collect();
    let cases: [(&[u32], f64, f64); 7] = [
        (&[1], 1.0, 0.0),
        (&dense, 1.0, 0.0),
        (&dense, 1e-4, 0.3),
        (&[17], 1e-3, -100.0),
        (&[1, 2, 100, 200, 202, 400], 1e-2, 0.0),
        (&many, 1.0, 0.0),
        (&[], 0.0, 0.1),
    ];
    for period in [TAU, 360.0, 65536.0] {
        for (orders, size, constant) in cases {
            let evaluator = evaluator(period, size, constant, orders);
            let series = evaluator.series();
            let cubics = evaluator.cubics(Quantity::Error).expect("periodic");
            assert!(cubics.bound() <= USEFUL * (series.amplitude_sum() + constant.abs()) + 1e-40);
            let x = hard_angles(period, cubics.segments());
            for set in sets() {
                let path = format!("cubics-{}", set.name());
                let values = evaluate(&evaluator, Quantity::Error, Some(&path), &x);
                for (&x, value) in x.iter().zip(values) {
                    let error = (f64::from(value) - direct::error(series, f64::from(x))).abs();
                    assert!(error <= cubics.bound(), "{path}: {error:e} at {x:e}");
                }
            }
        }
    }
}

#[test]
fn corrections_stay_within_their_bound_of_double_precision() {
    let dense: Vec<u32> = (1..=17).collect();
    for (size, constant, orders) in [
        (1e-2, 0.2, &dense[..]),
        (0.5, 0.0, &[1]),
        (1e-4, 0.0, &[1, 100, 202, 400]),
    ] {
        let evaluator = evaluator(TAU, size, constant, orders);
        let cubics = evaluator.cubics(Quantity::Correction).expect("not steep");
        let x = hard_angles(TAU, cubics.segments());
        let doubles: Vec<f64> = x.iter().map(|&x| f64::from(x)).collect();
        let mut theta = vec![0.0; x.len()];
        let batch = Batch::apart(&doubles, &mut theta).unwrap();
        evaluator
            .run(Quantity::Correction, None, None, batch)
            .unwrap();
        for set in sets() {
            let path = format!("cubics-{}", set.name());
            let values = evaluate(&evaluator, Quantity::Correction, Some(&path), &x);
            for ((&x, value), theta) in x.iter().zip(values).zip(&theta) {
                let difference = (f64::from(value) - theta).abs();
                // The subtraction is rounded to half an ulp of the result.
                let ulp = f64::from(value.abs().next_up()) - f64::from(value.abs());
                let allowed = cubics.bound() + 0.5 * ulp;
                assert!(
                    difference <= allowed,
                    "{path}: {difference:e} beyond {allowed:e} at {x}"
                );
            }
        }
    }
}

#[test]
fn f32_takes_the_cubics_unless_it_cannot() {
    let cubics = evaluator(TAU, 1.0, 0.0, &[1, 17]);
    let route = cubics.route::<f32, f32>(Quantity::Error, 1);
    assert_eq!(route.path, Path::Cubics);
    assert_eq!(
        cubics.route::<f32, f64>(Quantity::Error, 1).path,
        Path::Table
    );
    assert_eq!(
        cubics.route::<f64, f64>(Quantity::Error, 1).path,
        Path::Table
    );
    let mut doubles = [0.1, 0.2, 0.3];
    let (route, batch) = (
        Some("cubics".parse().unwrap()),
        Batch::in_place(&mut doubles),
    );
    let error = cubics.run(Quantity::Error, route, None, batch).unwrap_err();
    assert!(error.to_string().contains("float32"), "{error}");
    // Values that no f32 holds are refused with the series.
    let beyond = Shaft {
        cycles: 1.0,
        orders: vec![1],
        cosine: vec![1e35],
        sine: vec![0.0],
    };
    let refused = HarmonicSeries::new(TAU, 0.0, vec![beyond]).unwrap_err();
    assert!(
        refused.to_string().contains("the size of cosine[0]"),
        "{refused}"
    );
    // Too many segments.
    {
        let other = evaluator(TAU, 1.0, 0.0, &[3000]);
        let route = other.route::<f32, f32>(Quantity::Error, 1);
        assert_eq!(route.path, Path::Table);
        let x = hard_angles(TAU, 64);
        for (&x, value) in x.iter().zip(evaluate(&other, Quantity::Error, None, &x)) {
            let error = (f64::from(value) - direct::error(other.series(), f64::from(x))).abs();
            assert!(error <= other.single_bound(), "{error:e} at {x}");
        }
    }
}

#[test]
fn a_result_depends_on_its_own_sample_only() {
    let evaluator = evaluator(360.0, 1e-2, 0.1, &[1, 2, 17]);
    let x = hard_angles(360.0, 256);
    for quantity in [Quantity::Error, Quantity::Correction] {
        for set in sets() {
            let path = format!("cubics-{}", set.name());
            let all = evaluate(&evaluator, quantity, Some(&path), &x);
            for len in 1..40 {
                let some = evaluate(&evaluator, quantity, Some(&path), &x[..len]);
                assert_eq!(some, all[..len], "{path}, {len} samples");
            }
        }
    }
}

#[test]
fn what_is_not_finite_gives_nan_and_leaves_its_neighbours() {
    let evaluator = evaluator(TAU, 1e-2, 0.0, &[1, 2, 17]);
    let clean: Vec<f32> = (0..100u8).map(f32::from).collect();
    let bad = [
        (0, f32::NAN),
        (9, f32::INFINITY),
        (50, f32::NEG_INFINITY),
        (99, -f32::NAN),
    ];
    for quantity in [Quantity::Error, Quantity::Correction] {
        for set in sets() {
            let path = format!("cubics-{}", set.name());
            let expected = evaluate(&evaluator, quantity, Some(&path), &clean);
            let mut x = clean.clone();
            for (i, value) in bad {
                x[i] = value;
            }
            let values = evaluate(&evaluator, quantity, Some(&path), &x);
            for i in 0..x.len() {
                if x[i].is_finite() {
                    assert_eq!(values[i], expected[i], "{path}");
                } else {
                    assert!(values[i].is_nan(), "{path}");
                }
            }
        }
    }
}
