//! What an evaluator looks up, built at the first use.

use std::sync::Arc;

use super::counts::{Counts, MOST_COUNTS};
use super::cubics::{self, Cubics};
use super::evaluator::{Evaluator, ROUNDING, Tables};
use super::table::{MOST_SEGMENTS, Table};
use super::{Argument, Quantity, expansion, inverse};
use crate::error::Error;
use crate::memory;

impl Evaluator {
    /// Where a quantity is looked up: the correction of a series of the indicated angle
    /// subtracts the error itself.
    fn tables(&self, quantity: Quantity) -> &Tables {
        match (quantity, self.argument) {
            (Quantity::Correction, Argument::Reference) => &self.corrections,
            _ => &self.errors,
        }
    }

    /// The table a quantity is looked up in, built at the first call; `None` where the
    /// series is not periodic or too rough for one.
    pub fn table(&self, quantity: Quantity) -> Option<&Arc<Table>> {
        if !self.series.is_periodic() || quantity == Quantity::Slope {
            return None;
        }
        let tables = self.tables(quantity);
        let tolerance = (self.tolerance - ROUNDING) * self.reach;
        let build = || {
            if std::ptr::eq(tables, &self.errors) {
                expansion::table(&self.series, tolerance, 8)
            } else {
                inverse::table(&self.series, self.slope_bound, tolerance)
            }
        };
        tables
            .polynomials
            .get_or_init(|| build().map(Arc::new))
            .as_ref()
    }

    /// The cubics that f32 is looked up in; `None` where there is no table, or they would
    /// be too many.
    pub fn cubics(&self, quantity: Quantity) -> Option<&Cubics> {
        let table = self.table(quantity)?;
        let tables = self.tables(quantity);
        let tolerance = self.tolerance.max(cubics::ROUNDING) * self.reach;
        let interpolation = |segments| {
            if std::ptr::eq(tables, &self.errors) {
                expansion::cubic_bound(&self.series, segments)
            } else {
                inverse::bound(&self.series, self.slope_bound, segments, cubics::DEGREE)
            }
        };
        tables
            .cubics
            .get_or_init(|| Cubics::new(table, tolerance, interpolation))
            .as_ref()
    }

    /// Entries per count; `None` where the turn is not a whole number of them.
    pub(super) fn counts(&self, quantity: Quantity) -> Option<&Counts> {
        let per_turn = self.series.period().value();
        if per_turn.fract() != 0.0 || per_turn > MOST_COUNTS {
            return None;
        }
        let table = self.table(quantity)?;
        let counts = &self.tables(quantity).counts;
        Some(counts.get_or_init(|| Counts::new(table, self.best)))
    }

    /// An error where there is no memory to build what a batch needs.
    pub fn room(&self) -> Result<(), Error> {
        /// Bytes per segment, of the table and of what it is made from.
        const BYTES: usize = 512;
        /// Segments per order of a table of the default tolerance.
        const SEGMENTS: f64 = 64.0;
        let highest = self.series.lines().map(|line| line.order);
        let segments = SEGMENTS * highest.fold(16.0, f64::max);
        memory::room(BYTES * (segments as usize).min(MOST_SEGMENTS))
    }

    /// True when what a batch needs is there, so that it takes as long as its samples.
    pub fn is_ready(&self, quantity: Quantity) -> bool {
        self.tables(quantity).polynomials.get().is_some()
            || quantity == Quantity::Slope
            || !self.series.is_periodic()
    }
}
