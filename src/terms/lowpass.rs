//! The series behind a low-pass at constant velocity, less the series itself.

use std::f64::consts::TAU;

use super::block::{Rows, Work};
use crate::angle::Period;
use crate::kernel::{InstructionSet, Wave};
use crate::series::{HarmonicSeries, Shaft};

/// Orders between fresh sines and cosines: rounding grows by about 1e-16 per turn of one.
const RESEED: u32 = 32;

/// Missing orders in a row from which fresh ones cost less.
const MOST_GAP: u32 = 3;

/// A low-pass of first order or, with a damping, of second, without a ramp error.
#[derive(Debug)]
pub(super) struct LowPass {
    period: Period,
    shafts: Vec<Shaft>,
    frequency: f64,
    damping: Option<f64>,
    set: InstructionSet,
    /// Bound of the second derivative.
    bend: f64,
}

impl LowPass {
    pub fn new(series: &HarmonicSeries, frequency: f64, damping: Option<f64>) -> Self {
        // What a line is multiplied by is at most the greatest gain and 1.
        let gain = damping.map_or(0.0, |d| 0.5 / (d * (1.0 - (d * d).min(0.5)).sqrt()));
        Self {
            period: series.period(),
            shafts: series.shafts().to_vec(),
            frequency,
            damping,
            set: InstructionSet::best(),
            bend: (1.0 + gain.max(1.0)) * series.bend_bound(),
        }
    }

    /// Adds it at angles `x` and such velocities.
    #[inline(always)]
    pub fn add<const N: usize>(&self, speeds: &[f64], x: &[f64], steep: bool, work: &mut Work<N>) {
        let per_turn = 1.0 / self.period.value();
        let n = x.len();
        let (Rows { factor, bend, .. }, speeds) = (work.rows(n), &speeds[..n]);
        for i in 0..n {
            factor[i] = speeds[i] * per_turn / self.frequency;
            bend[i] += self.bend;
        }
        for shaft in &self.shafts {
            self.add_shaft(shaft, x, steep, work);
        }
    }

    /// Adds the lines of a shaft behind a low-pass less the lines themselves, where
    /// `factor` is turns per second over the frequency of the low-pass.
    ///
    /// A line of order m is multiplied by the gain g at `w = m * factor`; of
    /// `A cos + B sin = Re (A - jB) exp(j m x)` there remains the part `g - 1`.
    #[inline(always)]
    fn add_shaft<const N: usize>(&self, shaft: &Shaft, x: &[f64], steep: bool, work: &mut Work<N>) {
        let n = x.len();
        let Rows {
            error,
            slope,
            factor,
            waves: [sine, cosine, own_sine, own_cosine],
            ..
        } = work.rows(n);
        let wave = |order| Wave {
            period: self.period,
            cycles: shaft.cycles,
            order,
            x,
        };
        wave(1.0).sines(self.set, own_sine, own_cosine);
        let (mut at, mut seeded) = (0, 0);
        let unit = TAU / self.period.value();
        for (j, &order) in shaft.orders.iter().enumerate() {
            if j == 0 || order - at > MOST_GAP || order - seeded >= RESEED {
                wave(f64::from(order)).sines(self.set, sine, cosine);
                (at, seeded) = (order, order);
            }
            while at < order {
                for i in 0..n {
                    let (s, c) = (sine[i], cosine[i]);
                    sine[i] = s * own_cosine[i] + c * own_sine[i];
                    cosine[i] = c * own_cosine[i] - s * own_sine[i];
                }
                at += 1;
            }
            let cycles = f64::from(order) * shaft.cycles;
            let (a, b, rate) = (shaft.cosine[j], shaft.sine[j], unit * cycles);
            for i in 0..n {
                let (real, imaginary) = change(cycles * factor[i], self.damping);
                // (A - jB)(real + j imaginary) as new coefficients.
                let (p, q) = (a * real + b * imaginary, b * real - a * imaginary);
                error[i] += p * cosine[i] + q * sine[i];
                if steep {
                    slope[i] += rate * (q * cosine[i] - p * sine[i]);
                }
            }
        }
    }
}

/// The gain of a low-pass less 1 at `w` times its frequency: real and imaginary part.
///
/// First order: `1/(1 + j w) - 1`; second: `1/(1 - w^2 + 2 j d w) - 1`.
#[inline(always)]
fn change(w: f64, damping: Option<f64>) -> (f64, f64) {
    let Some(damping) = damping else {
        let inverse = 1.0 / (1.0 + w * w);
        return (-w * w * inverse, -w * inverse);
    };
    let (stiff, loss) = (1.0 - w * w, 2.0 * damping * w);
    let inverse = 1.0 / (stiff * stiff + loss * loss);
    (stiff * inverse - 1.0, -loss * inverse)
}
