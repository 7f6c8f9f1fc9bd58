//! Passes over a few angles, or one, for what goes over a block several times.

use std::sync::Arc;

use super::exact::{Exact, FAR_TURNS};
use super::sincos::{Phase, sin_cos};
use super::{Batch, Evaluator, Quantity, Scalar, Table};
use crate::angle::Period;
use crate::simd::{InstructionSet, Kernel, Lanes, MOST_LANES, dispatch_any};

/// A quantity of a series at some angles: of each the same, to the last bit, whether it is
/// alone or in a block.
#[derive(Debug)]
pub(crate) enum Pass {
    /// By a table: the errors, or the angles less what they are off.
    Values(Arc<Table>, Scalar, InstructionSet),
    Subtract(Arc<Table>, Scalar, InstructionSet),
    /// Without one.
    Exact(Exact, InstructionSet),
    Newton(Arc<Evaluator>),
}

impl Pass {
    /// Makes the table.
    pub fn new(evaluator: &Arc<Evaluator>, quantity: Quantity) -> Self {
        let set = evaluator.best;
        match (evaluator.table(quantity).map(Arc::clone), quantity) {
            (Some(table), Quantity::Correction) => {
                Self::Subtract(table, Table::scalar_subtract(set), set)
            }
            (Some(table), _) => Self::Values(table, Table::scalar_value(set), set),
            (None, Quantity::Correction) => Self::Newton(Arc::clone(evaluator)),
            (None, _) => Self::Exact(evaluator.exact_error.clone(), set),
        }
    }

    /// It at each of some angles.
    pub fn run(&self, x: &[f64], out: &mut [f64]) {
        if let (Self::Values(table, one, _) | Self::Subtract(table, one, _), [x]) = (self, x) {
            // SAFETY: the function was chosen for this processor.
            return out[0] = unsafe { one(table, *x) };
        }
        let batch = Batch::apart(x, out).expect("slices of one block are equally long");
        match self {
            Self::Values(table, _, set) => table.values(*set, batch),
            Self::Subtract(table, _, set) => table.subtract(*set, batch),
            Self::Exact(exact, set) => exact.run(*set, batch),
            Self::Newton(evaluator) => evaluator.correct_exactly(evaluator.best, batch),
        }
    }
}

/// An order of a shaft at some angles, whose number is one or a multiple of the lanes.
pub(crate) struct Wave<'a> {
    pub period: Period,
    pub cycles: f64,
    pub order: f64,
    pub x: &'a [f64],
}

impl Wave<'_> {
    /// Its phases, in parts of its own turn around zero.
    pub fn phases(&self, set: InstructionSet, out: &mut [f64]) {
        self.run(set, |wave| Phases { wave, out });
    }

    /// Its sines and cosines.
    pub fn sines(&self, set: InstructionSet, sine: &mut [f64], cosine: &mut [f64]) {
        self.run(set, |wave| Sines { wave, sine, cosine });
    }

    fn run<'w, K: Kernel>(&'w self, set: InstructionSet, kernel: impl FnOnce(&'w Self) -> K) {
        dispatch_any(set, self.x.len(), kernel(self));
    }

    #[inline(always)]
    fn phase<L: Lanes>(&self, at: usize) -> Phase<L> {
        let mut values = [0.0; MOST_LANES];
        values[..L::N].copy_from_slice(&self.x[at..at + L::N]);
        let (angles, far) = (L::from_array(&values), FAR_TURNS * self.period.value());
        let near = if angles.any_beyond(far) {
            angles.wrap_beyond(far, self.period)
        } else {
            angles
        };
        Phase::new(self.period, near, self.cycles).harmonic(self.order)
    }
}

struct Phases<'a> {
    wave: &'a Wave<'a>,
    out: &'a mut [f64],
}

impl Kernel for Phases<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        for at in (0..self.out.len()).step_by(L::N) {
            store(self.wave.phase::<L>(at).turns(), self.out, at);
        }
    }
}

struct Sines<'a> {
    wave: &'a Wave<'a>,
    sine: &'a mut [f64],
    cosine: &'a mut [f64],
}

impl Kernel for Sines<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        for at in (0..self.sine.len()).step_by(L::N) {
            let (s, c) = sin_cos(self.wave.phase::<L>(at));
            store(s, self.sine, at);
            store(c, self.cosine, at);
        }
    }
}

#[inline(always)]
fn store<L: Lanes>(lanes: L, into: &mut [f64], at: usize) {
    let mut values = [0.0; MOST_LANES];
    lanes.to_array(&mut values);
    into[at..at + L::N].copy_from_slice(&values[..L::N]);
}
