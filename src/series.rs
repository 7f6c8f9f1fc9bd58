//! The harmonic series of an angle error, over one or more shafts.

use std::f64::consts::{PI, TAU};

use rustfft::FftPlanner;
use rustfft::num_complex::Complex64;

use crate::angle::{Period, sin_cos_turns};
use crate::check::finite;
use crate::error::Error;

/// Most cycles of a harmonic per output turn, far beyond what any encoder resolves: up to
/// here phases are exact at any angle.
pub const MOST_CYCLES: f64 = 1e9;

/// Slowest shaft, in turns per output turn.
const LEAST_CYCLES: f64 = 1e-9;

/// Most harmonics of a series: an exact evaluation takes a nanosecond for each.
pub const MOST_LINES: usize = 1 << 16;

/// Greatest constant and coefficient, in turns: sums of them neither overflow nor lose
/// the angle they are added to.
const MOST_TURNS: f64 = 1e9;

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
        within_turns("constant", &[constant], period)?;
        let lines = shafts.iter().map(|shaft| shaft.orders.len()).sum::<usize>();
        if lines > MOST_LINES {
            return Err(Error::Limit {
                what: "the number of orders of all shafts".into(),
                most: MOST_LINES as f64,
                got: lines as f64,
            });
        }
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
                within_turns(what, values, period)?;
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
        self.shafts.iter().flat_map(shaft_lines)
    }

    /// An upper bound of `|d^2 error / dx^2|` over all angles: the sum of `(k f)^2 C_k`.
    pub fn bend_bound(&self) -> f64 {
        let rate = TAU / self.period.value();
        let bends = self
            .lines()
            .map(|line| (rate * line.order).powi(2) * line.amplitude());
        bends.sum()
    }

    /// An upper bound of `|d error / dx|` over all angles.
    ///
    /// Cheap first: `sum of k f C_k`. Where that reaches 1 the slope is sampled on a
    /// grid over each shaft's own turn (over the output turn when all cycles are
    /// whole) and the samples are raised by Bernstein's `1 / cos(pi K / n)`, which a
    /// trigonometric polynomial of degree K cannot exceed between n samples. Orders too
    /// high for a grid count by their sum: the bound holds whatever it costs.
    pub fn slope_bound(&self) -> f64 {
        let rate = TAU / self.period.value();
        let steepness = |line: &Line| rate * line.order * line.amplitude();
        let sum: f64 = self.lines().map(|line| steepness(&line)).sum();
        if sum < 1.0 {
            return sum;
        }
        let sampled: f64 = if self.is_periodic() {
            sampled_slope(
                self.lines()
                    .map(|line| (line.order, rate * line.order, line)),
            )
        } else {
            let of_shaft = |shaft: &Shaft| {
                let orders = shaft.orders.iter().map(|&order| f64::from(order));
                let lines = orders.zip(shaft_lines(shaft));
                sampled_slope(lines.map(|(order, line)| (order, rate * line.order, line)))
            };
            self.shafts.iter().map(of_shaft).sum()
        };
        sum.min(sampled)
    }
}

fn shaft_lines(shaft: &Shaft) -> impl Iterator<Item = Line> + '_ {
    let coefficients = shaft.cosine.iter().zip(&shaft.sine);
    let lines = shaft.orders.iter().zip(coefficients);
    lines.map(|(&order, (&cosine, &sine))| Line {
        order: f64::from(order) * shaft.cycles,
        cosine,
        sine,
    })
}

/// Greatest slope of harmonics on a grid over the turn in which they are whole, raised to
/// a bound; each is its order in that turn, its slope per amplitude, and itself.
fn sampled_slope(harmonics: impl Iterator<Item = (f64, f64, Line)>) -> f64 {
    /// Samples per period of the highest order; the bound is 1/cos(pi/32) = 1.005 wide.
    const SAMPLES_PER_PERIOD: usize = 32;
    /// Most samples of a grid, 50 ms of work: up to order 32768.
    const MOST_SAMPLES: usize = 1 << 20;
    /// Rounding of the transform, of the sum of what is transformed.
    const ROUNDING: f64 = 1e-14;
    let harmonics: Vec<_> = harmonics.filter(|(order, ..)| *order > 0.0).collect();
    // Orders with a common factor repeat that often in the turn: one time will do.
    let factor = harmonics
        .iter()
        .fold(0, |factor, (order, ..)| {
            common_factor(factor, *order as u64)
        })
        .max(1);
    let index = |order: f64| (order as u64 / factor) as usize;
    let highest = MOST_SAMPLES / SAMPLES_PER_PERIOD;
    let degree = harmonics
        .iter()
        .map(|(order, ..)| index(*order))
        .filter(|&k| k <= highest)
        .max();
    let samples = SAMPLES_PER_PERIOD * degree.unwrap_or(0).next_power_of_two();
    let mut spectrum = Vec::new();
    if degree.is_none() || spectrum.try_reserve_exact(samples).is_err() {
        return harmonics
            .iter()
            .map(|(_, rate, line)| rate * line.amplitude())
            .sum();
    }
    spectrum.resize(samples, Complex64::ZERO);
    let (mut sum, mut beyond) = (0.0, 0.0);
    for (order, rate, line) in &harmonics {
        let k = index(*order);
        if k <= highest {
            // The slope is the real part of k (B + iA) exp(i k x).
            spectrum[k] += Complex64::new(rate * line.sine, rate * line.cosine);
            sum += rate * line.amplitude();
        } else {
            beyond += rate * line.amplitude();
        }
    }
    FftPlanner::new()
        .plan_fft_inverse(samples)
        .process(&mut spectrum);
    let greatest = spectrum
        .iter()
        .map(|slope| slope.re.abs())
        .fold(0.0, f64::max);
    let between = (PI * degree.unwrap_or(0) as f64 / samples as f64).cos();
    (greatest + ROUNDING * sum) / between + beyond
}

/// Greatest common divisor; that of 0 and a number is the number.
fn common_factor(mut a: u64, mut b: u64) -> u64 {
    while b > 0 {
        (a, b) = (b, a % b);
    }
    a
}

/// Checks the frequencies of one shaft.
pub fn check_frequencies(shaft: usize, cycles: f64, orders: &[u32]) -> Result<(), Error> {
    if !(LEAST_CYCLES..=MOST_CYCLES).contains(&cycles) {
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
    let fastest = f64::from(previous) * cycles;
    if fastest > MOST_CYCLES {
        return Err(Error::Limit {
            what: format!("order times cycles_per_turn of shaft {shaft} (here order {previous})"),
            most: MOST_CYCLES,
            got: fastest,
        });
    }
    Ok(())
}

/// That every number is finite and within so many turns that it can be added to an angle.
fn within_turns(what: &'static str, values: &[f64], period: Period) -> Result<(), Error> {
    finite(what, values)?;
    let most = MOST_TURNS * period.value();
    match values.iter().position(|value| value.abs() > most) {
        Some(index) => Err(Error::Limit {
            what: format!("the size of {what}[{index}]"),
            most,
            got: values[index].abs(),
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

    #[inline(always)]
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
    #[inline(always)]
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
