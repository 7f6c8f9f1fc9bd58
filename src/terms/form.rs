//! The forms of a correction, one variant each: parameters in the unit of the series' period.
//!
//! They have no physical names: what a form stands for is the caller's, who labels it.

use super::signals::Signal;
pub use crate::series::Line;

/// A form and what its user calls it: the name stands in messages.
#[derive(Clone, Debug, PartialEq)]
pub struct Term {
    /// What the form stands for.
    pub name: String,
    /// The error it adds.
    pub form: Form,
}

/// An error beyond the harmonics.
#[derive(Clone, Debug, PartialEq)]
pub enum Form {
    /// `direction * (half_width + lines)`.
    Play {
        /// Half of forward minus reverse, on average over a turn.
        half_width: f64,
        /// How it varies with the place.
        lines: Vec<Line>,
    },
    /// `amplitude * z`, `dz/ds = (direction - z) / length` over travel `s`.
    Friction {
        /// Half of the reversal error far from the reversal.
        amplitude: f64,
        /// Travel in which it builds up.
        length: f64,
        /// Share of the wind-up that is there at the first motion, 0 to 1.
        start: f64,
    },
    /// The indicated angle is that of `delay` seconds ago.
    Lag {
        /// Seconds.
        delay: f64,
    },
    /// The series low-passed at constant velocity, without a ramp error.
    Filter {
        /// Hertz: the corner of a first-order low-pass, the natural frequency of a damped one.
        frequency: f64,
        /// Damping ratio of a second-order low-pass.
        damping: Option<f64>,
    },
    /// `(signal - origin) * (level + relative * series + lines)`.
    Scaled {
        /// What it follows.
        signal: Signal,
        /// Where it is zero.
        origin: f64,
        /// The absolute value of `signal - origin` counts.
        absolute: bool,
        /// At every angle, per unit of the signal.
        level: f64,
        /// Relative growth of the series without its constant, per unit of the signal.
        relative: f64,
        /// Per unit of the signal.
        lines: Vec<Line>,
    },
    /// `linear m + cubic m^3 + beyond sign(m) max(|m| - knee, 0)` with `m` the signal, or
    /// `signal * sin(x - gravity)`.
    Spring {
        /// What it follows.
        signal: Signal,
        /// Per unit of the signal.
        linear: f64,
        /// Per unit of the signal cubed.
        cubic: f64,
        /// Per unit of the signal beyond the knee.
        beyond: f64,
        /// In units of the signal.
        knee: f64,
        /// Angle at which the signal has no moment.
        gravity: Option<f64>,
    },
    /// `height exp(-(a - place)^2 / (2 width^2))` at the angle `a = cycles x` of a shaft.
    Bump {
        /// In units of the period, a turn of the shaft.
        place: f64,
        /// One standard deviation, likewise.
        width: f64,
        /// Error at the place.
        height: f64,
        /// Turns of the shaft per output turn.
        cycles: f64,
    },
    /// `slope (x - middle)` from `start` to `stop`, and beyond them what it is there.
    Ramp {
        /// Error per angle.
        slope: f64,
        /// Where it begins, over the turns.
        start: f64,
        /// Where it ends.
        stop: f64,
    },
}

