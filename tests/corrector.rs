//! Correctors of joints alike, of batches and what lies outside of them, far away and at rest.

use std::sync::Arc;

use trueangle::kernel::{Argument, Batch, Evaluator, Quantity, Stretch};
use trueangle::terms::{Alike, Columns, Corrector, Form, Line, Signal, Signals, Term, Terms};
use trueangle::{Error, HarmonicSeries, Shaft};

const PERIOD: f64 = 360.0;

/// A line of order 1 of this slope, and terms.
fn terms(argument: Argument, slope: f64, forms: &[Form]) -> Result<Arc<Terms>, Error> {
    let shaft = Shaft {
        cycles: 1.0,
        orders: vec![1],
        cosine: vec![slope.to_degrees()],
        sine: vec![0.0],
    };
    let series = HarmonicSeries::new(PERIOD, 3.0, vec![shaft])?;
    let evaluator = Arc::new(Evaluator::new(series, argument));
    let named = |form: &Form| Term {
        name: String::new(),
        form: form.clone(),
    };
    let forms: Vec<Term> = forms.iter().map(named).collect();
    Terms::new(evaluator, &forms).map(Arc::new)
}

fn play(half_width: f64, swing: f64) -> Form {
    Form::Play {
        half_width,
        lines: vec![Line {
            order: 1.0,
            cosine: swing,
            sine: 0.0,
        }],
    }
}

fn friction(amplitude: f64, start: f64) -> Form {
    Form::Friction {
        amplitude,
        length: 1.0,
        start,
    }
}

fn by_torque() -> Form {
    Form::Scaled {
        signal: Signal::Torque,
        origin: 1.0,
        absolute: false,
        level: 2e-3,
        relative: 0.1,
        lines: vec![],
    }
}

/// Joints that are taken together have each the errors of a corrector of its own.
#[test]
fn joints_alike_are_joints_alone() {
    let forms = [play(0.2, 0.05), friction(0.1, 0.5), by_torque()];
    for argument in [Argument::Reference, Argument::Indicated] {
        let terms = terms(argument, 0.01, &forms).unwrap();
        for count in [0, 1, 2, 128, 129, 300] {
            let mut alike = Alike::new(Arc::clone(&terms), count);
            assert_eq!((alike.len(), alike.is_empty()), (count, count == 0));
            let mut alone = vec![Corrector::new(Arc::clone(&terms)); count];
            for step in 0..8 {
                let swing = |i: usize| (0.9 * f64::from(step) + i as f64).sin();
                let mut angles: Vec<f64> = (0..count).map(|i| i as f64 + 2.0 * swing(i)).collect();
                if step == 3 && count > 1 {
                    angles[1] = f64::NAN;
                }
                let torque: Vec<f64> = (0..count).map(swing).collect();
                let direction: Vec<f64> = torque.iter().map(|t| t.signum()).collect();
                let mut columns = Columns::default().with(Signal::Torque, &torque[..]);
                if step > 5 {
                    columns = columns.with(Signal::Direction, &direction[..]);
                }
                if step == 4 && count > 0 {
                    alike.reset(count / 2);
                    alone[count / 2].reset();
                }
                let mut errors = vec![0.0; count];
                alike.errors(&angles, &columns, &mut errors).unwrap();
                for (i, (one, &error)) in alone.iter_mut().zip(&errors).enumerate() {
                    let own = one.error(angles[i], &columns.at(i)).unwrap();
                    let same = own == error || (own.is_nan() && error.is_nan());
                    assert!(same, "joint {i} of {count} at {step}: {error} {own}");
                }
            }
        }
    }
}

#[test]
fn joints_alike_want_an_angle_each() {
    let terms = terms(Argument::Reference, 0.01, &[]).unwrap();
    let mut alike = Alike::new(terms, 2);
    for (angles, errors) in [(1, 2), (2, 3), (3, 3)] {
        let columns = Columns::default();
        let failure = alike.errors(&vec![0.0; angles], &columns, &mut vec![0.0; errors]);
        let got = if angles == 2 { errors } else { angles };
        assert_eq!(
            failure,
            Err(Error::Length {
                what: "angles",
                got,
                other: "joint",
                wanted: 2
            })
        );
    }
}

