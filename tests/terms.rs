//! Terms of the correction, in pure Rust: inversion, state, signals.

use std::sync::Arc;

use proptest::prelude::*;
use trueangle::kernel::{Argument, Batch, Evaluator, Quantity};
use trueangle::terms::{Columns, Corrector, Form, Line, Signal, Signals, Term, Terms};
use trueangle::{Error, HarmonicSeries, Shaft};

const PERIOD: f64 = 360.0;

/// The contract: corrections to below 1e-12 of a turn.
const SOLVED: f64 = 1e-12 * PERIOD;

fn corrector(terms: &[Term]) -> Corrector {
    let shafts = vec![
        Shaft {
            cycles: 1.0,
            orders: vec![1, 3],
            cosine: vec![0.3, 0.0],
            sine: vec![0.1, 0.05],
        },
        Shaft {
            cycles: 50.0,
            orders: vec![2],
            cosine: vec![0.003],
            sine: vec![0.002],
        },
    ];
    let series = HarmonicSeries::new(PERIOD, 30.0, shafts).unwrap();
    let evaluator = Arc::new(Evaluator::new(series, Argument::Reference));
    Corrector::new(Arc::new(Terms::new(evaluator, terms).unwrap()))
}

fn term(form: Form) -> Term {
    let name = format!("{form:?}").to_lowercase();
    let name = name.split(' ').next().unwrap_or_default().to_owned();
    Term { name, form }
}

fn every_term() -> Vec<Term> {
    let line = |order, cosine, sine| Line {
        order,
        cosine,
        sine,
    };
    let scaled = |signal, origin, absolute, level, relative, lines| Form::Scaled {
        signal,
        origin,
        absolute,
        level,
        relative,
        lines,
    };
    let lines = vec![line(1.0, 1e-3, 0.0), line(50.5, 0.0, 2e-5)];
    let forms = vec![
        Form::Play {
            half_width: 0.02,
            lines: vec![line(1.0, 0.005, 0.0), line(3.0, 0.0, 0.002)],
        },
        Form::Friction {
            amplitude: 0.01,
            length: 2.0,
            start: 0.5,
        },
        Form::Bump {
            place: 100.0,
            width: 5.0,
            height: 0.01,
            cycles: 2.0,
        },
        Form::Lag { delay: 1e-3 },
        Form::Filter {
            frequency: 50.0,
            damping: None,
        },
        Form::Filter {
            frequency: 80.0,
            damping: Some(0.7),
        },
        scaled(Signal::Temperature, 20.0, false, 1e-3, 1e-3, lines),
        scaled(Signal::Torque, 0.0, false, 3e-3, 0.0, vec![]),
        scaled(Signal::Current, 0.0, false, 2e-3, 0.0, vec![]),
        Form::Spring {
            signal: Signal::Torque,
            linear: 1e-3,
            cubic: 2e-6,
            beyond: -2e-4,
            knee: 3.0,
            gravity: Some(30.0),
        },
        scaled(
            Signal::Torque,
            0.0,
            true,
            0.0,
            0.0,
            vec![line(100.0, 1e-5, 1e-5)],
        ),
    ];
    forms.into_iter().map(term).collect()
}

proptest! {
    /// Defining identity, over random walks and random signals.
    #[test]
    fn correct_is_the_inverse_of_error(
        steps in prop::collection::vec((-5.0..5.0f64, -300.0..300.0f64, -20.0..60.0f64, -9.0..9.0f64), 1..200),
        directed in any::<bool>(),
        start in -1e4..1e4f64,
    ) {
        let mut terms = every_term();
        if !directed {
            terms.retain(|term| !matches!(term.form, Form::Lag { .. } | Form::Filter { .. }));
        }
        let (mut forward, mut back) = (corrector(&terms), corrector(&terms));
        let mut theta = start;
        for (step, velocity, temperature, torque) in steps {
            theta += step;
            let signals = Signals::default().with(Signal::Velocity, directed.then_some(velocity)).with(Signal::Temperature, temperature).with(Signal::Torque, torque)
                .with(Signal::Current, -0.4 * torque).with(Signal::Direction, directed.then_some(step));
            let error = forward.error(theta, &signals).unwrap();
            let found = back.correct(theta + error, &signals).unwrap();
            prop_assert!((found - theta).abs() <= SOLVED, "{found} {theta}");
        }
    }

    /// Batches of any size give what steps give, bit for bit.
    #[test]
    fn a_batch_is_its_steps(angles in prop::collection::vec(-400.0..400.0f64, 0..300)) {
        for terms in [
            every_term(),
            vec![
                term(Form::Lag { delay: 1e-3 }),
                term(Form::Scaled {
                    signal: Signal::Torque,
                    origin: 0.0,
                    absolute: false,
                    level: 1e-3,
                    relative: 0.0,
                    lines: vec![],
                }),
            ],
        ] {
            let velocity: Vec<f64> = angles.iter().map(|x| 3.0 * x).collect();
            let columns = Columns::default().with(Signal::Velocity, &velocity[..]).with(Signal::Temperature, &[35.0][..]).with(Signal::Torque, &[-4.0][..])
                .with(Signal::Current, &[0.7][..]);
            let mut batch = vec![0.0; angles.len()];
            let pairs = Batch::apart(&angles, &mut batch).unwrap();
            corrector(&terms).run(Quantity::Correction, pairs, &columns, None, None).unwrap();
            let mut steps = corrector(&terms);
            for (i, &x) in angles.iter().enumerate() {
                prop_assert_eq!(steps.correct(x, &columns.at(i)).unwrap(), batch[i]);
            }
        }
    }
}

