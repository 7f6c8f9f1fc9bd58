//! The series itself, by one sine and cosine per group of neighbouring orders.
//!
//! With `z = exp(i phi)` a group is `Re exp(i b phi) (c_0 + c_1 z + c_2 z^2 + ...)`,
//! `c = A - iB`: Horner's rule on complex numbers, whose rounding grows with the span of
//! the group only. The phase `b phi` of its lowest order b is reduced exactly, so neither
//! a high order nor a distant angle costs accuracy.

use std::f64::consts::TAU;

use super::lines::vector;
use super::sincos::{Phase, sin_cos};
use super::sweep::{Map, Sweep};
use super::{Batch, Real, Sample};
use crate::angle::Period;
use crate::series::HarmonicSeries;
use crate::simd::{InstructionSet, Kernel, Lanes, MOST_LANES, dispatch_any};

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
        dispatch_any(set, batch.len(), Sweep { map: self, batch });
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
        let [values] = values_of([*self], x);
        values
    }
}

/// Two functions of the same orders at every angle, by the same sines and cosines: each is what
/// [`Exact::run`] has, to the last bit.
pub struct Both<'a> {
    /// The functions, made of one series.
    pub functions: [&'a Exact; 2],
    /// Where.
    pub x: &'a [f64],
    /// Their values there.
    pub out: [&'a mut [f64]; 2],
}

impl Kernel for Both<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        match L::N {
            8 => self.fill::<L, 4>(),
            _ => self.fill::<L, 2>(),
        }
    }
}

impl Both<'_> {
    #[inline(always)]
    fn fill<L: Lanes, const W: usize>(mut self) {
        let (whole, len) = (W * L::N, self.x.len());
        let sides = len - len % whole;
        for start in (0..sides).step_by(whole) {
            self.part::<L, W>(start, L::N);
        }
        for start in (sides..len).step_by(L::N) {
            self.part::<L, 1>(start, L::N.min(len - start));
        }
    }

    /// `W` vectors from `start` on, `some` samples in each.
    #[inline(always)]
    fn part<L: Lanes, const W: usize>(&mut self, start: usize, some: usize) {
        let mut x = [L::splat(0.0); W];
        for w in 0..W {
            x[w] = vector(self.x, start + w * L::N, some);
        }
        let values = values_of(self.functions, x);
        let mut lanes = [0.0; MOST_LANES];
        for f in 0..2 {
            for w in 0..W {
                values[f][w].to_array(&mut lanes);
                let first = start + w * L::N;
                self.out[f][first..first + some].copy_from_slice(&lanes[..some]);
            }
        }
    }
}

/// Functions of the same orders at `W` vectors of angles.
#[inline(always)]
fn values_of<L: Lanes, const W: usize, const F: usize>(
    functions: [&Exact; F],
    x: [L; W],
) -> [[L; W]; F] {
    let first = functions[0];
    let mut angles = x;
    for x in &mut angles {
        let far = FAR_TURNS * first.period.value();
        if x.any_beyond(far) {
            *x = x.wrap_beyond(far, first.period);
        }
    }
    let mut sum = [[L::splat(0.0); W]; F];
    for f in 0..F {
        sum[f] = [L::splat(functions[f].constant); W];
    }
    for (i, shaft) in first.shafts.iter().enumerate() {
        let mut phase = [Phase::splat(0.0); W];
        for w in 0..W {
            phase[w] = Phase::new(first.period, angles[w], shaft.cycles);
        }
        let (mut sine, mut cosine) = ([L::splat(0.0); W], [L::splat(0.0); W]);
        for w in 0..W {
            (sine[w], cosine[w]) = sin_cos(phase[w]);
        }
        for (j, group) in shaft.groups.iter().enumerate() {
            let (mut s, mut c) = (sine, cosine);
            if group.lowest != 1.0 {
                for w in 0..W {
                    (s[w], c[w]) = sin_cos(phase[w].harmonic(group.lowest));
                }
            }
            for f in 0..F {
                let (mut re, mut im) = ([L::splat(0.0); W], [L::splat(0.0); W]);
                for &(a, b) in &functions[f].shafts[i].groups[j].amplitudes {
                    let (a, b) = (L::splat(a), L::splat(b));
                    for w in 0..W {
                        let real = re[w].mul_add(cosine[w], im[w].neg_mul_add(sine[w], a));
                        im[w] = re[w].mul_add(sine[w], im[w].mul_add(cosine[w], b));
                        re[w] = real;
                    }
                }
                for w in 0..W {
                    sum[f][w] = re[w].mul_add(c[w], im[w].neg_mul_add(s[w], sum[f][w]));
                }
            }
        }
    }
    sum
}
