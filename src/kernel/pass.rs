//! Passes over a few angles, for kernels of other rooms.

use super::exact::FAR_TURNS;
use super::sincos::{Phase, sin_cos};
use super::sweep::Map;
use super::{Batch, Evaluator, Quantity};
use crate::angle::Period;
use crate::simd::{Kernel, Lanes, MOST_LANES, dispatch_one};

impl Evaluator {
    /// The error at each of some angles.
    pub(crate) fn errors(&self, x: &[f64], out: &mut [f64]) {
        self.pass(Quantity::Error, x, out);
    }

    /// The true angle behind each of some indicated ones.
    pub(crate) fn corrections(&self, x: &[f64], out: &mut [f64]) {
        self.pass(Quantity::Correction, x, out);
    }

    fn pass(&self, quantity: Quantity, x: &[f64], out: &mut [f64]) {
        let table = self.table(quantity);
        if x.len() == 1 && (table.is_some() || quantity == Quantity::Error) {
            let work = One {
                evaluator: self,
                quantity,
                x,
                out,
            };
            return dispatch_one(self.best, work);
        }
        let batch = Batch::apart(x, out).expect("slices of one block are equally long");
        match (table, quantity) {
            (Some(table), Quantity::Correction) => table.subtract(self.best, batch),
            (Some(table), _) => table.values(self.best, batch),
            (None, Quantity::Correction) => self.correct_exactly(self.best, batch),
            (None, _) => self.exact_error.run(self.best, batch),
        }
    }
}

/// One angle, with what a batch does to it.
struct One<'a> {
    evaluator: &'a Evaluator,
    quantity: Quantity,
    x: &'a [f64],
    out: &'a mut [f64],
}

impl Kernel for One<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let x = load::<L>(self.x, 0);
        let result = match self.evaluator.table(self.quantity) {
            Some(table) if self.quantity == Quantity::Correction => x - table.value(x),
            Some(table) => table.value(x),
            None => (&self.evaluator.exact_error).map([x])[0],
        };
        store(result, self.out, 0);
    }
}

/// The lanes of a slice from `at` on.
#[inline(always)]
fn load<L: Lanes>(from: &[f64], at: usize) -> L {
    let mut values = [0.0; MOST_LANES];
    values[..L::N].copy_from_slice(&from[at..at + L::N]);
    L::from_array(&values)
}

/// Lanes into a slice from `at` on.
#[inline(always)]
fn store<L: Lanes>(lanes: L, into: &mut [f64], at: usize) {
    let mut values = [0.0; MOST_LANES];
    lanes.to_array(&mut values);
    into[at..at + L::N].copy_from_slice(&values[..L::N]);
}

/// Phase of a shaft at each of some angles, as many as a multiple of the lanes, in parts
/// of its own turn around zero.
#[inline(always)]
pub fn phases<L: Lanes>(period: Period, cycles: f64, x: &[f64], out: &mut [f64]) {
    for at in (0..x.len()).step_by(L::N) {
        store(phase::<L>(period, cycles, x, at).turns(), out, at);
    }
}

/// Sine and cosine of an order of a shaft there.
#[inline(always)]
pub fn waves<L: Lanes>(
    period: Period,
    cycles: f64,
    order: f64,
    x: &[f64],
    sine: &mut [f64],
    cosine: &mut [f64],
) {
    for at in (0..x.len()).step_by(L::N) {
        let (s, c) = sin_cos(phase::<L>(period, cycles, x, at).harmonic(order));
        store(s, sine, at);
        store(c, cosine, at);
    }
}

#[inline(always)]
fn phase<L: Lanes>(period: Period, cycles: f64, x: &[f64], at: usize) -> Phase<L> {
    let (angles, far) = (load::<L>(x, at), FAR_TURNS * period.value());
    let near = if angles.any_beyond(far) {
        angles.wrap_beyond(far, period)
    } else {
        angles
    };
    Phase::new(period, near, cycles)
}
