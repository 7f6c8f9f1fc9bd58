//! Periods, wrapping and exact phases.

use std::f64::consts::{PI, TAU};

use proptest::prelude::*;
use trueangle::Error;
use trueangle::angle::{Period, sin_cos_turns};

/// Two roundings of a phase of at most half a turn.
const PHASE: f64 = 1.2e-16;

#[test]
fn a_turn_must_be_positive_and_finite() {
    for bad in [0.0, -360.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(Period::new(bad), Err(Error::Period(_))), "{bad}");
    }
}

#[test]
fn half_a_turn_belongs_to_the_upper_end() {
    let degrees = Period::new(360.0).unwrap();
    for (angle, wanted) in [
        (180.0, 180.0),
        (-180.0, 180.0),
        (540.0, 180.0),
        (181.0, -179.0),
        (-0.0, 0.0),
        (7.2e8 + 1.0, 1.0),
    ] {
        assert_eq!(degrees.wrap(angle), wanted, "{angle}");
    }
}

/// Ten thousand half turns, each with the doubles beside it: where reductions are cut.
#[test]
fn every_half_turn_and_what_lies_beside_it() {
    for period in [TAU, 360.0, 1.0, 65536.0] {
        let turn = Period::new(period).unwrap();
        for k in -5000..=5000 {
            let cut = f64::from(k) * 0.5 * period;
            for x in [cut.next_down(), cut, cut.next_up()] {
                let wrapped = turn.wrap(x);
                assert!(
                    -period / 2.0 < wrapped && wrapped <= period / 2.0,
                    "{x} of {period}"
                );
                let turns = (x - wrapped) / period;
                assert!((turns - turns.round()).abs() < 1e-12, "{x} of {period}");
                let (phase, low) = turn.phase(x, 3.0);
                assert!(
                    phase.abs() <= 0.5 + PHASE && low.abs() <= PHASE,
                    "{x} of {period}"
                );
            }
        }
    }
}

#[test]
fn the_double_nearest_to_two_pi_stands_for_two_pi_itself() {
    // sin(1e6 rad) = -0.34999350217129295211765248678077146906140660532871 (mpmath, 50 digits)
    let (sine, _) = sin_cos_turns(Period::new(TAU).unwrap().phase(1e6, 1.0));
    assert!((sine - -0.349_993_502_171_292_95).abs() <= 2.0 * f64::EPSILON);
    // Any other period is taken as it is: one turn of it is a turn exactly.
    let (sine, cosine) = sin_cos_turns(Period::new(6.25).unwrap().phase(6.25 * 12345.0, 1.0));
    assert_eq!((sine, cosine), (0.0, 1.0));
}

#[test]
fn what_is_not_finite_has_no_phase() {
    let period = Period::new(TAU).unwrap();
    for x in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert!(period.wrap(x).is_nan());
        assert!(sin_cos_turns(period.phase(x, 3.0)).0.is_nan());
    }
    // Angles that no longer carry a place within the turn still give numbers.
    assert!(sin_cos_turns(period.phase(1e300, 1.0)).0.abs() <= 1.0);
}

proptest! {
    /// Whole turns change nothing, at any number of turns and for any shaft of whole cycles.
    #[test]
    fn whole_turns_leave_the_phase(part in 0..4096u32, turns in -1_000_000..1_000_000i64, cycles in 1..500u32) {
        // Multiples of 1/4096 turn are exact in degrees of 4096: no rounding hides a mistake.
        let period = Period::new(4096.0).unwrap();
        let x = f64::from(part) + 4096.0 * turns as f64;
        let (near, _) = period.phase(f64::from(part), f64::from(cycles));
        let (far, _) = period.phase(x, f64::from(cycles));
        // Half a turn may come out with either sign.
        prop_assert!((near - far).abs() == 0.0 || (near - far).abs() == 1.0);
    }

    /// The phase of a shaft is its number of turns less a whole number.
    #[test]
    fn phases_are_turns_modulo_one(x in -1e4..1e4f64, cycles in 0.01..300.0f64) {
        let (phase, low) = Period::new(360.0).unwrap().phase(x, cycles);
        prop_assert!(phase.abs() <= 0.5 + PHASE);
        let turns = cycles * x / 360.0;
        let difference = turns - phase - low;
        // The check itself rounds `turns`.
        prop_assert!((difference - difference.round()).abs() <= 4.0 * f64::EPSILON * turns.abs().max(1.0));
    }

    /// Sine and cosine of a phase lie on the circle and agree with libm.
    #[test]
    fn sine_and_cosine_of_turns(phase in -0.5..0.5f64) {
        let (sine, cosine) = sin_cos_turns((phase, 0.0));
        prop_assert!((sine.hypot(cosine) - 1.0).abs() < 4.0 * f64::EPSILON);
        prop_assert!((sine - (2.0 * PI * phase).sin()).abs() < 1e-15);
    }

    /// Wrapping moves by whole turns into the half-open interval.
    #[test]
    fn wrapping(x in -1e9..1e9f64, period in prop::sample::select(vec![TAU, 360.0, 1.0, 65536.0])) {
        let wrapped = Period::new(period).unwrap().wrap(x);
        prop_assert!(-period / 2.0 < wrapped && wrapped <= period / 2.0);
        let turns = (x - wrapped) / period;
        prop_assert!((turns - turns.round()).abs() < 1e-6);
    }
}
