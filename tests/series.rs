//! The harmonic series: recurrence against the direct sum, slope, bound, inverse.

use std::f64::consts::TAU;

use proptest::prelude::*;
use trueangle::{Error, HarmonicSeries, Shaft, direct};

/// Errors relative to the sum of amplitudes; the recurrence re-seeds every 32 orders and
/// gains about one rounding a step.
const RECURRENCE: f64 = 1e-14;

fn shaft(cycles: f64, orders: &[u32], coefficients: &[(f64, f64)]) -> Shaft {
    Shaft {
        cycles,
        orders: orders.to_vec(),
        cosine: coefficients.iter().map(|c| c.0).collect(),
        sine: coefficients.iter().map(|c| c.1).collect(),
    }
}

/// One or two shafts with orders up to 512, in one of the usual units.
fn any_series() -> impl Strategy<Value = HarmonicSeries> {
    let orders = prop::collection::btree_set(1..513u32, 1..8);
    let coefficients = prop::collection::vec((-1.0..1.0f64, -1.0..1.0f64), 16);
    let period = prop::sample::select(vec![TAU, 360.0, 1.0, 65536.0]);
    (orders, coefficients, period, 0.1..200.0f64).prop_map(
        |(orders, coefficients, period, ratio)| {
            let orders: Vec<u32> = orders.into_iter().collect();
            let output = shaft(1.0, &orders, &coefficients[..orders.len()]);
            let motor = shaft(ratio, &[1, 2], &coefficients[8..10]);
            HarmonicSeries::new(period, 0.25, vec![output, motor]).unwrap()
        },
    )
}

proptest! {
    #[test]
    fn the_recurrence_agrees_with_the_direct_sum(series in any_series(), turns in -1e4..1e4f64) {
        let x = turns * series.period().value();
        let (value, slope) = series.evaluate(x);
        let scale = series.amplitude_sum() + series.constant().abs();
        prop_assert!((value - direct::error(&series, x)).abs() <= RECURRENCE * scale);
        let steepest = series.slope_bound().max(f64::MIN_POSITIVE);
        prop_assert!((slope - direct::slope(&series, x)).abs() <= RECURRENCE * 100.0 * steepest);
    }

    /// The slope is the derivative: central differences, whose error is h^2/6 of the third.
    #[test]
    fn the_slope_is_the_derivative(series in any_series(), turns in -2.0..2.0f64) {
        let period = series.period().value();
        let (x, h) = (turns * period, 1e-5 / 600.0 * period);
        let difference = (direct::error(&series, x + h) - direct::error(&series, x - h)) / (2.0 * h);
        let steepest = series.slope_bound().max(series.amplitude_sum() / period);
        prop_assert!((difference - series.evaluate(x).1).abs() <= 1e-4 * steepest);
    }

    /// No slope exceeds the bound, and the bound is not far above the steepest.
    #[test]
    fn the_slope_bound_bounds(series in any_series(), turns in -10.0..10.0f64) {
        let slope = series.evaluate(turns * series.period().value()).1.abs();
        prop_assert!(slope <= series.slope_bound() * (1.0 + 1e-12));
    }

    /// Bisection finds the angle that indicates as given.
    #[test]
    fn correcting_inverts_indicating(series in any_series(), turns in -3.0..3.0f64) {
        let scale = 0.5 / series.slope_bound();
        let shafts = series.shafts().iter().map(|s| Shaft {
            cosine: s.cosine.iter().map(|a| a * scale).collect(),
            sine: s.sine.iter().map(|b| b * scale).collect(),
            ..s.clone()
        });
        let tame = HarmonicSeries::new(series.period().value(), 0.1, shafts.collect()).unwrap();
        let theta = turns * series.period().value();
        let found = direct::correct(&tame, theta + direct::error(&tame, theta));
        prop_assert!((found - theta).abs() <= 1e-13 * series.period().value() * 10.0);
    }
}

#[test]
fn values_known_by_hand() {
    let series = HarmonicSeries::new(
        360.0,
        0.5,
        vec![shaft(1.0, &[1, 4], &[(0.0, 2.0), (1.0, 0.0)])],
    )
    .unwrap();
    for (x, wanted) in [
        (0.0, 1.5),
        (90.0, 3.5),
        (180.0, 1.5),
        (270.0, -0.5),
        (45.0, 0.5 + 2f64.sqrt() - 1.0),
    ] {
        assert!((series.evaluate(x).0 - wanted).abs() < 1e-15 * 4.0, "{x}");
        assert!(
            (direct::error(&series, x) - wanted).abs() < 1e-15 * 4.0,
            "{x}"
        );
    }
}

#[test]
fn a_steep_sum_with_a_gentle_curve_has_a_fine_bound() {
    // The terms' slopes add up to 1.2, but never at one place: sampled, then raised.
    let third = 0.4 * 360.0 / TAU;
    let series = HarmonicSeries::new(
        360.0,
        0.0,
        vec![shaft(
            1.0,
            &[1, 2, 3],
            &[(third, 0.0), (0.0, third / 2.0), (third / 3.0, 0.0)],
        )],
    )
    .unwrap();
    let steepest = (0..100_000)
        .map(|i| direct::slope(&series, f64::from(i) * 0.0036).abs())
        .fold(0.0, f64::max);
    assert!(steepest < series.slope_bound() && series.slope_bound() < 1.01 * steepest);
}

#[test]
fn every_broken_precondition_is_named() {
    let good = shaft(1.0, &[1, 2], &[(0.0, 0.1), (0.0, 0.1)]);
    let with = |change: &dyn Fn(&mut Shaft)| {
        let mut bad = good.clone();
        change(&mut bad);
        HarmonicSeries::new(360.0, 0.0, vec![bad]).unwrap_err()
    };
    assert!(matches!(
        with(&|s| s.cycles = 0.0),
        Error::Cycles { shaft: 0, .. }
    ));
    assert!(matches!(
        with(&|s| s.cycles = f64::NAN),
        Error::Cycles { .. }
    ));
    assert!(matches!(
        with(&|s| s.orders = vec![2, 1]),
        Error::Orders {
            previous: 2,
            got: 1,
            ..
        }
    ));
    assert!(matches!(
        with(&|s| s.orders = vec![0, 1]),
        Error::Orders { .. }
    ));
    assert!(matches!(
        with(&|s| s.cosine.truncate(1)),
        Error::Length { what: "cosine", .. }
    ));
    assert!(matches!(
        with(&|s| s.sine[1] = f64::INFINITY),
        Error::NotFinite {
            what: "sine",
            index: 1,
            ..
        }
    ));
    assert!(matches!(
        HarmonicSeries::new(-1.0, 0.0, vec![]),
        Err(Error::Period(_))
    ));
    assert!(matches!(
        HarmonicSeries::new(1.0, f64::NAN, vec![]),
        Err(Error::NotFinite { .. })
    ));
}
