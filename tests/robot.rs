//! A robot's step is every joint's own, to the last bit, whatever the joints are.

use std::sync::Arc;

use trueangle::compensator::Compensator;
use trueangle::kernel::{Argument, Evaluator};
use trueangle::robot::{Coupling, Joint, Robot};
use trueangle::terms::{Columns, Corrector, Form, Line, Signal, Signals, Term, Terms};
use trueangle::{HarmonicSeries, Shaft};

const PERIOD: f64 = 360.0;

fn evaluator(joint: usize, cycles: f64) -> Arc<Evaluator> {
    let size = 0.1 + 0.05 * joint as f64;
    let shaft = Shaft {
        cycles,
        orders: vec![1, 3],
        cosine: vec![size, 0.0],
        sine: vec![0.1, -0.2 * size],
    };
    let series = HarmonicSeries::new(PERIOD, 0.5 * joint as f64, vec![shaft]).unwrap();
    Arc::new(Evaluator::new(series, Argument::Reference))
}

fn still(joint: usize, cycles: f64) -> Joint {
    Joint::Still(Compensator::new(evaluator(joint, cycles)).unwrap())
}

/// With a past (friction) and the angle of another joint.
fn corrector(joint: usize) -> Corrector {
    let line = |order, cosine| Line {
        order,
        cosine,
        sine: 0.002,
    };
    let forms = [
        Form::Friction {
            amplitude: 0.01,
            length: 2.0,
            start: 0.5,
        },
        Form::Scaled {
            signal: Signal::Other2,
            origin: 5.0,
            absolute: false,
            level: 1e-3,
            relative: 0.0,
            lines: vec![line(1.0, 1e-4)],
        },
    ];
    let name = |i| format!("term {i}");
    let terms = forms.into_iter().enumerate();
    let terms: Vec<_> = terms
        .map(|(i, form)| Term {
            name: name(i),
            form,
        })
        .collect();
    Corrector::new(Arc::new(Terms::new(evaluator(joint, 1.0), &terms).unwrap()))
}

fn angles(k: usize) -> Vec<f64> {
    let turn = |j: usize| 40.0 * ((0.3 + 0.1 * j as f64) * k as f64).sin() + 100.0 * j as f64;
    (0..4).map(turn).collect()
}

const DIRECTION: [f64; 4] = [0.0, 1.0, -1.0, 1.0];
const COUPLINGS: [Coupling; 2] = [
    Coupling {
        joint: 1,
        signal: Signal::Other2,
        other: 3,
        scale: 0.5,
    },
    Coupling {
        joint: 2,
        signal: Signal::Other2,
        other: 1,
        scale: -2.0,
    },
];

fn robot() -> Robot {
    let moving = |joint| Joint::Moving(Box::new(corrector(joint)));
    Robot::coupled(
        vec![still(0, 1.0), moving(1), moving(2), still(3, 2.5)],
        COUPLINGS.to_vec(),
    )
}

fn stepped(robot: &mut Robot, k: usize) -> Vec<f64> {
    let mut found = angles(k);
    let given = Columns::default().with(Signal::Direction, &DIRECTION[..]);
    robot.step(&mut found, &given).unwrap();
    found
}

/// Coupled joints see the indicated angles of the same sample, each by its own scale.
#[test]
fn coupled_joints_are_each_ones_own() {
    let mut robot = robot();
    let mut own = [corrector(1), corrector(2)];
    for k in 0..60 {
        let x = angles(k);
        let found = stepped(&mut robot, k);
        for (j, cycles) in [(0, 1.0), (3, 2.5)] {
            let alone = Compensator::new(evaluator(j, cycles)).unwrap();
            assert_eq!(found[j], alone.step(x[j]));
        }
        for (corrector, about) in own.iter_mut().zip(COUPLINGS) {
            let j = about.joint;
            let signals = Signals::default()
                .with(Signal::Direction, DIRECTION[j])
                .with(Signal::Other2, about.scale * x[about.other]);
            assert_eq!(found[j], corrector.correct(x[j], &signals).unwrap());
        }
    }
}

/// Joints of a series alone, with tables and without.
#[test]
fn joints_without_a_past_are_each_ones_own() {
    for cycles in [1.0, 2.5] {
        let mut robot = Robot::new((0..4).map(|j| still(j, cycles)).collect());
        for k in 0..60 {
            let found = stepped(&mut robot, k);
            for (j, x) in angles(k).into_iter().enumerate() {
                let alone = Compensator::new(evaluator(j, cycles)).unwrap();
                assert_eq!(found[j], alone.step(x));
            }
        }
        assert_eq!(robot.store(), vec![Vec::<f64>::new(); 4]);
        assert!(robot.restore(&vec![vec![]; 4]) && !robot.restore(&vec![vec![]; 3]));
    }
}

/// What is stored goes on as it would have; what is reset begins anew; another's past is refused.
#[test]
fn a_past_is_stored_taken_over_and_forgotten() {
    let mut robot = robot();
    (0..20).for_each(|k| drop(stepped(&mut robot, k)));
    let past = robot.store();
    assert_eq!([past[0].len(), past[3].len()], [0, 0]);
    let on: Vec<_> = (20..40).map(|k| stepped(&mut robot, k)).collect();
    for wrong in [
        &past[..3],
        &[past[1].clone(), past[1].clone(), past[2].clone(), vec![]],
        &[vec![], vec![], vec![], vec![]],
    ] {
        assert!(!robot.restore(wrong));
    }
    let stays = robot.store();
    assert!(robot.restore(&past) && robot.store() == past && stays != past);
    let again: Vec<_> = (20..40).map(|k| stepped(&mut robot, k)).collect();
    assert_eq!(on, again);
    robot.reset();
    let mut new = self::robot();
    for k in 40..60 {
        assert_eq!(stepped(&mut robot, k), stepped(&mut new, k));
    }
}

/// No joint moves where one lacks a signal; the joint is named.
#[test]
fn a_joint_that_lacks_a_signal_stops_all() {
    let moving = |joint| Joint::Moving(Box::new(corrector(joint)));
    let first = Coupling {
        joint: 0,
        other: 1,
        ..COUPLINGS[0]
    };
    let mut robot = Robot::coupled(vec![moving(0), moving(1)], vec![first]);
    let all = Columns::default().with(Signal::Other2, &[1.0][..]);
    robot.step(&mut [1.0, 2.0], &all).unwrap();
    let mut found = [10.0, 20.0];
    // What is not known yet is not a number, which equals nothing.
    let before = format!("{:?}", robot.store());
    let given = Columns::default().with(Signal::Direction, &[1.0][..]);
    let error = robot.step(&mut found, &given).unwrap_err();
    assert_eq!(
        (error.joint, found, format!("{:?}", robot.store())),
        (1, [10.0, 20.0], before)
    );
}

#[test]
#[should_panic(expected = "couplings of its joints")]
fn a_coupling_is_of_joints_that_are_there() {
    let coupling = Coupling {
        joint: 0,
        other: 2,
        ..COUPLINGS[0]
    };
    let _ = Robot::coupled(vec![still(0, 1.0), still(1, 1.0)], vec![coupling]);
}
