//! Forms made ready: what each adds to the readings of a block, a pass for each.

use std::f64::consts::TAU;

use super::block::{Given, Rows, Work};
use super::exponential::exp;
use super::form::{Form, Line};
use super::lines::{Lines, shafts};
use super::lowpass::LowPass;
use super::signals::Signal;
use crate::angle::Period;
use crate::error::Error;
use crate::kernel::{InstructionSet, Wave};
use crate::series::{HarmonicSeries, Shaft};

/// Part of a period that the last step of a search is below where its bound of the second
/// derivative is to be relied on.
pub(super) const NEAR: f64 = 2.5e-5;

/// Part of a period from a kink within which there is no such bound.
pub(super) const KINK: f64 = 4.0 * NEAR;

/// A form that knows no past: what it adds whatever the angle, and what depends on it.
#[derive(Debug)]
pub(super) enum Smooth {
    Scaled {
        signal: Signal,
        origin: f64,
        absolute: bool,
        level: f64,
        lines: Option<Lines>,
    },
    Spring {
        signal: Signal,
        spring: Spring,
        /// `sin(x - gravity)`, in turns.
        moment: Option<Lines>,
        period: f64,
    },
    Filter(LowPass),
    Bump {
        set: InstructionSet,
        period: Period,
        /// In turns.
        centre: f64,
        width: f64,
        height: f64,
        cycles: f64,
    },
    Ramp {
        slope: f64,
        start: f64,
        stop: f64,
        /// As far as this from its ends it is straight.
        near: f64,
    },
}

/// Wind-up by a load.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spring {
    linear: f64,
    cubic: f64,
    beyond: f64,
    knee: f64,
}

impl Spring {
    /// Wind-up under the moment `m`, and its slope by `m`.
    #[inline(always)]
    fn bent(self, m: f64) -> (f64, f64) {
        let over = m.abs() - self.knee;
        let past = if over > 0.0 { over.copysign(m) } else { 0.0 };
        let bend = if over > 0.0 { self.beyond } else { 0.0 };
        (
            self.linear * m + self.cubic * m * m * m + self.beyond * past,
            self.linear + 3.0 * self.cubic * m * m + bend,
        )
    }
}

impl Smooth {
    /// `None` for the forms of travel and delay; `near` is an angle that steps of a search
    /// are below before its last one.
    pub(super) fn new(
        form: &Form,
        series: &HarmonicSeries,
        near: f64,
    ) -> Result<Option<Self>, Error> {
        let turn = series.period();
        let period = turn.value();
        Ok(Some(match *form {
            Form::Play { .. } | Form::Friction { .. } | Form::Lag { .. } => return Ok(None),
            Form::Filter { frequency, damping } => {
                Self::Filter(LowPass::new(series, frequency, damping))
            }
            Form::Scaled {
                signal,
                origin,
                absolute,
                level,
                relative,
                ref lines,
            } => {
                let mut all = shafts(lines);
                if relative != 0.0 {
                    all.extend(series.shafts().iter().map(|shaft| Shaft {
                        cosine: shaft.cosine.iter().map(|a| relative * a).collect(),
                        sine: shaft.sine.iter().map(|b| relative * b).collect(),
                        ..shaft.clone()
                    }));
                }
                let lines = match all.is_empty() {
                    true => None,
                    false => Some(Lines::new(period, all)?),
                };
                Self::Scaled {
                    signal,
                    origin,
                    absolute,
                    level,
                    lines,
                }
            }
            Form::Spring {
                signal,
                linear,
                cubic,
                beyond,
                knee,
                gravity,
            } => {
                let moment = gravity.map(|gravity| {
                    let (sine, cosine) = crate::angle::sin_cos_turns(turn.phase(gravity, 1.0));
                    let line = Line {
                        order: 1.0,
                        cosine: -sine * period,
                        sine: cosine * period,
                    };
                    Lines::new(period, shafts(&[line]))
                });
                Self::Spring {
                    signal,
                    spring: Spring {
                        linear,
                        cubic,
                        beyond,
                        knee,
                    },
                    moment: moment.transpose()?,
                    period,
                }
            }
            Form::Bump {
                place,
                width,
                height,
                cycles,
            } => Self::Bump {
                set: InstructionSet::best(),
                period: turn,
                centre: turn.wrap(place) / period,
                width,
                height,
                cycles,
            },
            Form::Ramp { slope, start, stop } => Self::Ramp {
                slope,
                start,
                stop,
                near,
            },
        }))
    }

    /// True when the form differs from angle to angle.
    pub(super) fn is_shaped(&self) -> bool {
        match self {
            Self::Scaled { lines, .. } => lines.is_some(),
            Self::Spring { moment, .. } => moment.is_some(),
            Self::Filter(..) | Self::Bump { .. } | Self::Ramp { .. } => true,
        }
    }

