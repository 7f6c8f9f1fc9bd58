//! The harmonic series of an angle error, over one or more shafts.

use std::f64::consts::TAU;

use crate::angle::{Period, sin_cos_turns};
use crate::error::Error;

/// Harmonics of one shaft: order `k` is the output order `k * cycles`.
#[derive(Clone, Debug, PartialEq)]
pub struct Shaft {
    /// Turns of this shaft per output turn; any positive real.
    pub cycles: f64,
    /// Orders from 1, strictly increasing.
    pub orders: Vec<u32>,
    /// `A_k`, one per order.
    pub cosine: Vec<f64>,
    /// `B_k`, one per order.
    pub sine: Vec<f64>,
}

/// One harmonic: `A cos(k x) + B sin(k x)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Cycles per output turn.
    pub order: f64,
    /// `A`.
    pub cosine: f64,
    /// `B`.
    pub sine: f64,
}

impl Line {
    /// `hypot(A, B)`.
    pub fn amplitude(self) -> f64 {
        self.cosine.hypot(self.sine)
    }
}

/// `error(x) = C0 + sum over shafts and orders of A cos(k f x) + B sin(k f x)`.
///
/// `x`, `C0`, `A` and `B` are in one unit, whose turn is `period`; the argument of
/// the cosine is `2 pi k f x / period`.
#[derive(Clone, Debug, PartialEq)]
pub struct HarmonicSeries {
    period: Period,
    constant: f64,
    shafts: Vec<Shaft>,
}

impl HarmonicSeries {
    /// Checks every number; shafts without orders are allowed and cost nothing.
    pub fn new(period: f64, constant: f64, shafts: Vec<Shaft>) -> Result<Self, Error> {
        let period = Period::new(period)?;
        finite("constant", &[constant])?;
        for (index, shaft) in shafts.iter().enumerate() {
            check_frequencies(index, shaft.cycles, &shaft.orders)?;
            for (what, values) in [("cosine", &shaft.cosine), ("sine", &shaft.sine)] {
                if values.len() != shaft.orders.len() {
                    return Err(Error::Length {
                        what,
                        got: values.len(),
                        other: "orders",
                        wanted: shaft.orders.len(),
                    });
                }
                finite(what, values)?;
            }
        }
        Ok(Self {
            period,
            constant,
            shafts,
        })
    }

    /// One turn of the argument.
    pub fn period(&self) -> Period {
        self.period
    }

    /// `C0`.
    pub fn constant(&self) -> f64 {
        self.constant
    }

    /// The same series with `C0 = 0`.
    pub fn without_constant(&self) -> Self {
        Self {
            constant: 0.0,
            ..self.clone()
        }
    }

    /// The shafts, in the order given.
    pub fn shafts(&self) -> &[Shaft] {
        &self.shafts
    }

    /// `error(x)` and `d error / dx` by a rotation over the orders, from one sine and
    /// cosine per shaft.
    pub fn evaluate(&self, x: f64) -> (f64, f64) {
        let mut value = self.constant;
        let mut slope = 0.0;
        for shaft in &self.shafts {
            let phase = self.period.phase(x, shaft.cycles);
            let rate = TAU * shaft.cycles / self.period.value();
            let mut rotation = Rotation::new(phase);
            for (i, &order) in shaft.orders.iter().enumerate() {
                let (sine, cosine) = rotation.advance(order);
                let (a, b) = (shaft.cosine[i], shaft.sine[i]);
                value += a * cosine + b * sine;
                slope += rate * f64::from(order) * (b * cosine - a * sine);
            }
        }
        (value, slope)
    }

    /// True when every shaft turns a whole number of times per turn, so that the
    /// error repeats after one.
    pub fn is_periodic(&self) -> bool {
        self.shafts
            .iter()
            .all(|s| s.orders.is_empty() || s.cycles.fract() == 0.0)
    }

    /// `sum of C_k`: what stated accuracies are relative to.
    pub fn amplitude_sum(&self) -> f64 {
        self.lines().map(|line| line.amplitude()).sum()
    }

