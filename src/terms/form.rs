//! The forms of a correction, one variant each: parameters in the unit of the series' period.
//!
//! They have no physical names: what a form stands for is the caller's, who labels it.

use std::f64::consts::TAU;

use super::signals::{Signal, Signals};
use crate::angle::{Period, sin_cos_turns};
use crate::error::Error;
pub use crate::series::Line;
use crate::series::{HarmonicSeries, Shaft};

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

/// A form made ready: what it adds whatever the angle, and what depends on the angle.
#[derive(Clone, Debug)]
pub(super) enum Smooth {
    Scaled {
        signal: Signal,
        origin: f64,
        absolute: bool,
        level: f64,
        relative: f64,
        lines: Option<HarmonicSeries>,
    },
    Spring {
        signal: Signal,
        linear: f64,
        cubic: f64,
        beyond: f64,
        knee: f64,
        gravity: Option<f64>,
    },
    Filter {
        frequency: f64,
        damping: Option<f64>,
    },
    Bump {
        place: f64,
        width: f64,
        height: f64,
        cycles: f64,
    },
    Ramp {
        slope: f64,
        start: f64,
        stop: f64,
    },
}

impl Smooth {
    /// `None` for the forms of travel and delay.
    pub(super) fn new(form: &Form, period: f64) -> Result<Option<Self>, Error> {
        Ok(match *form {
            Form::Play { .. } | Form::Friction { .. } | Form::Lag { .. } => None,
            Form::Filter { frequency, damping } => Some(Self::Filter { frequency, damping }),
            Form::Scaled {
                signal,
                origin,
                absolute,
                level,
                relative,
                ref lines,
            } => Some(Self::Scaled {
                signal,
                origin,
                absolute,
                level,
                relative,
                lines: lines_of(lines, period)?,
            }),
            Form::Spring {
                signal,
                linear,
                cubic,
                beyond,
                knee,
                gravity,
            } => Some(Self::Spring {
                signal,
                linear,
                cubic,
                beyond,
                knee,
                gravity,
            }),
            Form::Bump {
                place,
                width,
                height,
                cycles,
            } => Some(Self::Bump {
                place,
                width,
                height,
                cycles,
            }),
            Form::Ramp { slope, start, stop } => Some(Self::Ramp { slope, start, stop }),
        })
    }

    /// True when the form differs from angle to angle.
    pub(super) fn is_shaped(&self) -> bool {
        match self {
            Self::Scaled {
                relative, lines, ..
            } => *relative != 0.0 || lines.is_some(),
            Self::Spring { gravity, .. } => gravity.is_some(),
            Self::Filter { .. } | Self::Bump { .. } | Self::Ramp { .. } => true,
        }
    }

    /// What it adds at every angle.
    pub(super) fn level(&self, signals: &Signals) -> f64 {
        match self {
            Self::Scaled { level, .. } if *level == 0.0 => 0.0,
            Self::Scaled { level, .. } => level * self.factor(signals),
            Self::Spring {
                signal,
                gravity: None,
                linear,
                cubic,
                beyond,
                knee,
            } => spring(value(signals, *signal), *linear, *cubic, *beyond, *knee).0,
            _ => 0.0,
        }
    }

    /// What it adds at angle `x` beyond the level, and its slope.
    pub(super) fn shape(&self, signals: &Signals, series: &HarmonicSeries, x: f64) -> (f64, f64) {
        match self {
            Self::Scaled {
                relative, lines, ..
            } => {
                let (mut sum, mut slope) = (0.0, 0.0);
                if *relative != 0.0 {
                    let (e, de) = series.evaluate(x);
                    sum += relative * (e - series.constant());
                    slope += relative * de;
                }
                if let Some(lines) = lines {
                    let (e, de) = lines.evaluate(x);
                    sum += e;
                    slope += de;
                }
                let factor = self.factor(signals);
                (factor * sum, factor * slope)
            }
            Self::Spring {
                signal,
                gravity: Some(gravity),
                linear,
                cubic,
                beyond,
                knee,
            } => {
                let period = series.period();
                let (sine, cosine) = sin_cos_turns(period.phase(x - gravity, 1.0));
                let load = value(signals, *signal);
                let (sum, slope) = spring(load * sine, *linear, *cubic, *beyond, *knee);
                (sum, slope * load * cosine * TAU / period.value())
            }
            Self::Spring { .. } => (0.0, 0.0),
            Self::Filter { frequency, damping } => {
                let turns_per_second = value(signals, Signal::Velocity) / series.period().value();
                filtered(series, turns_per_second / frequency, *damping, x)
            }
            Self::Bump {
                place,
                width,
                height,
                cycles,
            } => {
                let period = series.period();
                let (turn, low) = period.phase(x, *cycles);
                let away = period.wrap((turn + low) * period.value() - place) / width;
                let sum = height * (-0.5 * away * away).exp();
                (sum, -sum * away * cycles / width)
            }
            &Self::Ramp { slope, start, stop } => {
                let sum = slope * (x.max(start).min(stop) - 0.5 * (start + stop));
                let rises = start <= x && x <= stop;
                (sum, if rises { slope } else { 0.0 })
            }
        }
    }

