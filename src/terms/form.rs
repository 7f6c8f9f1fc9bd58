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
