//! The series itself, by one sine and cosine per group of neighbouring orders.
//!
//! With `z = exp(i phi)` a group is `Re exp(i b phi) (c_0 + c_1 z + c_2 z^2 + ...)`,
//! `c = A - iB`: Horner's rule on complex numbers, whose rounding grows with the span of
//! the group only. The phase `b phi` of its lowest order b is reduced exactly, so neither
//! a high order nor a distant angle costs accuracy.

use std::f64::consts::TAU;

use super::sincos::{Phase, sin_cos};
use super::sweep::{Map, Sweep};
use super::{Batch, Real, Sample};
use crate::angle::Period;
use crate::series::HarmonicSeries;
use crate::simd::{InstructionSet, Lanes, dispatch};

/// Orders a group may span above its lowest: 16 steps of Horner's rule lose about 1e-15.
const MOST_SPAN: u32 = 16;

/// Missing orders in a row that cost less than a sine and cosine of their own.
const MOST_GAP: u32 = 6;

/// Turns an angle may be away from zero; beyond, doubles carry no place within a turn.
pub(super) const FAR_TURNS: f64 = (1u64 << 50) as f64;

/// A series, or its derivative, made ready for vectors.
#[derive(Clone, Debug)]
pub struct Exact {
    period: Period,
    constant: f64,
    shafts: Vec<Frequencies>,
}

#[derive(Clone, Debug)]
struct Frequencies {
    cycles: f64,
    groups: Vec<Group>,
}

/// Orders `lowest..` with their complex amplitudes, the highest first.
#[derive(Clone, Debug)]
struct Group {
    lowest: f64,
    amplitudes: Vec<(f64, f64)>,
}

impl Exact {
    /// `error(x)`.
    pub fn error(series: &HarmonicSeries) -> Self {
        Self::new(series, series.constant(), |_, a, b| (a, -b))
    }

    /// `d error / dx`.
    pub fn slope(series: &HarmonicSeries) -> Self {
        let rate = TAU / series.period().value();
        Self::new(series, 0.0, |k, a, b| (rate * k * b, rate * k * a))
    }

    /// Its values at every sample of a batch.
    pub fn run<X: Sample, Y: Real>(&self, set: InstructionSet, batch: Batch<'_, X, Y>) {
        dispatch(set, Sweep { map: self, batch });
    }

    fn new(
        series: &HarmonicSeries,
        constant: f64,
        amplitude: impl Fn(f64, f64, f64) -> (f64, f64),
    ) -> Self {
        let shafts = series.shafts().iter().filter(|s| !s.orders.is_empty());
        let shafts = shafts.map(|shaft| {
            let lines = shaft
                .orders
                .iter()
                .zip(shaft.cosine.iter().zip(&shaft.sine));
            Frequencies {
                cycles: shaft.cycles,
                groups: groups(lines.map(|(&order, (&a, &b))| {
                    (order, amplitude(f64::from(order) * shaft.cycles, a, b))
                })),
            }
        });
        Self {
            period: series.period(),
            constant,
            shafts: shafts.collect(),
        }
    }
}

/// Splits increasing orders where it is cheaper or more accurate to start afresh.
fn groups(lines: impl Iterator<Item = (u32, (f64, f64))>) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    let (mut lowest, mut highest) = (0, 0);
    for (order, amplitude) in lines {
        match groups.last_mut() {
            Some(group) if order - lowest <= MOST_SPAN && order - highest <= MOST_GAP + 1 => {
                for _ in highest + 1..order {
                    group.amplitudes.push((0.0, 0.0));
                }
                group.amplitudes.push(amplitude);
            }
            _ => {
                lowest = order;
                groups.push(Group {
                    lowest: f64::from(order),
                    amplitudes: vec![amplitude],
                });
            }
        }
        highest = order;
    }
    for group in &mut groups {
        group.amplitudes.reverse();
    }
    groups
}

impl Map for &Exact {
    const SIDE_BY_SIDE: bool = true;

    #[inline(always)]
    fn map<L: Lanes, const W: usize>(&self, x: [L; W]) -> [L; W] {
        let mut angles = x;
        for x in &mut angles {
            let far = FAR_TURNS * self.period.value();
            if x.any_beyond(far) {
                *x = x.wrap_beyond(far, self.period);
            }
        }
        let mut sum = [L::splat(self.constant); W];
        for shaft in &self.shafts {
            let mut phase = [Phase::splat(0.0); W];
            for w in 0..W {
                phase[w] = Phase::new(self.period, angles[w], shaft.cycles);
            }
            let (mut sine, mut cosine) = ([L::splat(0.0); W], [L::splat(0.0); W]);
            for w in 0..W {
                (sine[w], cosine[w]) = sin_cos(phase[w]);
            }
            for group in &shaft.groups {
                let (mut re, mut im) = ([L::splat(0.0); W], [L::splat(0.0); W]);
                for &(a, b) in &group.amplitudes {
                    let (a, b) = (L::splat(a), L::splat(b));
                    for w in 0..W {
                        let real = re[w].mul_add(cosine[w], im[w].neg_mul_add(sine[w], a));
                        im[w] = re[w].mul_add(sine[w], im[w].mul_add(cosine[w], b));
                        re[w] = real;
                    }
                }
                for w in 0..W {
                    let (s, c) = if group.lowest == 1.0 {
                        (sine[w], cosine[w])
                    } else {
                        sin_cos(phase[w].harmonic(group.lowest))
                    };
                    sum[w] = re[w].mul_add(c, im[w].neg_mul_add(s, sum[w]));
                }
            }
        }
        sum
    }
}
