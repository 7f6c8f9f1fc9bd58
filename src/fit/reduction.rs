//! The ways from readings to a system of equations.

use super::preview::Preview;
use super::{Method, Options, Watched};
use crate::design::Design;
use crate::error::Error;
use crate::interrupt;
use crate::lstsq::{Reduction, System, Triangle};
use crate::moments::accumulator::{Accumulator, segments};
use crate::moments::spectrum::Spectrum;
use crate::moments::{factor, normal};
use crate::readings::Readings;
use crate::simd::{InstructionSet, Kernel, Lanes, dispatch};

/// Rows reduced at a time: enough to hide the triangle above them, few enough for the cache.
const BLOCK_ROWS: usize = 512;

/// Moments pay when there are this many readings per segment of the circle.
const READINGS_PER_SEGMENT: usize = 8;

/// With this many harmonics they pay at any number of readings: QR of the rows costs
/// `readings * harmonics^2`, the moments' spectrum and normal equations less. With fewer the rule
/// above stands in for the costs, which are microseconds there, and fits keep their last digits.
const MANY_HARMONICS: usize = 128;

/// Factors of segments want some readings more than their twelve unknowns.
pub const READINGS_PER_FACTOR: usize = 32;

/// Segments beyond which moments would take more memory than they are worth.
const MOST_SEGMENTS: usize = 1 << 16;

/// Normal equations square the condition number: up to here they lose three of sixteen digits.
const NORMAL_UP_TO: f64 = 30.0;

/// Factors of segments hold relations between orders to about 1e-8: up to here they are
/// as good as QR of all rows, which takes over beyond.
const FACTORS_UP_TO: f64 = 1e7;

/// What relations between orders are known to from factors of segments, in radians.
pub const FACTOR_ROUNDING: f64 = 1e-8;

/// A system, its condition number and the path that led to it.
pub struct Reduced {
    pub system: System,
    /// Where the choice of the path needed it.
    pub condition_number: Option<f64>,
    /// What it does not exceed, once that is known.
    pub condition_bound: Option<f64>,
    pub method: Method,
    /// Weighted sum of squares that no harmonic can explain, beside what is left over in
    /// the system: that of readings at one count about their mean.
    pub scatter: f64,
    /// How far the readings are off a first fit of some of them, where that was looked for.
    pub watched: Option<Watched>,
}

impl Reduced {
    fn new(system: System, method: Method) -> Self {
        Self {
            system,
            condition_number: None,
            condition_bound: None,
            method,
            scatter: 0.0,
            watched: None,
        }
    }

    /// True where the condition number is below `limit`: it is made where no bound tells.
    fn is_within(&mut self, limit: f64) -> bool {
        if self.bound() < limit {
            return true;
        }
        if self.condition_number.is_none() {
            let bound = self.system.near_condition_bound();
            self.condition_bound = Some(bound.min(self.bound()));
            if bound >= limit {
                self.condition_number = Some(self.system.condition_number());
            }
        }
        self.bound() < limit
    }

    /// What the condition number does not exceed: itself where it is known.
    pub fn bound(&mut self) -> f64 {
        let made = || self.system.condition_bound();
        let bound = self.condition_number.or(self.condition_bound);
        *self.condition_bound.insert(bound.unwrap_or_else(made))
    }

    /// The same from mean errors of counts, about which the readings scatter.
    pub fn counted(self, scatter: f64) -> Self {
        Self {
            method: Method::Counts,
            scatter,
            // Means hide their farthest reading.
            watched: None,
            ..self
        }
    }
}

/// The readings reduced by the fastest path that keeps the accuracy of QR, unless one is
/// asked for. `inspect` names the reading that is not finite once a sum is not.
pub fn reduce(
    design: &Design,
    runs: &[Readings],
    centres: &[f64],
    options: Options,
    inspect: impl Fn() -> Result<(), Error>,
) -> Result<Reduced, Error> {
    let asked = options.method;
    if !matches!(asked, Some(Method::Plain | Method::Counts))
        && let Some((cycles, orders)) = design.common_turn()
    {
        let highest = orders.iter().copied().max().unwrap_or(0);
        let segments = segments(highest);
        let readings: usize = runs.iter().map(|run| run.angle.len()).sum();
        let per_segment = readings / (segments * runs.len());
        let fits = segments <= MOST_SEGMENTS;
        let pays = per_segment >= READINGS_PER_SEGMENT || orders.len() >= MANY_HARMONICS;
        if fits && (pays || asked.is_some()) {
            let preview = || Preview::of_runs(design, (cycles, &orders), runs, centres);
            let preview = options.watch.then(preview).flatten();
            let mut farthest = 0.0f64;
            let sum = |(i, run): (usize, &Readings)| {
                let mut sums = Accumulator::new(design.period(), cycles, highest, centres[i]);
                if let Some(preview) = &preview {
                    let expected = &preview.expected()[i];
                    let off = sums.update_watched(*run, options.threads, expected);
                    farthest = farthest.max(off);
                } else {
                    sums.update(*run, options.threads);
                }
                sums
            };
            let sums: Vec<_> = runs.iter().enumerate().map(sum).collect();
            let mut watched = preview.map(|preview| preview.watched(farthest));
            if !sums.iter().all(|sums| sums.squares().is_finite()) {
                inspect()?;
            }
            let sums: Vec<_> = sums.iter().collect();
            if asked != Some(Method::Qr)
                && let Some(mut reduced) = by_moments(&sums, &orders, highest)
                && (reduced.is_within(NORMAL_UP_TO) || asked.is_some())
            {
                reduced.watched = watched.take();
                return Ok(reduced);
            }
            if asked == Some(Method::Qr) || per_segment >= READINGS_PER_FACTOR {
                let mut reduced = Reduced::new(factor::system(&sums, &orders), Method::Qr);
                if reduced.is_within(FACTORS_UP_TO) || asked.is_some() {
                    reduced.watched = watched.take();
                    return Ok(reduced);
                }
            }
        }
    }
    inspect()?;
    if matches!(asked, Some(Method::Moments | Method::Qr | Method::Counts)) {
        return Err(Error::Method);
    }
    let system = rows(design, runs, centres);
    Ok(Reduced::new(system, Method::Plain))
}

