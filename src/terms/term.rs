//! The terms, one variant each: parameters in the unit of the series' period.

use std::f64::consts::TAU;

use super::signals::{Signal, Signals};
use crate::angle::{Period, sin_cos_turns};
use crate::error::Error;
use crate::series::{HarmonicSeries, Shaft};

/// One line `cosine cos(order x) + sine sin(order x)`; `order` counts output turns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Cycles per output turn, any positive real.
    pub order: f64,
    /// Coefficient of the cosine.
    pub cosine: f64,
    /// Coefficient of the sine.
    pub sine: f64,
}

/// An error beyond the harmonics.
#[derive(Clone, Debug, PartialEq)]
pub enum Term {
    /// `half_width * direction`.
    Backlash {
        /// Half of forward minus reverse.
        half_width: f64,
    },
    /// `amplitude * z`, `dz/ds = (direction - z) / length` over travel `s`.
    PreslidingHysteresis {
        /// Half of the reversal error far from the reversal.
        amplitude: f64,
        /// Travel in which it builds up.
        length: f64,
        /// Share of the wind-up that is there at the first motion, 0 to 1.
        start: f64,
    },
    /// The indicated angle is that of `delay` seconds ago.
    Latency {
        /// Seconds.
        delay: f64,
    },
    /// The series low-passed at constant velocity, without a ramp error.
    FilterLag {
        /// Hertz.
        cutoff: f64,
    },
    /// `(temperature - reference) * (zero + pattern * series + lines)`.
    ThermalDrift {
        /// Of the zero, per kelvin.
        zero: f64,
        /// Relative growth of the series without its constant, per kelvin.
        pattern: f64,
        /// Per kelvin.
        lines: Vec<Line>,
        /// Degrees Celsius.
        reference: f64,
    },
    /// `torque * (linear + lines)`.
    TorsionalCompliance {
        /// Per newton metre.
        linear: f64,
        /// Per newton metre.
        lines: Vec<Line>,
    },
    /// `linear m + cubic m^3 + beyond sign(m) max(|m| - knee, 0)` with `m` the torque, or
    /// `torque sin(x - gravity)`.
    StiffeningCompliance {
        /// Per newton metre.
        linear: f64,
        /// Per newton metre cubed.
        cubic: f64,
        /// Per newton metre beyond the knee.
        beyond: f64,
        /// Newton metres.
        knee: f64,
        /// Angle at which a load has no moment.
        gravity: Option<f64>,
    },
    /// `torque * lines` or `|torque| * lines`.
    LoadDependentGearError {
        /// Per newton metre.
        lines: Vec<Line>,
        /// The absolute torque counts.
        absolute: bool,
    },
    /// `height exp(-(a - place)^2 / (2 width^2))` at the angle `a = cycles x` of a shaft.
    LocalDefect {
        /// In units of the period, a turn of the shaft.
        place: f64,
        /// One standard deviation, likewise.
        width: f64,
        /// Error at the place.
        height: f64,
        /// Turns of the shaft per output turn.
        cycles: f64,
    },
}

impl Term {
    /// Its name in model files.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Backlash { .. } => "backlash",
            Self::PreslidingHysteresis { .. } => "presliding_hysteresis",
            Self::Latency { .. } => "latency",
            Self::FilterLag { .. } => "filter_lag",
            Self::ThermalDrift { .. } => "thermal_drift",
            Self::TorsionalCompliance { .. } => "torsional_compliance",
            Self::StiffeningCompliance { .. } => "stiffening_compliance",
            Self::LoadDependentGearError { .. } => "load_dependent_gear_error",
            Self::LocalDefect { .. } => "local_defect",
        }
    }

    /// The signal without which it cannot be computed.
    ///
    /// Travel is seen in the angle itself, except where play is negative: the angle
    /// then does not tell the two directions apart.
    pub fn needs(&self) -> Option<Signal> {
        match self {
            Self::Backlash { half_width } => (*half_width < 0.0).then_some(Signal::Direction),
            Self::PreslidingHysteresis { .. } | Self::LocalDefect { .. } => None,
            Self::Latency { .. } | Self::FilterLag { .. } => Some(Signal::Velocity),
            Self::ThermalDrift { .. } => Some(Signal::Temperature),
            Self::TorsionalCompliance { .. }
            | Self::StiffeningCompliance { .. }
            | Self::LoadDependentGearError { .. } => Some(Signal::Torque),
        }
    }
}

/// A term made ready: what it adds whatever the angle, and what depends on the angle.
#[derive(Clone, Debug)]
pub(super) enum Smooth {
    /// `(signal - origin) * (level + relative * series + lines)`.
    Scaled {
        signal: Signal,
        origin: f64,
        absolute: bool,
        level: f64,
        relative: f64,
        lines: Option<HarmonicSeries>,
    },
    Spring {
        linear: f64,
        cubic: f64,
        beyond: f64,
        knee: f64,
        gravity: Option<f64>,
    },
    Filter {
        cutoff: f64,
    },
    Bump {
        place: f64,
        width: f64,
        height: f64,
        cycles: f64,
    },
}

