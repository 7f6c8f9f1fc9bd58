//! Readings of a log: missing ones left out, extremes noted, block by block.

use super::accumulator::Accumulator;
use crate::angle::Period;
use crate::check::all_finite;
use crate::readings::{Argument, Run};

/// Readings taken together: they stay in the first cache.
const BLOCK: usize = 1024;

/// Adds the readings of which both angles are known; returns how many those are.
///
/// `fresh` makes the accumulator of a run from the centre of its first readings.
pub fn add_known(
    sums: &mut Option<Accumulator>,
    fresh: impl Fn(f64) -> Accumulator,
    period: Period,
    run: Run<'_>,
    argument: Argument,
) -> usize {
    let (mut known, mut waiting) = (0, None);
    let all = run.reference.len();
    let blocks = run.reference.chunks(BLOCK);
    for (mut reference, mut indicated) in blocks.zip(run.indicated.chunks(BLOCK)) {
        let kept: (Vec<f64>, Vec<f64>);
        if !(all_finite(reference) && all_finite(indicated)) {
            let pairs = reference.iter().zip(indicated);
            kept = pairs
                .filter(|(a, b)| a.is_finite() && b.is_finite())
                .unzip();
            (reference, indicated) = (&kept.0, &kept.1);
        }
        if reference.is_empty() {
            continue;
        }
        known += reference.len();
        let part = Run {
            reference,
            indicated,
            weights: None,
        };
        let readings = part.readings(argument);
        let sums = sums.get_or_insert_with(|| fresh(readings.centre(period)));
        let waiting = waiting.get_or_insert_with(|| sums.waiting(all, false).noting());
        sums.update_piece(readings, waiting);
    }
    if let (Some(sums), Some(waiting)) = (sums, &mut waiting) {
        sums.settle(waiting);
    }
    known
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Missing readings change nothing but the count; neither does what cuts the blocks.
    #[test]
    fn missing_readings_are_left_out() {
        let period = Period::new(360.0).unwrap();
        // One centre for all: that of the first readings depends on which they are.
        let fresh = |_| Accumulator::new(period, 1.0, 3, 0.0);
        let mut reference: Vec<f64> = (0..5000).map(|i| f64::from(i) * 0.7).collect();
        let mut indicated: Vec<f64> = reference.iter().map(|x| x + 0.01 * x.cos()).collect();
        let sums_of = |reference: &[f64], indicated: &[f64]| {
            let mut sums = None;
            let run = Run {
                reference,
                indicated,
                weights: None,
            };
            let argument = Argument::Reference;
            let known = add_known(&mut sums, fresh, period, run, argument);
            let sums = sums.unwrap();
            // None still waits: each adds its weight of 1.
            assert_eq!(sums.weight(), known as f64);
            (sums.store(), known, sums.extremes())
        };
        let (whole, known, extremes) = sums_of(&reference, &indicated);
        assert_eq!(known, 5000);
        // Of every degree there are readings, whose greatest error is that of the cosine.
        let greatest = extremes
            .iter()
            .fold(0.0f64, |most, [_, _, y, _]| most.max(*y));
        assert!((greatest - 0.01).abs() < 1e-12, "{greatest}");
        for at in [3000, 1024, 0] {
            reference.insert(at, f64::NAN);
            indicated.insert(at, 1.0);
            reference.insert(at, 2.0);
            indicated.insert(at, f64::INFINITY);
        }
        let (gaps, known, same) = sums_of(&reference, &indicated);
        assert_eq!(known, 5000);
        assert_eq!(same, extremes);
        /// Of sums of up to 5000 numbers around 1, added in other groups.
        const ROUNDING: f64 = 1e-10;
        for (a, b) in gaps.iter().zip(&whole) {
            assert!(a == b || (a - b).abs() < ROUNDING, "{a} {b}");
        }
    }
}