/// Longer than a part, and no multiple of one: nothing is lost or done twice where parts meet.
#[test]
fn a_long_batch_is_its_steps() {
    let angles: Vec<f64> = (0..9001)
        .map(|i| 300.0 * (0.01 * f64::from(i)).sin())
        .collect();
    let torque: Vec<f64> = angles.iter().map(|x| 0.02 * x).collect();
    let columns = Columns::default()
        .with(Signal::Velocity, &[20.0][..])
        .with(Signal::Temperature, &[35.0][..])
        .with(Signal::Torque, &torque[..])
        .with(Signal::Current, &[0.7][..]);
    for some in [0..4, 3..11] {
        let terms = &every_term()[some];
        let mut batch = angles.clone();
        let pairs = Batch::in_place(&mut batch);
        let mut whole = corrector(terms);
        whole
            .run(Quantity::Correction, pairs, &columns, None, None)
            .unwrap();
        let mut steps = corrector(terms);
        for (i, &x) in angles.iter().enumerate() {
            assert_eq!(steps.correct(x, &columns.at(i)).unwrap(), batch[i], "{i}");
        }
    }
}

/// The formula of each form, written out beside the series: the error with it less that without.
#[test]
fn every_form_adds_its_formula() {
    const ROUNDING: f64 = 1e-13;
    let series = |x: f64| {
        let (one, fifty) = (x.to_radians(), (50.0 * x).to_radians());
        let low = 0.3 * one.cos() + 0.1 * one.sin() + 0.05 * (3.0 * one).sin();
        low + 0.003 * (2.0 * fifty).cos() + 0.002 * (2.0 * fifty).sin()
    };
    let scaled = |absolute| Form::Scaled {
        signal: Signal::Temperature,
        origin: 20.0,
        absolute,
        level: 1e-3,
        relative: 2e-3,
        lines: vec![Line {
            order: 1.5,
            cosine: 1e-3,
            sine: 2e-3,
        }],
    };
    let spring = |gravity| Form::Spring {
        signal: Signal::Torque,
        linear: 1e-3,
        cubic: 2e-6,
        beyond: -2e-4,
        knee: 3.0,
        gravity,
    };
    let bump = Form::Bump {
        place: 100.0,
        width: 5.0,
        height: 0.01,
        cycles: 2.0,
    };
    let ramp = Form::Ramp {
        slope: 1e-4,
        start: -20.0,
        stop: 80.0,
    };
    let factor = |x: f64| {
        let turn = 1.5 * x.to_radians();
        1e-3 + 2e-3 * series(x) + 1e-3 * turn.cos() + 2e-3 * turn.sin()
    };
    let wound = |m: f64| {
        let past = (m.abs() - 3.0).max(0.0) * m.signum();
        1e-3 * m + 2e-6 * m.powi(3) - 2e-4 * past
    };
    let gauss = |x: f64| {
        let apart = (2.0 * x - 100.0 + 180.0).rem_euclid(PERIOD) - 180.0;
        0.01 * (-0.5 * (apart / 5.0).powi(2)).exp()
    };
    type Formula<'a> = Box<dyn Fn(f64, f64, f64) -> f64 + 'a>;
    let all: Vec<(Form, Formula)> = vec![
        (scaled(false), Box::new(|x, t, _| (t - 20.0) * factor(x))),
        (
            scaled(true),
            Box::new(|x, t, _| (t - 20.0).abs() * factor(x)),
        ),
        (spring(None), Box::new(|_, _, m| wound(m))),
        (
            spring(Some(30.0)),
            Box::new(|x, _, m| wound(m * (x - 30.0).to_radians().sin())),
        ),
        (bump, Box::new(|x, _, _| gauss(x))),
        (
            ramp,
            Box::new(|x, _, _| 1e-4 * (x.clamp(-20.0, 80.0) - 30.0)),
        ),
    ];
    let mut bare = corrector(&[]);
    for (form, formula) in all {
        let mut with_form = corrector(&[term(form.clone())]);
        let mut alone = corrector(&[term(form.clone())]);
        for k in 0..200 {
            let x = 3.7 * f64::from(k) - 300.0;
            let (t, m) = (20.0 + 15.0 * (0.3 * x).sin(), 9.0 * (0.7 * x).cos());
            let signals = Signals::default()
                .with(Signal::Temperature, t)
                .with(Signal::Torque, m);
            let with = with_form.error(x, &signals).unwrap();
            let without = bare.error(x, &signals).unwrap();
            let off = (with - without - formula(x, t, m)).abs();
            assert!(off < ROUNDING, "{form:?} at {x}: {off}");
            // No other form is there that would have the angle searched for.
            let back = alone.correct(x + with, &signals).unwrap();
            assert!((back - x).abs() <= SOLVED, "{form:?} at {x}: {back}");
        }
    }
}

