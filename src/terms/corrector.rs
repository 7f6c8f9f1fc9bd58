//! Correction by a series and its terms, sample by sample, with the state it needs.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::prepared::Terms;
use super::signals::{Columns, Signal, Signals};
use super::travel::{Heading, Travel};
use crate::error::Error;
use crate::kernel::{Batch, InstructionSet, Quantity, Real, Sample, Shared, Stretch};
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
        self.terms.check(|signal| signals.get(signal).is_some())?;
        Ok(self.solve(indicated, signals))
    }

    /// Error at the true angle `theta` (at the indicated one where that is the argument).
    pub fn error(&mut self, theta: f64, signals: &Signals) -> Result<f64, Error> {
        self.terms.check(|signal| signals.get(signal).is_some())?;
        Ok(self.indicate(theta, signals))
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
            let (part, results) = unsafe {
                let batch = shared.get();
                (batch.part(start, some), batch.part(start, some))
            };
            corrector.run_part(quantity, part, columns, start);
            if let Some(stretch) = stretch {
                let count = stretch.outside(InstructionSet::best(), results);
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

    /// Samples `start..` of all.
    fn run_part<X: Sample, Y: Real>(
        &mut self,
        quantity: Quantity,
        mut batch: Batch<'_, X, Y>,
        columns: &Columns<'_>,
        start: usize,
    ) {
        let terms = Arc::clone(&self.terms);
        let alone = !terms.has_travel && !terms.is_shaped && !terms.is_indicated();
        let mut at = start..;
        let mut next = || columns.at(at.next().unwrap_or_default());
        if quantity != Quantity::Correction {
            batch.map(|x| Y::narrow(self.indicate(x.widen(), &next())));
        } else if !alone {
            batch.map(|x| Y::narrow(self.solve(x.widen(), &next())));
        } else {
            // The terms do not depend on the angle: many samples at once.
            let mut done = start;
            batch.map_blocks(|x, y| {
                for (i, (x, y)) in x.iter().zip(y.iter_mut()).enumerate() {
                    *y = x - terms.level(&columns.at(done + i));
                }
                let all = Batch::in_place(&mut *y);
                let corrected = terms
                    .evaluator
                    .run(Quantity::Correction, None, Some(1), all);
                debug_assert!(
                    corrected.is_ok(),
                    "`Terms::new` refuses what cannot be inverted"
                );
                if terms.delay != 0.0 {
                    for (i, y) in y.iter_mut().enumerate() {
                        *y += terms.delayed(&columns.at(done + i));
                    }
                }
                done += x.len();
            });
        }
    }

    fn solve(&mut self, indicated: f64, signals: &Signals) -> f64 {
        let Self { terms, travel } = self;
        let (level, delayed) = (terms.level(signals), terms.delayed(signals));
        // The series is undone first where its argument is the indicated angle.
        let (goal, invert) = if terms.is_indicated() {
            (terms.plain.step(indicated) - level, false)
        } else {
            (indicated - level, true)
        };
        if !(goal + delayed).is_finite() {
            return f64::NAN;
        }
        if !terms.has_travel && !terms.is_shaped {
            return delayed + if invert { terms.plain.step(goal) } else { goal };
        }
        let find =
            |travel: &Travel, heading: Heading| terms.find(travel, heading, goal, invert, signals);
        if !terms.has_travel {
            return delayed + find(travel, NOWHERE);
        }
        let constant = terms.evaluator.series().constant();
        travel.align(indicated - constant, terms.period());
        if let Some(signal) = travel_of(signals) {
            let heading = travel.heading(signal);
            let x = find(travel, heading);
            if x.is_nan() || signal.is_nan() {
                return f64::NAN;
            }
            travel.advance(&terms.elements, heading, x);
            return x + delayed;
        }
        if !travel.is_known() {
            let x = find(travel, NOWHERE);
            if !x.is_nan() {
                travel.advance(&terms.elements, NOWHERE, x);
            }
            return x + delayed;
        }
        // Play: the joint has moved where the angle leaves the band of the play.
        let first = if travel.direction < 0.0 { -1.0 } else { 1.0 };
        for direction in [first, -first] {
            let heading = travel.heading(direction);
            let x = find(travel, heading);
            if x.is_nan() {
                return x;
            }
            if (x - travel.farthest) * direction >= 0.0 {
                travel.advance(&terms.elements, heading, x);
                return x + delayed;
            }
        }
        travel.farthest + delayed
    }

    fn indicate(&mut self, theta: f64, signals: &Signals) -> f64 {
        if self.terms.is_indicated() {
            return theta - self.solve(theta, signals);
        }
        let Self { terms, travel } = self;
        let delayed = terms.delayed(signals);
        let x = theta - delayed;
        let mut value = [x];
        let done = terms
            .evaluator
            .run(Quantity::Error, None, Some(1), Batch::in_place(&mut value));
        debug_assert!(done.is_ok(), "an error can always be evaluated");
        let mut error = value[0] + terms.level(signals) + terms.shape(signals, x).0;
        if terms.has_travel && error.is_finite() {
            travel.align(x, terms.period());
            let way = x - travel.farthest;
            let moved = if way.is_nan() { 0.0 } else { way };
            let signal = travel_of(signals).unwrap_or(moved);
            if signal.is_nan() {
                return f64::NAN;
            }
            let heading = travel.heading(signal);
            error += heading.direction * (terms.play + terms.place(x).0)
                + travel.friction(&terms.elements, heading, x).0;
            travel.advance(&terms.elements, heading, x);
        }
        error - delayed
    }
}

/// The signal whose sign is the direction of travel.
fn travel_of(signals: &Signals) -> Option<f64> {
    let velocity = signals.get(Signal::Velocity);
    signals.get(Signal::Direction).or(velocity)
}

/// Before the first motion.
const NOWHERE: Heading = Heading {
    direction: 0.0,
    turned: false,
};
