//! One entry per count of an encoder whose turn is a whole number of counts.

use super::batch::{Batch, Real, Sample};
use super::table::Table;
use crate::simd::InstructionSet;

/// Most counts per turn: 8 MiB of entries.
pub const MOST_COUNTS: f64 = (1u32 << 20) as f64;

/// A periodic function at every count of a turn.
#[derive(Debug)]
pub struct Counts {
    values: Vec<f64>,
}

impl Counts {
    /// Entries are the values of `table`, so that both agree to the last bit.
    pub fn new(table: &Table, set: InstructionSet) -> Self {
        let counts = table.period().value() as u32;
        let mut values: Vec<f64> = (0..counts).map(f64::from).collect();
        table.values(set, Batch::in_place(&mut values));
        Self { values }
    }

    /// Values of the function.
    pub fn values<X: Sample, Y: Real>(&self, mut batch: Batch<'_, X, Y>) {
        batch.map(|x| Y::narrow(self.values[x.place(self.values.len())]));
    }

    /// Counts less the values of the function.
    pub fn subtract<X: Sample, Y: Real>(&self, mut batch: Batch<'_, X, Y>) {
        batch.map(|x| Y::narrow(x.widen() - self.values[x.place(self.values.len())]));
    }
}
