//! The ways from readings to a system of equations.

use super::{Argument, Method, Options, Run};
use crate::design::Design;
use crate::error::Error;
use crate::lstsq::{Reduction, System, Triangle};
use crate::moments::accumulator::{Accumulator, segments};
use crate::moments::spectrum::Spectrum;
use crate::moments::{factor, normal};

/// Rows reduced at a time: enough to hide the triangle above them, few enough for the cache.
const BLOCK_ROWS: usize = 512;

/// Moments pay when there are this many readings per segment of the circle.
const READINGS_PER_SEGMENT: usize = 8;

/// Factors of segments want some readings more than their twelve unknowns.
const READINGS_PER_FACTOR: usize = 32;

/// Segments beyond which moments would take more memory than they are worth.
const MOST_SEGMENTS: usize = 1 << 16;

/// Normal equations square the condition number: up to here they lose three of sixteen digits.
const NORMAL_UP_TO: f64 = 30.0;

/// Factors of segments hold relations between orders to about 1e-8: up to here they are
/// as good as QR of all rows, which takes over beyond.
const FACTORS_UP_TO: f64 = 1e7;

/// The readings reduced to a system, its condition number and the path taken: the
/// fastest that keeps the accuracy of QR unless one is asked for.
pub fn reduce(
    design: &Design,
    runs: &[Run],
    centres: &[f64],
    options: Options,
) -> Result<(System, f64, Method), Error> {
    let readings: usize = runs.iter().map(|run| run.reference.len()).sum();
    let asked = options.method;
    let common = match asked {
        Some(Method::Plain) => None,
        _ => design.common_turn(),
    };
    if let Some((cycles, orders)) = common {
        let highest = orders.iter().copied().max().unwrap_or(0);
        let segments = segments(highest);
        let many = readings >= READINGS_PER_SEGMENT * segments * runs.len();
        if segments <= MOST_SEGMENTS && (many || asked.is_some()) {
            let sums = |(run, &centre): (&Run, &f64)| {
                let mut sums = Accumulator::new(design.period(), cycles, highest, centre);
                sums.update(run.readings(options.argument), options.threads);
                sums
            };
            let sums: Vec<_> = runs.iter().zip(centres).map(sums).collect();
            if asked != Some(Method::Qr) {
                let spectra: Vec<_> = sums.iter().map(|s| Spectrum::new(s, highest)).collect();
                if let Some(system) = normal::system(&spectra, &orders) {
                    let condition = system.condition_number();
                    if condition < NORMAL_UP_TO || asked.is_some() {
                        return Ok((system, condition, Method::Moments));
                    }
                }
            }
            let enough = readings >= READINGS_PER_FACTOR * segments * runs.len();
            if asked == Some(Method::Qr) || asked.is_none() && enough {
                let system = factor::system(&sums, &orders);
                let condition = system.condition_number();
                if condition < FACTORS_UP_TO || asked.is_some() {
                    return Ok((system, condition, Method::Qr));
                }
            }
        }
    }
    match asked {
        Some(Method::Moments | Method::Qr) => Err(Error::Method),
        _ => {
            let system = rows(design, runs, centres, options.argument);
            let condition = system.condition_number();
            Ok((system, condition, Method::Plain))
        }
    }
}

/// The system by QR of all rows.
fn rows(design: &Design, runs: &[Run], centres: &[f64], argument: Argument) -> System {
    let mut system = System {
        runs: Vec::with_capacity(runs.len()),
        shared: Triangle::new(design.columns() + 1),
    };
    for (run, &centre) in runs.iter().zip(centres) {
        let (pivot, rest) = run_rows(design, run, argument, centre).eliminate();
        system.runs.push(pivot);
        system.shared.merge(&rest);
    }
    system
}

/// The triangle of `[1, harmonics | error]` over one run.
fn run_rows(design: &Design, run: &Run, argument: Argument, centre: f64) -> Triangle {
    let columns = design.columns() + 2;
    let angles = run.readings(argument).angle;
    let mut rows = Vec::with_capacity(BLOCK_ROWS.min(angles.len()) * columns);
    let mut reduction = Reduction::default();
    for (block, angles) in angles.chunks(BLOCK_ROWS).enumerate() {
        rows.clear();
        for (i, &angle) in angles.iter().enumerate() {
            let i = BLOCK_ROWS * block + i;
            let scale = run.weight(i).sqrt();
            if scale == 0.0 {
                continue;
            }
            rows.push(scale);
            design.extend_row(&mut rows, angle, scale);
            rows.push(scale * run.error(i, centre, design.period()));
        }
        reduction.push(Triangle::of_rows(columns, &rows));
    }
    reduction.finish().unwrap_or_else(|| Triangle::new(columns))
}