/// As many as a loop counts, of any length and whether readings know a past; none of no stretch.
#[test]
fn a_batch_counts_what_lies_outside() {
    let stretch = Stretch::new(100.0, 200.0, PERIOD, true);
    for form in [by_torque(), play(0.2, 0.05)] {
        let terms = terms(Argument::Reference, 0.01, &[form]).unwrap();
        for len in [0, 1, 1000, 9001] {
            let angles: Vec<f64> = (0..len).map(|i| 0.37 * f64::from(i) - 400.0).collect();
            let columns = Columns::default().with(Signal::Torque, &[0.5][..]);
            for stretch in [None, Some(&stretch)] {
                let mut found = vec![0.0; angles.len()];
                let batch = Batch::apart(&angles, &mut found).unwrap();
                let mut corrector = Corrector::new(Arc::clone(&terms));
                let quantity = Quantity::Correction;
                let count = corrector.run(quantity, batch, &columns, Some(2), stretch);
                let is_out = |x: &&f64| !(100.0..=200.0).contains(&x.rem_euclid(PERIOD));
                let slow = stretch.map_or(0, |_| found.iter().filter(is_out).count());
                assert_eq!(count, Ok(slow), "{len}");
            }
        }
    }
}

/// A joint that is read twice at the same place goes nowhere.
#[test]
fn standing_still_keeps_the_direction() {
    let terms = terms(Argument::Reference, 0.0, &[friction(0.1, 0.0)]).unwrap();
    for direction in [1.0, -1.0] {
        let mut joint = Corrector::new(Arc::clone(&terms));
        for k in 0..40 {
            let indicated = 10.0 + direction * 0.7 * f64::from(k);
            let signals = Signals::default();
            let first = joint.correct(indicated, &signals).unwrap();
            if k > 0 {
                assert_eq!(joint.store()[1], direction, "{k}");
            }
            assert_eq!(joint.correct(indicated, &signals).unwrap(), first);
            if k > 0 {
                assert_eq!(joint.store()[1], direction, "{k}");
            }
        }
    }
}

/// Powers of two are exact however large, and so is what whole turns leave of them.
#[test]
fn terms_repeat_however_far_away() {
    const ROUNDING: f64 = 1e-13;
    let bump = Form::Bump {
        place: 100.0,
        width: 50.0,
        height: 0.5,
        cycles: 2.0,
    };
    let filter = Form::Filter {
        frequency: 2.0,
        damping: Some(0.7),
    };
    let terms = terms(Argument::Reference, 0.01, &[bump, filter]).unwrap();
    let mut joint = Corrector::new(terms);
    let signals = Signals::default().with(Signal::Velocity, 500.0);
    for power in [10, 40, 55, 58, 59, 60, 61, 62, 66, 70, 100] {
        let near = ((1u128 << power) % 360) as f64;
        for sign in [1.0, -1.0] {
            let far = joint.error(sign * (1u128 << power) as f64, &signals);
            let same = joint.error(sign * near, &signals).unwrap();
            assert!((far.unwrap() - same).abs() < ROUNDING, "2^{power}");
        }
    }
}

/// Slopes of the series and of every term add up: all of them fold the angle back, without any
/// one of them none does.
#[test]
fn steep_parts_add_up() {
    const ROUNDING: f64 = 1e-12;
    let ramp = Form::Ramp {
        slope: -0.3,
        start: 0.0,
        stop: 90.0,
    };
    let forms = [friction(0.15, 0.0), play(20.0, 0.3f64.to_degrees()), ramp];
    match terms(Argument::Reference, 0.2, &forms).unwrap_err() {
        Error::NotInvertible { slope } => assert!((slope - 1.1).abs() < ROUNDING, "{slope}"),
        other => panic!("{other}"),
    }
    assert!(terms(Argument::Indicated, 0.2, &forms).is_ok());
    assert!(terms(Argument::Reference, 0.0, &forms).is_ok());
    for out in 0..3 {
        let mut forms = forms.to_vec();
        forms.remove(out);
        assert!(terms(Argument::Reference, 0.2, &forms).is_ok(), "{out}");
    }
}