#[test]
fn a_missing_signal_is_named() {
    let mut corrector = corrector(&every_term());
    let signals = Signals::default()
        .with(Signal::Temperature, 20.0)
        .with(Signal::Velocity, 1.0);
    assert_eq!(
        corrector.correct(1.0, &signals),
        Err(Error::MissingSignal {
            signal: Signal::Torque,
            term: "scaled".to_owned()
        })
    );
    let mut out = [0.0];
    let columns = Columns::default().with(Signal::Velocity, &[1.0][..]);
    let batch = Batch::in_place(&mut out);
    let failure = corrector.run(Quantity::Correction, batch, &columns, None, None);
    assert!(
        failure
            .unwrap_err()
            .to_string()
            .contains("needs temperature")
    );
}

#[test]
fn columns_of_another_length_are_refused() {
    let mut out = [0.0; 3];
    let columns = Columns::default()
        .with(Signal::Torque, &[1.0, 2.0][..])
        .with(Signal::Velocity, &[1.0][..])
        .with(Signal::Temperature, &[1.0][..]);
    let failure = corrector(&every_term())
        .run(
            Quantity::Correction,
            Batch::in_place(&mut out),
            &columns,
            None,
            None,
        )
        .unwrap_err();
    assert_eq!(
        failure,
        Error::Length {
            what: "torque",
            got: 2,
            other: "angle",
            wanted: 3
        }
    );
}

/// Millions of turns away the angle is found as closely as a double tells it.
#[test]
fn a_distant_angle_is_found() {
    let bump = term(Form::Bump {
        place: 100.0,
        width: 5.0,
        height: 0.01,
        cycles: 2.0,
    });
    let terms = [bump];
    let (mut forward, mut back) = (corrector(&terms), corrector(&terms));
    let none = Signals::default();
    for turns in [0.0, 300.0, 1e3, -1e3, 1e6, -1e6, 1e9] {
        for k in 0..100 {
            let theta = (turns + 0.0137 * f64::from(k)) * PERIOD;
            let goal = theta + forward.error(theta, &none).unwrap();
            let found = back.correct(goal, &none).unwrap();
            let near = SOLVED + 4.0 * f64::EPSILON * theta.abs();
            assert!((found - theta).abs() <= near, "{found} is not {theta}");
        }
    }
}

