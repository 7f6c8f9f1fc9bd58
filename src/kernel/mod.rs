//! Evaluation and correction of many samples.

mod batch;
mod inverse;

pub use batch::{Batch, Real, Sample};

use crate::direct;
use crate::error::Error;
use crate::series::HarmonicSeries;
use crate::threads;

/// Which angle the series takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Argument {
    /// The true angle: correcting solves `theta + error(theta) = indicated`.
    Reference,
    /// The encoder's angle: correcting subtracts.
    Indicated,
}

/// What to compute from each sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// `error(x)`.
    Error,
    /// `d error / dx`.
    Slope,
    /// The true angle of an indicated one.
    Correction,
}

/// How to compute it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Path {
    /// Piecewise polynomials over one turn.
    Table,
    /// One sine and cosine per sample, then a recurrence over the orders.
    Exact,
    /// One sine and cosine per sample and order, by the platform's libm: the reference.
    Direct,
    /// One entry per count.
    Counts,
}

/// Samples below which threads cost more than they save.
pub const THREADED: usize = 100_000;

/// Samples of one piece of work for a thread.
const PART: usize = 1 << 15;

/// A series made ready for batches: immutable, shared between threads.
#[derive(Debug)]
pub struct Evaluator {
    series: HarmonicSeries,
    argument: Argument,
    reach: f64,
    slope_bound: f64,
}

impl Evaluator {
    /// Takes the series over; nothing is built until it is needed.
    pub fn new(series: HarmonicSeries, argument: Argument) -> Self {
        Self {
            reach: series.amplitude_sum(),
            slope_bound: series.slope_bound(),
            series,
            argument,
        }
    }

    /// The series evaluated.
    pub fn series(&self) -> &HarmonicSeries {
        &self.series
    }

    /// Which angle the series takes.
    pub fn argument(&self) -> Argument {
        self.argument
    }

    /// Upper bound of `|d error / dx|`.
    pub fn slope_bound(&self) -> f64 {
        self.slope_bound
    }

    /// An error where the indicated angle does not determine the true one.
    pub fn check_invertible(&self) -> Result<(), Error> {
        if self.argument == Argument::Reference && self.slope_bound >= 1.0 {
            return Err(Error::NotInvertible {
                slope: self.slope_bound,
            });
        }
        Ok(())
    }

    /// `quantity` of every sample of a batch.
    ///
    /// The results do not depend on `threads` (`None`: all cores, for large batches).
    pub fn run<X: Sample, Y: Real>(
        &self,
        quantity: Quantity,
        path: Option<Path>,
        threads: Option<usize>,
        batch: Batch<'_, X, Y>,
    ) -> Result<(), Error> {
        if quantity == Quantity::Correction {
            self.check_invertible()?;
        }
        let one = |x: f64| self.one(quantity, path, x);
        let threads = match threads {
            _ if batch.len() < THREADED => 1,
            Some(threads) => threads,
            None => threads::available(),
        };
        let len = batch.len();
        let batch = Shared(batch);
        threads::for_each_part(len.div_ceil(PART), threads, |i| {
            let start = i * PART;
            // SAFETY: parts lie within the batch, and each is handed out once.
            let mut part = unsafe { batch.get().part(start, PART.min(len - start)) };
            part.map(|x| Y::narrow(one(x.widen())));
        });
        Ok(())
    }

    /// `quantity` of one sample.
    fn one(&self, quantity: Quantity, path: Option<Path>, x: f64) -> f64 {
        let direct = path == Some(Path::Direct);
        match (quantity, self.argument) {
            (Quantity::Error, _) if direct => direct::error(&self.series, x),
            (Quantity::Error, _) => self.series.evaluate(x).0,
            (Quantity::Slope, _) if direct => direct::slope(&self.series, x),
            (Quantity::Slope, _) => self.series.evaluate(x).1,
            (Quantity::Correction, Argument::Indicated) => x - self.one(Quantity::Error, path, x),
            (Quantity::Correction, Argument::Reference) if direct => {
                direct::correct(&self.series, x)
            }
            (Quantity::Correction, Argument::Reference) => {
                inverse::solve(&self.series, self.reach, x)
            }
        }
    }
}

/// A batch that threads take disjoint parts of.
struct Shared<'a, X, Y>(Batch<'a, X, Y>);

// SAFETY: only `part` is called through the shared reference, on disjoint ranges.
unsafe impl<X: Sync, Y: Send> Sync for Shared<'_, X, Y> {}

impl<'a, X, Y> Shared<'a, X, Y> {
    fn get(&self) -> &Batch<'a, X, Y> {
        &self.0
    }
}
