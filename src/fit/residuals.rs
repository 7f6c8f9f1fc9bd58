//! Residuals looked at, not kept.

use super::{Argument, Run, check};
use crate::circle::residuals;
use crate::error::Error;
use crate::kernel::{Batch, Evaluator, Path, Quantity, Route};
use crate::simd::InstructionSet;
use crate::threads;

/// Readings worked on at a time: residuals stay in the fastest cache.
const BLOCK: usize = 2048;

/// Blocks handed to a thread at a time.
const BLOCKS_PER_PART: usize = 32;

/// Readings below which a series is evaluated as it is: its table costs more to build.
const WITHOUT_TABLE: usize = 4096;

/// What a look at the residuals of a run shows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scan {
    /// The residual of every so many readings that count.
    pub sample: Vec<f64>,
    /// The greatest of all that count, signs left away.
    pub largest: f64,
}

/// The residuals of a run around a fitted series (of the true angle, its constant left in)
/// and a zero of `offset`; one of every `stride` that count is kept. Results do not depend on `threads`.
pub fn scan(
    fitted: &Evaluator,
    run: &Run,
    argument: Argument,
    offset: f64,
    stride: usize,
    threads: usize,
) -> Result<Scan, Error> {
    check::lengths(run)?;
    let len = run.reference.len();
    let part = BLOCK * BLOCKS_PER_PART;
    let parts = threads::map_parts(len.div_ceil(part), threads, |i| {
        let run = run.part(i * part, len.min((i + 1) * part));
        scan_part(fitted, &run, argument, offset, stride)
    });
    let mut whole = Scan::default();
    for found in parts {
        let found = found?;
        whole.sample.extend(found.sample);
        whole.largest = whole.largest.max(found.largest);
    }
    Ok(whole)
}

/// The residuals that [`scan`] keeps of every `stride` that count, without a look at the others.
pub fn sample(
    fitted: &Evaluator,
    run: &Run,
    argument: Argument,
    offset: f64,
    stride: usize,
    threads: usize,
) -> Result<Vec<f64>, Error> {
    check::lengths(run)?;
    let len = run.reference.len();
    let part = BLOCK * BLOCKS_PER_PART;
    let parts = threads::map_parts(len.div_ceil(part), threads, |i| {
        let run = run.part(i * part, len.min((i + 1) * part));
        every(&run, stride)
    });
    let (mut reference, mut indicated) = (Vec::new(), Vec::new());
    for (x, y) in parts {
        reference.extend(x);
        indicated.extend(y);
    }
    let some = Run {
        reference: &reference,
        indicated: &indicated,
        weights: None,
    };
    Ok(scan(fitted, &some, argument, offset, 1, threads)?.sample)
}

/// Both angles of every `stride` readings that count.
fn every(run: &Run, stride: usize) -> (Vec<f64>, Vec<f64>) {
    let Some(weights) = run.weights else {
        let every = |values: &[f64]| values.iter().step_by(stride).copied().collect();
        return (every(run.reference), every(run.indicated));
    };
    let pairs = run.reference.iter().zip(run.indicated);
    let counting = pairs.zip(weights).filter(|(_, weight)| **weight != 0.0);
    counting.step_by(stride).map(|(pair, _)| pair).unzip()
}

fn scan_part(
    fitted: &Evaluator,
    run: &Run,
    argument: Argument,
    offset: f64,
    stride: usize,
) -> Result<Scan, Error> {
    let len = run.reference.len();
    let period = fitted.series().period().value();
    let route = (len < WITHOUT_TABLE).then(|| Route {
        path: Path::Exact,
        set: InstructionSet::best(),
    });
    let mut scan = Scan::default();
    let mut used = 0usize;
    let mut block = vec![0.0; BLOCK.min(len)];
    for start in (0..len).step_by(BLOCK) {
        let run = run.part(start, len.min(start + BLOCK));
        let readings = run.readings(argument);
        let rest = &mut block[..run.reference.len()];
        let batch = Batch::apart(readings.angle, rest)?;
        fitted.run(Quantity::Error, route, Some(1), batch)?;
        residuals(run.indicated, run.reference, offset, period, rest);
        match run.weights {
            None => {
                let first = start.next_multiple_of(stride) - start;
                scan.sample.extend(rest.iter().skip(first).step_by(stride));
            }
            Some(weights) => {
                for (value, &weight) in rest.iter_mut().zip(weights) {
                    if weight == 0.0 {
                        *value = f64::NAN;
                        continue;
                    }
                    if used.is_multiple_of(stride) {
                        scan.sample.push(*value);
                    }
                    used += 1;
                }
            }
        }
        scan.largest = scan.largest.max(largest(rest));
    }
    Ok(scan)
}

/// The middle one of the absolute values of every so many, at most about `most` of them; of an
/// even number the greater middle one. NaN without any.
pub fn median_magnitude(values: &[f64], most: usize) -> f64 {
    let stride = (values.len() / most.max(1)).max(1);
    let mut sample: Vec<f64> = values.iter().step_by(stride).map(|x| x.abs()).collect();
    if sample.is_empty() {
        return f64::NAN;
    }
    let middle = sample.len() / 2;
    *sample.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// The greatest absolute value; NaN counts for nothing.
fn largest(values: &[f64]) -> f64 {
    // Several side by side: one comparison need not wait for the one before.
    const LANES: usize = 8;
    let mut most = [0.0f64; LANES];
    let (blocks, rest) = values.as_chunks::<LANES>();
    for block in blocks {
        for (most, value) in most.iter_mut().zip(block) {
            // A comparison with NaN is false.
            *most = if value.abs() > *most {
                value.abs()
            } else {
                *most
            };
        }
    }
    rest.iter()
        .map(|value| value.abs())
        .chain(most)
        .fold(0.0, f64::max)
}
