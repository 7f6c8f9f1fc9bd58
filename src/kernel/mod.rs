//! Evaluation and correction of many samples.

// Kernels index arrays instead of chaining closures: a closure is compiled for the
// baseline processor and would call every vector instruction as a function.
#![allow(clippy::needless_range_loop)]

mod batch;
mod exact;
mod expansion;
mod inverse;
mod lanes;
mod portable;
mod route;
mod sincos;
mod sweep;
mod table;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use batch::{Batch, Real, Sample};
pub use lanes::InstructionSet;
pub use route::{Path, Route};
pub use table::Table;

use std::sync::OnceLock;

use exact::Exact;

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

/// Samples below which threads cost more than they save.
pub const THREADED: usize = 100_000;

/// Samples of one piece of work for a thread.
const PART: usize = 1 << 15;

/// Greatest error of the default path, of the sum of amplitudes.
pub const TOLERANCE: f64 = 3e-15;

/// The part of it that rounding may take: the transform that builds a table (4e-16 at
/// most in tests up to order 512), its rows, and three roundings of the result.
const ROUNDING: f64 = 1e-15;

/// A series made ready for batches: immutable, shared between threads.
#[derive(Debug)]
pub struct Evaluator {
    series: HarmonicSeries,
    argument: Argument,
    tolerance: f64,
    reach: f64,
    slope_bound: f64,
    best: InstructionSet,
    exact_error: Exact,
    exact_slope: Exact,
    errors: OnceLock<Option<Table>>,
    corrections: OnceLock<Option<Table>>,
}

impl Evaluator {
    /// Takes the series over; tables are built when first needed.
    ///
    /// `tolerance` is the greatest error of the table path, of the sum of amplitudes.
    pub fn new(series: HarmonicSeries, argument: Argument, tolerance: f64) -> Self {
        Self {
            reach: series.amplitude_sum(),
            slope_bound: series.slope_bound(),
            exact_error: Exact::error(&series),
            exact_slope: Exact::slope(&series),
            series,
            argument,
            tolerance,
            best: InstructionSet::best(),
            errors: OnceLock::new(),
            corrections: OnceLock::new(),
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

    /// The table a quantity is looked up in, built at the first call; `None` where the
    /// series is not periodic or too rough for one.
    pub fn table(&self, quantity: Quantity) -> Option<&Table> {
        if !self.series.is_periodic() || quantity == Quantity::Slope {
            return None;
        }
        let tolerance = (self.tolerance - ROUNDING) * self.reach;
        if quantity == Quantity::Error || self.argument == Argument::Indicated {
            let build = || expansion::table(&self.series, tolerance, 8);
            self.errors.get_or_init(build).as_ref()
        } else {
            let build = || inverse::table(&self.series, self.slope_bound, tolerance);
            self.corrections.get_or_init(build).as_ref()
        }
    }

    /// The path and instruction set that batches take.
    pub fn route(&self, quantity: Quantity) -> Route {
        let path = match self.table(quantity) {
            Some(_) => Path::Table,
            None => Path::Exact,
        };
        Route {
            path,
            set: self.best,
        }
    }

    /// An error where this series cannot take a path, or this processor not its
    /// instruction set.
    fn check_route(&self, quantity: Quantity, route: Route) -> Result<(), Error> {
        let reason = if !route.set.is_available() {
            "this processor does not have the instruction set"
        } else if route.path != Path::Table || self.table(quantity).is_some() {
            return Ok(());
        } else if quantity == Quantity::Slope {
            "slopes are not tabulated"
        } else if self.series.is_periodic() {
            "the table would need too many segments"
        } else {
            "the error does not repeat after one turn"
        };
        Err(Error::Path {
            path: route.to_string(),
            reason,
        })
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
        if quantity == Quantity::Correction {
            self.check_invertible()?;
        }
        if let Some(route) = route {
            self.check_route(quantity, route)?;
        }
        let route = route.unwrap_or_else(|| self.route(quantity));
        let len = batch.len();
        if len < THREADED {
            self.run_part(quantity, route, batch);
            return Ok(());
        }
        let threads = threads.unwrap_or_else(threads::available);
        let batch = Shared(batch);
        threads::for_each_part(len.div_ceil(PART), threads, |i| {
            let start = i * PART;
            // SAFETY: parts lie within the batch, and each is handed out once.
            let part = unsafe { batch.get().part(start, PART.min(len - start)) };
            self.run_part(quantity, route, part);
        });
        Ok(())
    }

    fn run_part<X: Sample, Y: Real>(
        &self,
        quantity: Quantity,
        route: Route,
        mut batch: Batch<'_, X, Y>,
    ) {
        let set = route.set;
        match (route.path, quantity, self.table(quantity)) {
            (Path::Table, Quantity::Error, Some(table)) => table.values(set, batch),
            (Path::Table, _, Some(table)) => table.subtract(set, batch),
            (Path::Direct, ..) => batch.map(|x| Y::narrow(self.direct(quantity, x.widen()))),
            (_, Quantity::Error, _) => self.exact_error.run(set, batch),
            (_, Quantity::Slope, _) => self.exact_slope.run(set, batch),
            (_, Quantity::Correction, _) => self.correct_exactly(set, batch),
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
            newton.solve(x, out, |x| inverse::solve(&self.series, self.reach, x));
        });
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