    fn factor(&self, signals: &Signals) -> f64 {
        match self {
            Self::Scaled {
                signal,
                origin,
                absolute,
                ..
            } => {
                let factor = value(signals, *signal) - origin;
                if *absolute { factor.abs() } else { factor }
            }
            _ => 0.0,
        }
    }
}

/// A needed signal; its presence was checked.
fn value(signals: &Signals, signal: Signal) -> f64 {
    signals.get(signal).unwrap_or(f64::NAN)
}

pub(super) fn lines_of(lines: &[Line], period: f64) -> Result<Option<HarmonicSeries>, Error> {
    if lines.is_empty() {
        return Ok(None);
    }
    let shafts = lines
        .iter()
        .map(|line| Shaft {
            cycles: line.order,
            orders: vec![1],
            cosine: vec![line.cosine],
            sine: vec![line.sine],
        })
        .collect();
    HarmonicSeries::new(period, 0.0, shafts).map(Some)
}

/// Wind-up under the torque `m`, and its slope by `m`.
fn spring(m: f64, linear: f64, cubic: f64, beyond: f64, knee: f64) -> (f64, f64) {
    let over = m.abs() - knee;
    let (past, bend) = if over > 0.0 {
        (over.copysign(m), beyond)
    } else {
        (0.0, 0.0)
    };
    (
        linear * m + cubic * m * m * m + beyond * past,
        linear + 3.0 * cubic * m * m + bend,
    )
}

/// The gain of a low-pass less 1 at `w` times its frequency: real and imaginary part.
///
/// First order: `1/(1 + j w) - 1`; second: `1/(1 - w^2 + 2 j d w) - 1`.
fn change(w: f64, damping: Option<f64>) -> (f64, f64) {
    let Some(damping) = damping else {
        return (-w * w / (1.0 + w * w), -w / (1.0 + w * w));
    };
    let (stiff, loss) = (1.0 - w * w, 2.0 * damping * w);
    let size = stiff * stiff + loss * loss;
    (stiff / size - 1.0, -loss / size)
}

/// The series behind a low-pass less the series itself, and its slope.
///
/// A line of order m is multiplied by the gain g at `w = m * rate`; of
/// `A cos + B sin = Re (A - jB) exp(j m x)` there remains the part `g - 1`.
fn filtered(series: &HarmonicSeries, rate: f64, damping: Option<f64>, x: f64) -> (f64, f64) {
    let period: Period = series.period();
    let (mut sum, mut slope) = (0.0, 0.0);
    for shaft in series.shafts() {
        let phase = period.phase(x, shaft.cycles);
        let unit = TAU * shaft.cycles / period.value();
        for (i, &order) in shaft.orders.iter().enumerate() {
            let k = f64::from(order);
            let (sine, cosine) = sin_cos_turns(Period::harmonic(phase, k));
            let w = k * shaft.cycles * rate;
            let (real, imaginary) = change(w, damping);
            let (a, b) = (shaft.cosine[i], shaft.sine[i]);
            // (A - jB)(real + j imaginary) as new coefficients.
            let (a, b) = (a * real + b * imaginary, b * real - a * imaginary);
            sum += a * cosine + b * sine;
            slope += unit * k * (b * cosine - a * sine);
        }
    }
    (sum, slope)
}