/// The triangle of `[1, harmonics | error]` over one run, whose errors are counted from
/// `centre`: by one pass where the readings are many.
pub fn triangle(design: &Design, run: &Readings, centre: f64, threads: usize) -> Triangle {
    if let Some((cycles, orders)) = design.common_turn() {
        let highest = orders.iter().copied().max().unwrap_or(0);
        let segments = segments(highest);
        let per_segment = run.angle.len() / segments;
        if per_segment >= READINGS_PER_FACTOR && segments <= MOST_SEGMENTS {
            let mut sums = Accumulator::new(design.period(), cycles, highest, centre);
            sums.update(*run, threads);
            return factor::reduce(&sums, &orders);
        }
    }
    run_rows(design, run, centre)
}

/// The system of moments, by the way that fits its condition number.
pub fn reduce_moments(design: &Design, runs: &[&Accumulator]) -> Result<Reduced, Error> {
    let base = runs[0];
    let orders = design.whole_orders(base.cycles()).ok_or(Error::Method)?;
    let highest = orders.iter().copied().max().unwrap_or(0);
    if highest > base.reach() {
        return Err(Error::Method);
    }
    if let Some(mut reduced) = by_moments(runs, &orders, highest)
        && reduced.is_within(NORMAL_UP_TO)
    {
        return Ok(reduced);
    }
    Ok(Reduced::new(factor::system(runs, &orders), Method::Qr))
}

/// By normal equations; None where they are singular to working precision.
fn by_moments(runs: &[&Accumulator], orders: &[u32], highest: u32) -> Option<Reduced> {
    let spectra: Vec<_> = runs.iter().map(|run| Spectrum::new(run, highest)).collect();
    let system = normal::system(&spectra, orders)?;
    Some(Reduced::new(system, Method::Moments))
}

/// The system by QR of all rows.
fn rows(design: &Design, runs: &[Readings], centres: &[f64]) -> System {
    let mut system = System {
        runs: Vec::with_capacity(runs.len()),
        shared: Triangle::new(design.columns() + 1),
    };
    for (run, &centre) in runs.iter().zip(centres) {
        let (pivot, rest) = run_rows(design, run, centre).eliminate();
        system.runs.push(pivot);
        system.shared.merge(&rest);
    }
    system
}

/// The triangle of `[1, harmonics | error]` over one run.
fn run_rows(design: &Design, run: &Readings, centre: f64) -> Triangle {
    let columns = design.columns() + 2;
    let mut rows = Vec::with_capacity(BLOCK_ROWS.min(run.angle.len()) * columns);
    let mut reduction = Reduction::default();
    for start in (0..run.angle.len()).step_by(BLOCK_ROWS) {
        interrupt::point();
        rows.clear();
        let block = Block {
            design,
            readings: run.part(start, run.angle.len().min(start + BLOCK_ROWS)),
            centre,
            rows: &mut rows,
        };
        dispatch(InstructionSet::best(), block);
        reduction.push(Triangle::of_rows(columns, &rows));
    }
    reduction.finish().unwrap_or_else(|| Triangle::new(columns))
}

/// Rows of some readings, made where a product and sum are one instruction.
struct Block<'a> {
    design: &'a Design,
    readings: Readings<'a>,
    centre: f64,
    rows: &'a mut Vec<f64>,
}

impl Kernel for Block<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self {
            design,
            readings,
            centre,
            rows,
        } = self;
        for (i, &angle) in readings.angle.iter().enumerate() {
            let scale = readings.weight(i).sqrt();
            if scale == 0.0 {
                continue;
            }
            rows.push(scale);
            design.extend_row(rows, angle, scale);
            rows.push(scale * readings.error(i, centre, design.period()));
        }
    }
}