    /// Adds what it is at every angle.
    #[inline(always)]
    pub(super) fn add_level<const N: usize>(&self, signals: &Given<N>, level: &mut [f64]) {
        match *self {
            Self::Scaled {
                signal,
                origin,
                absolute,
                level: per_unit,
                ..
            } if per_unit != 0.0 => {
                let values = &signals.of(signal)[..level.len()];
                for i in 0..level.len() {
                    level[i] += per_unit * factor(values[i], origin, absolute);
                }
            }
            Self::Spring {
                signal,
                spring,
                moment: None,
                ..
            } => {
                let values = &signals.of(signal)[..level.len()];
                for i in 0..level.len() {
                    level[i] += spring.bent(values[i]).0;
                }
            }
            _ => {}
        }
    }

    /// Adds to `work` what it is at angles `x` beyond the level, and where `STEEP` its
    /// slope and a bound of its second derivative as far as the search goes.
    #[inline(always)]
    pub(super) fn add_shape<const N: usize>(
        &self,
        signals: &Given<N>,
        x: &[f64],
        steep: bool,
        work: &mut Work<N>,
    ) {
        let n = x.len();
        match *self {
            Self::Scaled {
                signal,
                origin,
                absolute,
                lines: Some(ref lines),
                ..
            } => {
                let values = &signals.of(signal)[..n];
                let factors = work.rows(n).factor;
                for i in 0..n {
                    factors[i] = factor(values[i], origin, absolute);
                }
                work.add_lines(lines, x, steep);
            }
            Self::Spring {
                signal,
                spring,
                moment: Some(ref moment),
                period,
            } => {
                let loads = &signals.of(signal)[..n];
                let Rows {
                    error,
                    slope,
                    bend,
                    value,
                    rise,
                    ..
                } = work.rows(n);
                moment.values(x, value);
                if steep {
                    moment.slopes(x, rise);
                }
                let (one, rate) = (1.0 / period, TAU / period);
                for i in 0..n {
                    let (more, steeper) = spring.bent(loads[i] * (value[i] * one));
                    error[i] += more;
                    if steep {
                        slope[i] += steeper * loads[i] * (rise[i] * one);
                        let load = loads[i].abs();
                        let most = spring.linear.abs() + 9.0 * spring.cubic.abs() * load * load;
                        bend[i] += most * load * rate * rate;
                    }
                }
                if steep && spring.beyond != 0.0 {
                    // It bends at once at the knee.
                    bend.fill(f64::INFINITY);
                }
            }
            Self::Filter(ref filter) => {
                filter.add(signals.of(Signal::Velocity), x, steep, work);
            }
            Self::Bump {
                set,
                period,
                centre,
                width,
                height,
                cycles,
            } => {
                let wave = Wave {
                    period,
                    cycles,
                    order: 1.0,
                    x,
                };
                let Rows {
                    error,
                    slope,
                    bend,
                    value,
                    ..
                } = work.rows(n);
                wave.phases(set, value);
                let turn = period.value();
                let (per_width, rate) = (turn / width, cycles / width);
                for i in 0..n {
                    let away = value[i] - centre;
                    let whole = if away > 0.5 { 1.0 } else { 0.0 };
                    let whole = if away <= -0.5 { -1.0 } else { whole };
                    let away = (away - whole) * per_width;
                    let more = height * exp(-0.5 * away * away);
                    error[i] += more;
                    if steep {
                        slope[i] -= more * away * rate;
                        bend[i] += height.abs() * rate * rate;
                    }
                }
            }
            Self::Ramp {
                slope,
                start,
                stop,
                near,
            } => {
                let rows = work.rows(n);
                let (errors, slopes, bends) = (rows.error, rows.slope, rows.bend);
                let middle = 0.5 * (start + stop);
                for i in 0..n {
                    let held = if x[i] < start { start } else { x[i] };
                    let held = if held > stop { stop } else { held };
                    errors[i] += slope * (held - middle);
                    if steep {
                        let inside = start <= x[i] && x[i] <= stop;
                        slopes[i] += if inside { slope } else { 0.0 };
                        let away = (x[i] - start).abs().min((x[i] - stop).abs());
                        bends[i] += if away > near { 0.0 } else { f64::INFINITY };
                    }
                }
            }
            _ => {}
        }
    }
}

impl<const N: usize> Work<N> {
    /// Adds lines times `factor`.
    #[inline(always)]
    pub(super) fn add_lines(&mut self, lines: &Lines, x: &[f64], steep: bool) {
        let n = x.len();
        let Rows {
            error,
            slope,
            bend,
            factor,
            value,
            rise,
            ..
        } = self.rows(n);
        lines.values(x, value);
        for i in 0..n {
            error[i] += factor[i] * value[i];
        }
        if steep {
            lines.slopes(x, rise);
            for i in 0..n {
                slope[i] += factor[i] * rise[i];
                bend[i] += factor[i].abs() * lines.bend;
            }
        }
    }
}

/// What a signal counts for.
#[inline(always)]
fn factor(value: f64, origin: f64, absolute: bool) -> f64 {
    let factor = value - origin;
    if absolute { factor.abs() } else { factor }
}