    /// Every harmonic by its order of the output, shaft after shaft.
    pub fn lines(&self) -> impl Iterator<Item = Line> + '_ {
        self.shafts.iter().flat_map(|shaft| {
            let coefficients = shaft.cosine.iter().zip(&shaft.sine);
            shaft
                .orders
                .iter()
                .zip(coefficients)
                .map(|(&order, (&cosine, &sine))| Line {
                    order: f64::from(order) * shaft.cycles,
                    cosine,
                    sine,
                })
        })
    }

    /// An upper bound of `|d error / dx|` over all angles.
    ///
    /// Cheap first: `sum of k f C_k`. Where that reaches 1 the slope is sampled on a
    /// grid over each shaft's own turn (over the output turn when all cycles are
    /// whole) and the samples are raised by Bernstein's `1 / cos(pi K / n)`, which a
    /// trigonometric polynomial of degree K cannot exceed between n samples.
    pub fn slope_bound(&self) -> f64 {
        let rate = TAU / self.period.value();
        let sum: f64 = self
            .lines()
            .map(|line| rate * line.order * line.amplitude())
            .sum();
        if sum < 1.0 {
            return sum;
        }
        let sampled: f64 = if self.is_periodic() {
            self.sampled_slope(1.0)
        } else {
            self.shafts
                .iter()
                .map(|shaft| {
                    let alone = Self {
                        period: self.period,
                        constant: 0.0,
                        shafts: vec![shaft.clone()],
                    };
                    alone.sampled_slope(1.0 / shaft.cycles)
                })
                .sum()
        };
        sum.min(sampled)
    }

    /// Greatest slope on a grid over `turns` of the output, raised to a bound.
    fn sampled_slope(&self, turns: f64) -> f64 {
        /// Samples per period of the highest order; the bound is 1/cos(pi/32) = 1.005 wide.
        const SAMPLES_PER_PERIOD: f64 = 32.0;
        let degree = self
            .lines()
            .map(|line| turns * line.order)
            .fold(1.0, f64::max);
        let samples = (SAMPLES_PER_PERIOD * degree).ceil();
        let step = turns * self.period.value() / samples;
        let greatest = (0..samples as usize)
            .map(|i| self.evaluate(i as f64 * step).1.abs())
            .fold(0.0, f64::max);
        greatest / (std::f64::consts::PI * degree / samples).cos()
    }
}

/// Checks the frequencies of one shaft.
pub fn check_frequencies(shaft: usize, cycles: f64, orders: &[u32]) -> Result<(), Error> {
    if !(cycles.is_finite() && cycles > 0.0) {
        return Err(Error::Cycles { shaft, got: cycles });
    }
    let mut previous = 0;
    for &order in orders {
        if order <= previous {
            return Err(Error::Orders {
                shaft,
                previous,
                got: order,
            });
        }
        previous = order;
    }
    Ok(())
}

fn finite(what: &'static str, values: &[f64]) -> Result<(), Error> {
    match values.iter().position(|v| !v.is_finite()) {
        Some(index) => Err(Error::NotFinite {
            what,
            index,
            got: values[index],
        }),
        None => Ok(()),
    }
}

/// `exp(2 pi i k phase)` for increasing orders `k`, by one complex multiplication per
/// step; large gaps and every 32nd order start afresh from an exact phase.
pub(crate) struct Rotation {
    phase: (f64, f64),
    unit: (f64, f64),
    current: (f64, f64),
    order: u32,
    seeded: u32,
}

impl Rotation {
    /// Orders between fresh starts: rounding grows by about 1e-16 per step.
    const RESEED: u32 = 32;

    pub(crate) fn new(phase: (f64, f64)) -> Self {
        let unit = sin_cos_turns(phase);
        Self {
            phase,
            unit,
            current: (0.0, 1.0),
            order: 0,
            seeded: 0,
        }
    }

    /// Sine and cosine of `order` times the phase; `order` must not decrease.
    pub(crate) fn advance(&mut self, order: u32) -> (f64, f64) {
        if order - self.seeded >= Self::RESEED {
            self.current = sin_cos_turns(Period::harmonic(self.phase, f64::from(order)));
            self.order = order;
            self.seeded = order;
        }
        let (unit_sine, unit_cosine) = self.unit;
        while self.order < order {
            let (s, c) = self.current;
            self.current = (
                s * unit_cosine + c * unit_sine,
                c * unit_cosine - s * unit_sine,
            );
            self.order += 1;
        }
        self.current
    }
}
