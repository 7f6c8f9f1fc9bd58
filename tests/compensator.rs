//! One sample at a time gives what a batch gives.

use std::f64::consts::TAU;
use std::sync::Arc;

use trueangle::compensator::Compensator;
use trueangle::kernel::{Argument, Batch, Evaluator, Quantity};
use trueangle::{Error, HarmonicSeries, Shaft};

fn evaluator(amplitude: f64, cycles: f64, argument: Argument) -> Arc<Evaluator> {
    let shaft = Shaft {
        cycles,
        orders: vec![1, 3, 17],
        cosine: vec![amplitude, 0.1 * amplitude, 0.0],
        sine: vec![0.0, 0.2 * amplitude, 0.01 * amplitude],
    };
    let series = HarmonicSeries::new(TAU, 0.25, vec![shaft]).unwrap();
    Arc::new(Evaluator::new(series, argument))
}

fn angles() -> Vec<f64> {
    let mut x: Vec<f64> = (-2000..2000).map(|i| f64::from(i) * 0.37).collect();
    x.extend([0.0, -0.0, 5e-324, 1e6, -1e6, 1e6 * TAU, 1e15, -1e300]);
    x
}

#[test]
fn a_step_is_a_batch_of_one() {
    // With and without a table.
    for cycles in [1.0, 2.5, 50.5] {
        for argument in [Argument::Reference, Argument::Indicated] {
            let evaluator = evaluator(1e-2 / cycles, cycles, argument);
            let compensator = Compensator::new(Arc::clone(&evaluator)).unwrap();
            let x = angles();
            let mut theta = x.clone();
            let batch = Batch::in_place(&mut theta);
            evaluator
                .run(Quantity::Correction, None, None, batch)
                .unwrap();
            for (x, theta) in x.iter().zip(&theta) {
                assert_eq!(compensator.step(*x), *theta, "{cycles} cycles at {x}");
            }
            for x in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                assert!(compensator.step(x).is_nan());
            }
        }
    }
}

#[test]
fn without_a_common_period_each_step_is_solved() {
    let evaluator = evaluator(1e-2, 2.5, Argument::Reference);
    let compensator = Compensator::new(Arc::clone(&evaluator)).unwrap();
    for x in angles().iter().filter(|x| x.abs() < 1e3) {
        let theta = compensator.step(*x);
        let left = theta + evaluator.series().evaluate(theta).0 - x;
        // The identity is rounded to the ulp of the angles.
        assert!(
            left.abs() <= 4.0 * f64::EPSILON * x.abs().max(1.0),
            "at {x}"
        );
    }
}

#[test]
fn a_steep_error_is_refused() {
    let steep = evaluator(1.5, 1.0, Argument::Reference);
    assert!(matches!(
        Compensator::new(steep),
        Err(Error::NotInvertible { .. })
    ));
    assert!(Compensator::new(evaluator(1.5, 1.0, Argument::Indicated)).is_ok());
}
