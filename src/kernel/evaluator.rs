//! A series made ready for batches: chooses how to compute and spreads it over threads.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::batch::{Batch, Real, Sample, Shared, is_single};
use super::counts::Counts;
use super::cubics::{self, Cubics};
use super::exact::Exact;
use super::route::{Path, Route};
use super::stretch::Stretch;
use super::table::{Scalar, Table, Together};
use super::{Argument, Quantity, inverse};
use crate::direct;
use crate::error::Error;
use crate::once::Once;
use crate::series::HarmonicSeries;
use crate::simd::InstructionSet;
use crate::threads;

/// Samples below which threads cost more than they save.
pub const THREADED: usize = 100_000;

/// Samples of one piece of work for a thread.
const PART: usize = 1 << 15;

/// Least samples of such a piece, where each of them takes long.
const LEAST_PART: usize = 256;

/// Orders that the exact path computes in the time of one sample by a table, and samples
/// by a table in the time that the slow truth takes for one order.
const LINES_PER_SAMPLE: usize = 16;
const DIRECT_PER_LINE: usize = 8;

/// Integers per entry from which it pays to compute an entry for every count.
const PAYING_SHARE: f64 = 0.25;

/// Greatest error of the default path, of the sum of amplitudes.
pub const TOLERANCE: f64 = 3e-15;

/// Tolerances that can be asked for.
const TOLERANCES: (f64, f64) = (2e-15, 1e-2);

/// The part of it that rounding may take: the transform that builds a table (4e-16 at
/// most in tests up to order 512), its rows, and three roundings of the result.
pub(super) const ROUNDING: f64 = 1e-15;

