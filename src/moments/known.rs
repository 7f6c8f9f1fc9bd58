//! Readings of a log: missing ones left out, the travel noted, block by block.

use super::accumulator::Accumulator;
use super::readings::Readings;
use crate::angle::Period;

/// Readings taken together: they stay in the first cache.
const BLOCK: usize = 1024;

/// Every so many readings one is looked at for the travel covered.
const STRIDE: usize = 16;

/// Both angles of readings, some of which may be missing (not finite).
#[derive(Clone, Copy, Debug)]
pub struct Angles<'a> {
    /// True angles.
    pub reference: &'a [f64],
    /// Indicated angles, as many.
    pub indicated: &'a [f64],
    /// True when the error is a function of the indicated angle.
    pub of_indicated: bool,
}

/// Adds the readings of which both angles are known; returns how many those are.
///
/// `travel` counts looked-at readings by their place in the turn. `fresh` makes the
/// accumulator of a run from the centre of its first readings.
pub fn add_known(
    sums: &mut Option<Accumulator>,
    fresh: impl Fn(f64) -> Accumulator,
    period: Period,
    angles: Angles<'_>,
    travel: &mut [i64],
) -> usize {
    let mut known = 0;
    let blocks = angles.reference.chunks(BLOCK);
    for (mut all, mut said) in blocks.zip(angles.indicated.chunks(BLOCK)) {
        let kept: (Vec<f64>, Vec<f64>);
        if !(all_finite(all) && all_finite(said)) {
            let pairs = all.iter().zip(said);
            kept = pairs
                .filter(|(a, b)| a.is_finite() && b.is_finite())
                .unzip();
            (all, said) = (&kept.0, &kept.1);
        }
        if all.is_empty() {
            continue;
        }
        known += all.len();
        let readings = Readings {
            angle: if angles.of_indicated { said } else { all },
            error: said,
            reference: Some(all),
            weights: None,
        };
        note(travel, readings.angle, period);
        sums.get_or_insert_with(|| fresh(readings.centre(period)))
            .update(readings, 1);
    }
    known
}

/// Counts every `STRIDE`-th angle at its place in the turn.
fn note(travel: &mut [i64], angles: &[f64], period: Period) {
    let (turn, places) = (1.0 / period.value(), travel.len() as f64);
    for angle in angles.iter().step_by(STRIDE) {
        let part = angle * turn;
        let place = ((part - part.floor()) * places) as usize;
        // A tiny negative angle rounds up to the whole turn.
        if let Some(count) = travel.get_mut(place.min(travel.len().saturating_sub(1))) {
            *count += 1;
        }
    }
}

/// Whether every value is finite; told without a branch for each.
pub fn all_finite(values: &[f64]) -> bool {
    let finite = |part: &[f64]| {
        let bad = part.iter().map(|v| i64::from(!v.is_finite()));
        bad.fold(0, |any, one| any | one) == 0
    };
    values.chunks(BLOCK).all(finite)
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
            let angles = Angles {
                reference,
                indicated,
                of_indicated: false,
            };
            let known = add_known(&mut sums, fresh, period, angles, &mut travel);
            (sums.unwrap().store(), known, travel)
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

    #[test]
    fn one_value_that_is_not_finite_is_seen() {
        let mut values = vec![1.0; 3 * BLOCK + 7];
        assert!(all_finite(&values) && all_finite(&[]));
        for (at, bad) in [
            (0, f64::NAN),
            (2000, f64::INFINITY),
            (3 * BLOCK + 6, f64::NEG_INFINITY),
        ] {
            values[at] = bad;
            assert!(!all_finite(&values));
            values[at] = -f64::MAX;
        }
        assert!(all_finite(&values));
    }
}