/// An encoder within a turn tells what one that counts its turns tells: travel goes on.
#[test]
fn angles_within_a_turn_are_corrected_as_those_that_go_on() {
    /// Of angles of some turns.
    const ROUNDING: f64 = 1e-11;
    let travel = [
        term(Form::Play {
            half_width: 0.02,
            lines: vec![],
        }),
        term(Form::Friction {
            amplitude: 0.01,
            length: 2.0,
            start: 0.5,
        }),
    ];
    // Some turns on and back, twice, in steps of 7 degrees and less.
    let angles: Vec<f64> = (0..900)
        .map(|i| 1500.0 * (f64::from(i) * 0.0044).sin() + 40.0)
        .collect();
    let within: Vec<f64> = angles.iter().map(|x| x.rem_euclid(PERIOD)).collect();
    let direction: Vec<f64> = (0..900)
        .map(|i| (f64::from(i) * 0.0044).cos().signum())
        .collect();
    let corrected = |terms: &[Term], angles: &[f64], directed: bool| {
        let mut columns = Columns::default();
        if directed {
            columns = columns.with(Signal::Direction, &direction[..]);
        }
        let mut out = vec![0.0; angles.len()];
        let pairs = Batch::apart(angles, &mut out).unwrap();
        corrector(terms)
            .run(Quantity::Correction, pairs, &columns, None, None)
            .unwrap();
        out
    };
    for terms in [&travel[..1], &travel[1..], &travel[..]] {
        for directed in [true, false] {
            if !directed && terms.len() == 1 && matches!(terms[0].form, Form::Friction { .. }) {
                continue;
            }
            let whole = corrected(terms, &angles, directed);
            let parts = corrected(terms, &within, directed);
            for i in 0..angles.len() {
                let turns = angles[i] - within[i];
                let off = (whole[i] - parts[i] - turns).abs();
                assert!(off < ROUNDING, "{directed} at {}: {off}", angles[i]);
            }
        }
    }
}

#[test]
fn resetting_forgets_the_past() {
    let mut corrector = corrector(&[term(Form::Play {
        half_width: 1.0,
        lines: vec![],
    })]);
    let forward = Signals::default().with(Signal::Direction, 1.0);
    let unknown = Signals::default();
    let first = corrector.correct(10.0, &unknown).unwrap();
    let moving = corrector.correct(10.0, &forward).unwrap();
    assert!((first - moving - 1.0).abs() < 0.01);
    corrector.reset();
    assert_eq!(corrector.correct(10.0, &unknown).unwrap(), first);
}

#[test]
fn friction_steeper_than_the_angle_is_refused() {
    let steep = term(Form::Friction {
        amplitude: 1.0,
        length: 1.0,
        start: 0.0,
    });
    let series = HarmonicSeries::new(PERIOD, 0.0, vec![]).unwrap();
    let evaluator = Arc::new(Evaluator::new(series, Argument::Reference));
    assert!(matches!(
        Terms::new(evaluator, &[steep]),
        Err(Error::NotInvertible { slope }) if slope == 2.0
    ));
}

#[test]
fn play_that_is_negative_somewhere_needs_a_direction() {
    let play = |half_width, swing| Form::Play {
        half_width,
        lines: vec![Line {
            order: 2.0,
            cosine: 0.0,
            sine: swing,
        }],
    };
    assert_eq!(play(1.0, 0.9).needs(), None);
    assert_eq!(play(1.0, 1.1).needs(), Some(Signal::Direction));
    assert_eq!(play(0.0, 0.1).needs(), Some(Signal::Direction));
}

/// A line behind a damped second-order low-pass, by complex numbers written out.
#[test]
fn a_damped_filter_has_the_gain_of_its_equation() {
    let (order, amplitude, speed, frequency, damping) = (7.0, 0.5, 900.0, 40.0, 0.6);
    let shaft = Shaft {
        cycles: order,
        orders: vec![1],
        cosine: vec![amplitude],
        sine: vec![0.0],
    };
    let series = HarmonicSeries::new(PERIOD, 0.0, vec![shaft]).unwrap();
    let evaluator = Arc::new(Evaluator::new(series, Argument::Reference));
    let filter = term(Form::Filter {
        frequency,
        damping: Some(damping),
    });
    let mut joint = Corrector::new(Arc::new(Terms::new(evaluator, &[filter]).unwrap()));
    let signals = Signals::default().with(Signal::Velocity, speed);
    let w = order * speed / PERIOD / frequency;
    let size = (1.0 - w * w).hypot(2.0 * damping * w).recip();
    let lag = (2.0 * damping * w).atan2(1.0 - w * w);
    for theta in [0.0, 13.0, 200.5] {
        let seen = amplitude * size * (order * f64::to_radians(theta) - lag).cos();
        let error = joint.error(theta, &signals).unwrap();
        assert!((error - seen).abs() < SOLVED, "{error} {seen}");
        let back = joint.correct(theta + error, &signals).unwrap();
        assert!((back - theta).abs() <= SOLVED, "{back} {theta}");
    }
}
