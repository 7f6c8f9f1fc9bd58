//! A series made ready for batches: chooses how to compute and spreads it over threads.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::batch::{Batch, Real, Sample, Shared, is_single};
use super::counts::{Counts, MOST_COUNTS};
use super::cubics::{self, Cubics};
use super::exact::Exact;
use super::lanes::InstructionSet;
use super::route::{Path, Route};
use super::stretch::Stretch;
use super::table::{MOST_SEGMENTS, Scalar, Table};
use super::{Argument, Quantity, expansion, inverse};
use crate::direct;
use crate::error::Error;
use crate::memory;
use crate::once::Once;
use crate::series::HarmonicSeries;
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
const ROUNDING: f64 = 1e-15;

/// What is looked up for one quantity, built at the first use.
#[derive(Debug, Default)]
struct Tables {
    polynomials: Once<Option<Arc<Table>>>,
    counts: Once<Counts>,
    cubics: Once<Option<Cubics>>,
}

/// What a route computes with.
#[derive(Clone, Copy)]
enum Method<'e> {
    Table(&'e Table),
    Counts(&'e Counts),
    Cubics(&'e Cubics),
    Exact,
    Direct,
}

/// A series made ready for batches: immutable, shared between threads.
#[derive(Debug)]
pub struct Evaluator {
    series: HarmonicSeries,
    argument: Argument,
    tolerance: f64,
    lines: usize,
    reach: f64,
    slope_bound: f64,
    best: InstructionSet,
    exact_error: Exact,
    exact_slope: Exact,
    errors: Tables,
    corrections: Tables,
}

impl Evaluator {
    /// Takes the series over; tables are built when first needed.
    pub fn new(series: HarmonicSeries, argument: Argument) -> Self {
        Self {
            lines: series.lines().count(),
            reach: series.amplitude_sum(),
            slope_bound: series.slope_bound(),
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
    fn counts(&self, quantity: Quantity) -> Option<&Counts> {
        let per_turn = self.series.period().value();
        if per_turn.fract() != 0.0 || per_turn > MOST_COUNTS {
            return None;
        }
        let table = self.table(quantity)?;
        let counts = &self.tables(quantity).counts;
        Some(counts.get_or_init(|| Counts::new(table, self.best)))
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
        quantity == Quantity::Slope
            || !self.series.is_periodic()
            || self.tables(quantity).polynomials.get().is_some()
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

    /// The correction of one sample without a table.
    pub fn correct_one(&self, indicated: f64) -> f64 {
        match self.argument {
            Argument::Reference => inverse::solve(&self.series, self.reach, indicated),
            Argument::Indicated => indicated - self.series.evaluate(indicated).0,
        }
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
    fn correct_exactly<X: Sample, Y: Real>(&self, set: InstructionSet, mut batch: Batch<'_, X, Y>) {
        let newton = inverse::Newton {
            error: &self.exact_error,
            slope: (self.argument == Argument::Reference).then_some(&self.exact_slope),
            reach: self.reach,
            set,
        };
        batch.map_blocks(|x, out| {
            newton.solve(x, out, |x| self.correct_one(x));
        });
    }
}