impl Smooth {
    /// `None` for the terms of travel and delay.
    pub(super) fn new(term: &Term, period: f64) -> Result<Option<Self>, Error> {
        let scaled = |signal, origin, absolute, level, relative, lines: &[Line]| {
            Ok(Some(Self::Scaled {
                signal,
                origin,
                absolute,
                level,
                relative,
                lines: lines_of(lines, period)?,
            }))
        };
        match term {
            Term::Backlash { .. } | Term::PreslidingHysteresis { .. } | Term::Latency { .. } => {
                Ok(None)
            }
            Term::FilterLag { cutoff } => Ok(Some(Self::Filter { cutoff: *cutoff })),
            Term::ThermalDrift {
                zero,
                pattern,
                lines,
                reference,
            } => scaled(
                Signal::Temperature,
                *reference,
                false,
                *zero,
                *pattern,
                lines,
            ),
            Term::TorsionalCompliance { linear, lines } => {
                scaled(Signal::Torque, 0.0, false, *linear, 0.0, lines)
            }
            Term::LoadDependentGearError { lines, absolute } => {
                scaled(Signal::Torque, 0.0, *absolute, 0.0, 0.0, lines)
            }
            Term::StiffeningCompliance {
                linear,
                cubic,
                beyond,
                knee,
                gravity,
            } => Ok(Some(Self::Spring {
                linear: *linear,
                cubic: *cubic,
                beyond: *beyond,
                knee: *knee,
                gravity: *gravity,
            })),
            Term::LocalDefect {
                place,
                width,
                height,
                cycles,
            } => Ok(Some(Self::Bump {
                place: *place,
                width: *width,
                height: *height,
                cycles: *cycles,
            })),
        }
    }

    /// True when the term differs from angle to angle.
    pub(super) fn is_shaped(&self) -> bool {
        match self {
            Self::Scaled {
                relative, lines, ..
            } => *relative != 0.0 || lines.is_some(),
            Self::Spring { gravity, .. } => gravity.is_some(),
            Self::Filter { .. } | Self::Bump { .. } => true,
        }
    }

    /// What it adds at every angle.
    pub(super) fn level(&self, signals: &Signals) -> f64 {
        match self {
            Self::Scaled { level, .. } if *level == 0.0 => 0.0,
            Self::Scaled { level, .. } => level * self.factor(signals),
            Self::Spring {
                gravity: None,
                linear,
                cubic,
                beyond,
                knee,
            } => {
                let torque = value(signals, Signal::Torque);
                spring(torque, *linear, *cubic, *beyond, *knee).0
            }
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
                gravity: Some(gravity),
                linear,
                cubic,
                beyond,
                knee,
            } => {
                let period = series.period();
                let (sine, cosine) = sin_cos_turns(period.phase(x - gravity, 1.0));
                let torque = value(signals, Signal::Torque);
                let (sum, slope) = spring(torque * sine, *linear, *cubic, *beyond, *knee);
                (sum, slope * torque * cosine * TAU / period.value())
            }
            Self::Spring { .. } => (0.0, 0.0),
            Self::Filter { cutoff } => {
                let turns_per_second = value(signals, Signal::Velocity) / series.period().value();
                filtered(series, turns_per_second / cutoff, x)
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

fn lines_of(lines: &[Line], period: f64) -> Result<Option<HarmonicSeries>, Error> {
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

/// The series behind a first-order low-pass less the series itself, and its slope.
///
/// A line of order m is multiplied by `g = 1/(1 + j w)`, `w = m * rate`; of
/// `A cos + B sin = Re (A - jB) exp(j m x)` there remains the part
/// `g - 1 = -j w (1 - j w)/(1 + w^2)`.
fn filtered(series: &HarmonicSeries, rate: f64, x: f64) -> (f64, f64) {
    let period: Period = series.period();
    let (mut sum, mut slope) = (0.0, 0.0);
    for shaft in series.shafts() {
        let phase = period.phase(x, shaft.cycles);
        let unit = TAU * shaft.cycles / period.value();
        for (i, &order) in shaft.orders.iter().enumerate() {
            let k = f64::from(order);
            let (sine, cosine) = sin_cos_turns(Period::harmonic(phase, k));
            let w = k * shaft.cycles * rate;
            let (real, imaginary) = (-w * w / (1.0 + w * w), -w / (1.0 + w * w));
            let (a, b) = (shaft.cosine[i], shaft.sine[i]);
            // (A - jB)(real + j imaginary) as new coefficients.
            let (a, b) = (a * real + b * imaginary, b * real - a * imaginary);
            sum += a * cosine + b * sine;
            slope += unit * k * (b * cosine - a * sine);
        }
    }
    (sum, slope)
}