impl Form {
    /// The signal without which it cannot be computed.
    ///
    /// Travel is seen in the angle itself, except where play is negative somewhere: the
    /// angle then does not tell the two directions apart.
    pub fn needs(&self) -> Option<Signal> {
        match self {
            Self::Play { half_width, lines } => {
                let swing: f64 = lines.iter().map(|line| line.cosine.hypot(line.sine)).sum();
                (half_width - swing < 0.0).then_some(Signal::Direction)
            }
            Self::Friction { .. } | Self::Bump { .. } | Self::Ramp { .. } => None,
            Self::Lag { .. } | Self::Filter { .. } => Some(Signal::Velocity),
            Self::Scaled { signal, .. } | Self::Spring { signal, .. } => Some(*signal),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::block::{Given, Work};
    use super::super::signals::Signals;
    use super::super::smooth::Smooth;
    use super::*;
    use crate::series::{HarmonicSeries, Shaft};

    /// Degrees between differences: what they miss of lines up to order 3 is a part in 1e6.
    const STEP: f64 = 0.02;
    const MISSED: f64 = 1e-5;

    /// How often greater than the greatest second derivative its bound may be.
    const LOOSE: f64 = 4.0;

    /// Angles from a kink within which a ramp has no bound.
    const NEAR: f64 = 0.5;

    /// Of a spring in a turn.
    const MOST_KINKS: usize = 4;

    /// Error, slope and bound of the second derivative.
    fn shape(form: &Smooth, x: f64) -> [f64; 3] {
        let signals = Signals::default()
            .with(Signal::Velocity, 500.0)
            .with(Signal::Temperature, 30.0)
            .with(Signal::Torque, -8.0);
        let mut work = Work::<1>::new();
        form.add_shape(&Given::one(&signals), &[x], true, &mut work);
        let rows = work.rows(1);
        [rows.error[0], rows.slope[0], rows.bend[0]]
    }

    /// The search for an angle trusts both: slopes are those of differences, and second ones stay
    /// within their bound, which is not much greater than they are.
    #[test]
    fn slopes_and_bends_are_those_of_differences() {
        let shaft = Shaft {
            cycles: 1.0,
            orders: vec![3],
            cosine: vec![0.3],
            sine: vec![-0.2],
        };
        let series = HarmonicSeries::new(360.0, 5.0, vec![shaft]).unwrap();
        let spring = |cubic, beyond| Form::Spring {
            signal: Signal::Torque,
            linear: 1e-3,
            cubic,
            beyond,
            knee: 3.0,
            gravity: Some(30.0),
        };
        let scaled = |relative, absolute| Form::Scaled {
            signal: Signal::Temperature,
            origin: 42.0,
            absolute,
            level: 0.0,
            relative,
            lines: vec![Line {
                order: 3.0,
                cosine: 3e-3,
                sine: -2e-3,
            }],
        };
        let filter = |damping| Form::Filter {
            frequency: 2.0,
            damping,
        };
        let forms = [
            spring(0.0, 0.0),
            spring(2e-6, 0.0),
            spring(2e-4, 0.0),
            spring(2e-6, -2e-4),
            scaled(0.0, false),
            scaled(2e-2, true),
            filter(None),
            filter(Some(0.7)),
            Form::Bump {
                place: 350.0,
                width: 30.0,
                height: -0.4,
                cycles: 2.0,
            },
            Form::Ramp {
                slope: 1e-2,
                start: -20.0,
                stop: 80.0,
            },
        ];
        for form in forms {
            let ready = Smooth::new(&form, &series, NEAR).unwrap().unwrap();
            let angles = (0..900).map(|i| 0.4 * f64::from(i) - 170.03);
            let found: Vec<_> = angles
                .map(|x| {
                    let [before, at, after] = [x - STEP, x, x + STEP].map(|x| shape(&ready, x));
                    let slope = (after[0] - before[0]) / (2.0 * STEP);
                    let bend = (after[0] - 2.0 * at[0] + before[0]) / (STEP * STEP);
                    (at, slope, bend.abs())
                })
                .collect();
            let steepest = found.iter().fold(0.0f64, |most, f| most.max(f.1.abs()));
            let most = found.iter().fold(0.0f64, |most, f| most.max(f.2));
            let mut bounds = found.iter().filter(|f| f.0[2].is_finite()).peekable();
            assert!(steepest > 0.0);
            let mut kinks = 0;
            for (at, slope, _) in &found {
                // One step from a kink differences see both sides of it.
                if (at[1] - slope).abs() > MISSED * steepest {
                    kinks += 1;
                    assert!(at[2].is_infinite(), "{form:?}: {at:?} {slope}");
                }
            }
            assert!(kinks <= MOST_KINKS, "{form:?}");
            let is_kinked = matches!(form, Form::Spring { beyond, .. } if beyond != 0.0);
            assert_eq!(bounds.peek().is_none(), is_kinked);
            for (at, _, bend) in bounds {
                assert!(*bend <= at[2] * 1.001 + 1e-9, "{form:?}: {bend} {at:?}");
                assert!(at[2] <= LOOSE * most, "{form:?}: {most} {at:?}");
            }
        }
    }
}
