//! Readings of a log: missing ones left out, the travel noted, block by block.

use super::accumulator::Accumulator;
use crate::angle::Period;
use crate::check::all_finite;
use crate::readings::{Argument, Run};
use crate::simd::{InstructionSet, Kernel, Lanes, dispatch};

/// Readings taken together: they stay in the first cache.
const BLOCK: usize = 1024;

/// Every so many readings one is looked at for the travel covered.
const STRIDE: usize = 16;

/// Adds the readings of which both angles are known; returns how many those are.
///
/// `travel` counts looked-at readings by their place in the turn. `fresh` makes the
/// accumulator of a run from the centre of its first readings.
pub fn add_known(
    sums: &mut Option<Accumulator>,
    fresh: impl Fn(f64) -> Accumulator,
    period: Period,
    run: Run<'_>,
    argument: Argument,
    travel: &mut [i64],
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
        note(travel, readings.angle, period);
        let sums = sums.get_or_insert_with(|| fresh(readings.centre(period)));
        let waiting = waiting.get_or_insert_with(|| sums.waiting(all, false));
        sums.update_piece(readings, waiting);
    }
    if let (Some(sums), Some(waiting)) = (sums, &mut waiting) {
        sums.settle(waiting);
    }
    known
}

/// Counts every `STRIDE`-th angle at its place in the turn.
fn note(travel: &mut [i64], angles: &[f64], period: Period) {
    let turn = 1.0 / period.value();
    let note = Note {
        travel,
        angles,
        turn,
    };
    dispatch(InstructionSet::best(), note);
}

/// The loop of `note`, where the processor rounds down in one instruction.
struct Note<'a> {
    travel: &'a mut [i64],
    angles: &'a [f64],
    turn: f64,
}

impl Kernel for Note<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let places = self.travel.len() as f64;
        let last = self.travel.len().saturating_sub(1);
        for angle in self.angles.iter().step_by(STRIDE) {
            let part = angle * self.turn;
            let place = ((part - part.floor()) * places) as usize;
            // A tiny negative angle rounds up to the whole turn.
            if let Some(count) = self.travel.get_mut(place.min(last)) {
                *count += 1;
            }
        }
    }
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
            let (mut sums, mut travel) = (None, [0; 360]);
            let run = Run {
                reference,
                indicated,
                weights: None,
            };
            let argument = Argument::Reference;
            let known = add_known(&mut sums, fresh, period, run, argument, &mut travel);
            let sums = sums.unwrap();
            // None still waits: each adds its weight of 1.
            assert_eq!(sums.weight(), known as f64);
            (sums.store(), known, travel)
        };
        let (whole, known, travel) = sums_of(&reference, &indicated);
        assert_eq!(known, 5000);
        assert!(travel.iter().sum::<i64>() >= 5000 / STRIDE as i64);
        for at in [3000, 1024, 0] {
            reference.insert(at, f64::NAN);
            indicated.insert(at, 1.0);
            reference.insert(at, 2.0);
            indicated.insert(at, f64::INFINITY);
        }
        let (gaps, known, _) = sums_of(&reference, &indicated);
        assert_eq!(known, 5000);
        /// Of sums of up to 5000 numbers around 1, added in other groups.
        const ROUNDING: f64 = 1e-10;
        for (a, b) in gaps.iter().zip(&whole) {
            assert!((a - b).abs() < ROUNDING, "{a} {b}");
        }
    }

    #[test]
    fn travel_is_counted_by_place() {
        let period = Period::new(360.0).unwrap();
        let mut travel = [0; 360];
        let mut angles = vec![0.0; 4 * STRIDE];
        angles[0] = 90.5;
        angles[STRIDE] = -0.5;
        angles[2 * STRIDE] = 720.25;
        angles[3 * STRIDE] = -1e-300;
        note(&mut travel, &angles, period);
        let places: Vec<_> = (0..360).filter(|&i| travel[i] > 0).collect();
        assert_eq!(places, [0, 90, 359]);
        assert_eq!(travel[359], 2);
    }
}