/// What a route computes with.
#[derive(Clone, Copy)]
enum Method<'e> {
    Table(&'e Table),
    Counts(&'e Counts),
    Cubics(&'e Cubics),
    Exact,
    Direct,
}

/// What is looked up for one quantity, built at the first use.
#[derive(Debug, Default)]
pub(super) struct Tables {
    pub(super) polynomials: Once<Option<Arc<Table>>>,
    pub(super) counts: Once<Counts>,
    pub(super) cubics: Once<Option<Cubics>>,
}

/// A series made ready for batches: immutable, shared between threads.
#[derive(Debug)]
pub struct Evaluator {
    pub(super) series: HarmonicSeries,
    pub(super) argument: Argument,
    pub(super) tolerance: f64,
    lines: usize,
    pub(super) reach: f64,
    pub(super) slope_bound: f64,
    /// Bound of the second derivative.
    bend: f64,
    pub(super) best: InstructionSet,
    pub(super) exact_error: Exact,
    exact_slope: Exact,
    pub(super) errors: Tables,
    pub(super) corrections: Tables,
}

impl Evaluator {
    /// Takes the series over; tables are built when first needed.
    pub fn new(series: HarmonicSeries, argument: Argument) -> Self {
        Self {
            lines: series.lines().count(),
            reach: series.amplitude_sum(),
            slope_bound: series.slope_bound(),
            bend: series.bend_bound(),
            exact_error: Exact::error(&series),
            exact_slope: Exact::slope(&series),
            series,
            argument,
            tolerance: TOLERANCE,
            best: InstructionSet::best(),
            errors: Tables::default(),
            corrections: Tables::default(),
        }
    }

    /// With another greatest error of the table path, of the sum of amplitudes.
    pub fn with_tolerance(self, tolerance: f64) -> Result<Self, Error> {
        if !(TOLERANCES.0..=TOLERANCES.1).contains(&tolerance) {
            return Err(Error::Tolerance(tolerance));
        }
        Ok(Self {
            tolerance,
            errors: Tables::default(),
            corrections: Tables::default(),
            ..self
        })
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

    /// The path and instruction set that batches of so many samples take.
    ///
    /// Integers are looked up once there are enough of them to pay for the entries; the
    /// results are the same to the last bit.
    pub fn route<X: Sample, Y: Real>(&self, quantity: Quantity, samples: usize) -> Route {
        let per_turn = self.series.period().value();
        let path = if X::IS_COUNT
            && samples as f64 >= PAYING_SHARE * per_turn
            && self.counts(quantity).is_some()
        {
            Path::Counts
        } else if is_single::<X, Y>() && self.cubics(quantity).is_some() {
            Path::Cubics
        } else if self.table(quantity).is_some() {
            Path::Table
        } else {
            Path::Exact
        };
        Route {
            path,
            set: self.best,
        }
    }

    /// What a route needs, or why it cannot be taken.
    fn method<X: Sample, Y: Real>(
        &self,
        quantity: Quantity,
        route: Route,
    ) -> Result<Method<'_>, &'static str> {
        if !route.set.is_available() {
            return Err("this processor does not have the instruction set");
        }
        match route.path {
            Path::Direct => return Ok(Method::Direct),
            Path::Exact => return Ok(Method::Exact),
            Path::Counts if !X::IS_COUNT => return Err("the angles must be integers"),
            Path::Cubics if !is_single::<X, Y>() => return Err("the angles must be float32"),
            Path::Table | Path::Cubics | Path::Counts => {}
        }
        let table = match self.table(quantity) {
            Some(table) => table,
            None if quantity == Quantity::Slope => return Err("slopes are not tabulated"),
            None if !self.series.is_periodic() => {
                return Err("the error does not repeat after one turn");
            }
            None => return Err("the table would need too many segments"),
        };
        match route.path {
            Path::Cubics => self
                .cubics(quantity)
                .map(Method::Cubics)
                .ok_or("the cubics would need too many segments, or values beyond float32"),
            Path::Counts => self
                .counts(quantity)
                .map(Method::Counts)
                .ok_or("the turn must be a whole number of counts, at most 2^20"),
            _ => Ok(Method::Table(table)),
        }
    }

    /// `quantity` of every sample of a batch, by the default route or the one given.
    ///
    /// The results do not depend on `threads` (`None`: all cores, for large batches).
    pub fn run<X: Sample, Y: Real>(
        &self,
        quantity: Quantity,
        route: Option<Route>,
        threads: Option<usize>,
        batch: Batch<'_, X, Y>,
    ) -> Result<(), Error> {
        self.run_watched(quantity, route, threads, batch, None)
            .map(|_| ())
    }

    /// The same, and how many results lie outside a stretch: looked at while they are in
    /// the cache.
    pub fn run_watched<X: Sample, Y: Real>(
        &self,
        quantity: Quantity,
        route: Option<Route>,
        threads: Option<usize>,
        batch: Batch<'_, X, Y>,
        stretch: Option<&Stretch>,
    ) -> Result<usize, Error> {
        if quantity == Quantity::Correction {
            self.check_invertible()?;
        }
        let len = batch.len();
        let route = route.unwrap_or_else(|| self.route::<X, Y>(quantity, len));
        let method = self
            .method::<X, Y>(quantity, route)
            .map_err(|reason| Error::Path {
                path: route.to_string(),
                reason,
            })?;
        let outside = AtomicUsize::new(0);
        let run = |batch: Batch<'_, X, Y>| {
            // SAFETY: the results are looked at after they were written, by one thread.
            let results = unsafe { batch.part(0, batch.len()) };
            self.run_part(quantity, method, route.set, batch);
            if let Some(stretch) = stretch {
                let count = stretch.outside(self.best, results);
                outside.fetch_add(count, Ordering::Relaxed);
            }
        };
        let price = self.price(method);
        if len.saturating_mul(price) < THREADED {
            run(batch);
            return Ok(outside.into_inner());
        }
        let threads = threads.unwrap_or_else(threads::available);
        let size = (PART / price).max(LEAST_PART);
        let batch = Shared::new(batch);
        threads::for_each_part(len.div_ceil(size), threads, |i| {
            let start = i * size;
            // SAFETY: parts lie within the batch, and each is handed out once.
            let part = unsafe { batch.get().part(start, size.min(len - start)) };
            run(part);
        });
        Ok(outside.into_inner())
    }

    /// About what a sample costs by a method, in samples by a table.
    fn price(&self, method: Method<'_>) -> usize {
        match method {
            Method::Table(_) | Method::Counts(_) | Method::Cubics(_) => 1,
            Method::Exact => 1 + self.lines / LINES_PER_SAMPLE,
            Method::Direct => 1 + DIRECT_PER_LINE * self.lines,
        }
    }

    fn run_part<X: Sample, Y: Real>(
        &self,
        quantity: Quantity,
        method: Method<'_>,
        set: InstructionSet,
        mut batch: Batch<'_, X, Y>,
    ) {
        match (method, quantity) {
            (Method::Table(table), Quantity::Correction) => table.subtract(set, batch),
            (Method::Table(table), _) => table.values(set, batch),
            (Method::Counts(counts), Quantity::Correction) => counts.subtract(batch),
            (Method::Counts(counts), _) => counts.values(batch),
            (Method::Cubics(cubics), _) => {
                let batch = batch.into_single().expect("`method` looked at the types");
                match quantity {
                    Quantity::Correction => cubics.subtract(set, batch),
                    _ => cubics.values(set, batch),
                }
            }
            (Method::Exact, Quantity::Error) => self.exact_error.run(set, batch),
            (Method::Exact, Quantity::Slope) => self.exact_slope.run(set, batch),
            (Method::Exact, Quantity::Correction) => self.correct_exactly(set, batch),
            (Method::Direct, _) => batch.map(|x| Y::narrow(self.direct(quantity, x.widen()))),
        }
    }

    /// The correction of single samples by its table: for a compensator.
    pub fn scalar(&self) -> Option<(Arc<Table>, Scalar)> {
        let table = self.table(Quantity::Correction)?;
        Some((Arc::clone(table), Table::scalar_subtract(self.best)))
    }

    /// The same of a sample of each of several tables, on the processor of this one.
    pub fn together(&self) -> Together {
        Table::each_subtract(self.best)
    }

    /// The correction of one sample without a table, as a batch has it to the last bit.
    #[inline(never)]
    pub fn correct_one(&self, indicated: f64) -> f64 {
        let mut theta = [0.0];
        self.correct_block(self.best, &[indicated], &mut theta);
        theta[0]
    }

    /// What the error of the default route is at most, in the unit of the angles.
    pub fn error_bound(&self) -> f64 {
        // Four roundings of half an ulp of a sum that holds the constant.
        2.0 * f64::EPSILON * self.series.constant().abs()
            + match self.table(Quantity::Error) {
                Some(table) => table.bound() + ROUNDING * self.reach,
                None => TOLERANCE * self.reach,
            }
    }

    /// The same for f32.
    pub fn single_bound(&self) -> f64 {
        match self.cubics(Quantity::Error) {
            Some(cubics) => cubics.bound(),
            None => {
                let greatest = self.reach + self.series.constant().abs();
                self.error_bound() + cubics::ROUNDING * greatest
            }
        }
    }

    /// The slow truth.
    fn direct(&self, quantity: Quantity, x: f64) -> f64 {
        match (quantity, self.argument) {
            (Quantity::Error, _) => direct::error(&self.series, x),
            (Quantity::Slope, _) => direct::slope(&self.series, x),
            (_, Argument::Indicated) => x - direct::error(&self.series, x),
            (_, Argument::Reference) if x.is_finite() => direct::correct(&self.series, x),
            (_, Argument::Reference) => f64::NAN,
        }
    }

    /// Corrections without a table, block by block.
    pub(super) fn correct_exactly<X: Sample, Y: Real>(
        &self,
        set: InstructionSet,
        mut batch: Batch<'_, X, Y>,
    ) {
        batch.map_blocks(|x, out| self.correct_block(set, x, out));
    }

    fn correct_block(&self, set: InstructionSet, indicated: &[f64], theta: &mut [f64]) {
        let newton = inverse::Newton {
            error: &self.exact_error,
            slope: (self.argument == Argument::Reference).then_some(&self.exact_slope),
            constant: self.series.constant(),
            reach: self.reach,
            slope_bound: self.slope_bound,
            bend: self.bend,
            set,
        };
        newton.solve(indicated, theta, |x| {
            inverse::solve(&self.series, self.reach, x)
        });
    }
}
