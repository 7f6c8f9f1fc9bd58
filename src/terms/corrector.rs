//! Correction by a series and its terms, sample by sample, with the state it needs.

use std::slice;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::block::{BLOCK, Block, Given};
use super::prepared::Terms;
use super::signals::{Columns, Signal, Signals};
use super::travel::Travel;
use crate::error::Error;
use crate::kernel::{Batch, Quantity, Real, Sample, Shared, Stretch};
use crate::{interrupt, threads};

/// Samples that are corrected between two looks at the clock, and by one thread at a time.
const PART: usize = 4096;

/// Orders that cost as much as the rest of a sample where there is no table of the series.
const LINES_PER_SAMPLE: usize = 16;

/// Fewest samples of a part, however dear each is.
const LEAST_PART: usize = 16;

/// Samples from which threads are worth starting: each takes longer than by a table.
const THREADED: usize = 1 << 14;

/// Corrects samples in the order they were taken.
#[derive(Clone, Debug)]
pub struct Corrector {
    terms: Arc<Terms>,
    travel: Travel,
}

impl Corrector {
    /// A corrector that knows nothing of the past.
    pub fn new(terms: Arc<Terms>) -> Self {
        let travel = Travel::new(terms.elements.len());
        Self { terms, travel }
    }

    /// The series and its terms.
    pub fn terms(&self) -> &Arc<Terms> {
        &self.terms
    }

    /// Forgets the past.
    pub fn reset(&mut self) {
        self.travel = Travel::new(self.terms.elements.len());
    }

    /// The past as plain numbers.
    pub fn store(&self) -> Vec<f64> {
        self.travel.store()
    }

    /// Takes over the past of a corrector of the same terms; false when it is not one.
    pub fn restore(&mut self, numbers: &[f64]) -> bool {
        let found = self.travel.restored(numbers);
        let is_one = found.is_some();
        self.travel = found.unwrap_or_else(|| self.travel.clone());
        is_one
    }

    /// The true angle behind an indicated one; NaN for what is not finite, which leaves
    /// the state alone.
    pub fn correct(&mut self, indicated: f64, signals: &Signals) -> Result<f64, Error> {
        self.one(Quantity::Correction, indicated, signals)
    }

    /// Error at the true angle `theta` (at the indicated one where that is the argument).
    pub fn error(&mut self, theta: f64, signals: &Signals) -> Result<f64, Error> {
        self.one(Quantity::Error, theta, signals)
    }

    fn one(&mut self, quantity: Quantity, x: f64, signals: &Signals) -> Result<f64, Error> {
        let Self { terms, travel } = self;
        terms.check(|signal| signals.get(signal).is_some())?;
        let way = terms.way(|signal| signals.get(signal).is_some());
        Ok(terms.alone(travel, quantity, x, signals, way))
    }

    /// `correct` of many samples, or `error` of them; returns how many results lie outside
    /// a stretch.
    ///
    /// Where the work is called off the state is that of before.
    pub fn run<X: Sample, Y: Real>(
        &mut self,
        quantity: Quantity,
        batch: Batch<'_, X, Y>,
        columns: &Columns<'_>,
        threads: Option<usize>,
        stretch: Option<&Stretch>,
    ) -> Result<usize, Error> {
        let len = batch.len();
        columns.check(len)?;
        self.terms.check(|signal| columns.get(signal).is_some())?;
        let outside = AtomicUsize::new(0);
        let shared = Shared::new(batch);
        let size = self.part_size();
        let part = |corrector: &mut Self, i: usize| {
            let start = i * size;
            let some = size.min(len - start);
            // SAFETY: parts lie within the batch, and each is taken once.
            let (mut part, results) = unsafe {
                let batch = shared.get();
                (batch.part(start, some), batch.part(start, some))
            };
            corrector.run_part(quantity, &mut part, columns, start);
            if let Some(stretch) = stretch {
                let count = stretch.outside(corrector.terms.set, results);
                outside.fetch_add(count, Ordering::Relaxed);
            }
        };
        let parts = len.div_ceil(size);
        if self.terms.has_travel {
            let mut own = self.clone();
            for i in 0..parts {
                part(&mut own, i);
                interrupt::point();
            }
            *self = own;
        } else {
            let few = || {
                if len < THREADED {
                    1
                } else {
                    threads::available()
                }
            };
            let threads = threads.unwrap_or_else(few);
            threads::for_each_part(parts, threads, |i| part(&mut self.clone(), i));
        }
        Ok(outside.into_inner())
    }

    /// Samples that take about as long whatever the series.
    fn part_size(&self) -> usize {
        let evaluator = &self.terms.evaluator;
        if evaluator.table(Quantity::Correction).is_some() {
            return PART;
        }
        let lines = evaluator.series().lines().count();
        (PART / (1 + lines / LINES_PER_SAMPLE)).max(LEAST_PART)
    }

    /// Samples `start..` of all, block by block.
    fn run_part<X: Sample, Y: Real>(
        &mut self,
        quantity: Quantity,
        batch: &mut Batch<'_, X, Y>,
        columns: &Columns<'_>,
        start: usize,
    ) {
        let Self { terms, travel } = self;
        let way = terms.way(|signal| columns.get(signal).is_some());
        let mut block = Block::new();
        for first in (0..batch.len()).step_by(Block::<BLOCK>::MOST) {
            let len = Block::<BLOCK>::MOST.min(batch.len() - first);
            block.x.fill(f64::NAN);
            batch.widen(first, &mut block.x[..len]);
            block.signals.load(columns, start + first, len);
            terms.together(travel, quantity, &mut block, len, way);
            batch.narrow(first, &block.out[..len]);
        }
    }
}

impl Terms {
    /// `quantity` of the first `len` readings of a block; `way` is the signal whose sign is
    /// the direction of travel.
    fn together(
        &self,
        travel: &mut Travel,
        quantity: Quantity,
        block: &mut Block<BLOCK>,
        len: usize,
        way: Option<Signal>,
    ) {
        let is_error = quantity != Quantity::Correction;
        if is_error && !self.is_indicated() {
            self.error_still(block, len);
            if self.has_travel {
                self.error_moving(slice::from_mut(travel), block, len, way);
            }
            return;
        }
        if self.has_travel {
            self.correct_moving(travel, block, len, way);
        } else {
            self.correct_still(block, len);
        }
        if is_error {
            for i in 0..len {
                block.out[i] = block.x[i] - block.out[i];
            }
        }
    }

    /// The same of one reading.
    pub(super) fn alone(
        &self,
        travel: &mut Travel,
        quantity: Quantity,
        x: f64,
        signals: &Signals,
        way: Option<Signal>,
    ) -> f64 {
        let is_error = quantity != Quantity::Correction;
        if is_error && !self.is_indicated() {
            let mut block = Block::one(x, signals);
            self.error_still(&mut block, 1);
            if self.has_travel {
                self.error_moving(slice::from_mut(travel), &mut block, 1, way);
            }
            return block.out[0];
        }
        let corrected = self.correct_one(travel, x, &Given::one(signals), way);
        if is_error { x - corrected } else { corrected }
    }
}
