//! Statistics of angles on the circle: agreement, differences, the stretch travelled.

use std::f64::consts::TAU;

use crate::simd::ROUNDER;

/// Length (0 to 1) of the mean of unit vectors at `indicated - reference`: 1 where all
/// differences are one, near 0 where they are spread over the turn.
pub fn resultant(indicated: &[f64], reference: &[f64], period: f64) -> f64 {
    let (mut sine, mut cosine) = (0.0, 0.0);
    for (&x, &y) in indicated.iter().zip(reference) {
        let (s, c) = (turns(x - y, period) * TAU).sin_cos();
        sine += s;
        cosine += c;
    }
    sine.hypot(cosine) / indicated.len().max(1) as f64
}

/// `fitted[i]` becomes `indicated - reference - fitted - offset`, wrapped into half a
/// turn: the residuals of a fit.
pub fn residuals(
    indicated: &[f64],
    reference: &[f64],
    offset: f64,
    period: f64,
    fitted: &mut [f64],
) {
    let per_turn = 1.0 / period;
    for ((value, &x), &y) in fitted.iter_mut().zip(indicated).zip(reference) {
        let rest = x - y - *value - offset;
        *value = rest - period * whole_number(rest * per_turn);
    }
}

/// How two angles go together, reading after reading: what bounds any test of them. Lengths are
/// in turns.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Following {
    /// The longest step between readings of `reference`, the shorter way around.
    pub step: f64,
    /// How many are longer than the length asked for.
    pub long_steps: usize,
    /// The most by which `indicated - reference` changes between two readings.
    pub slip: f64,
    /// From the least to the greatest of these differences, followed over the turns.
    pub spread: f64,
    /// From the least to the greatest reference, followed likewise.
    pub travel: f64,
    /// No shorter stretch of that travel holds half of the readings.
    pub half: f64,
    /// The greatest reference, its sign left away.
    pub largest: f64,
}

/// Bins of the travel in which its densest half is sought.
const TRAVEL_BINS: usize = 64;

/// Compares every `stride`-th reading of two angles, and steps with the length `long` (in turns).
pub fn following(
    indicated: &[f64],
    reference: &[f64],
    period: f64,
    stride: usize,
    long: f64,
) -> Following {
    let mut found = Following::default();
    let per_turn = 1.0 / period;
    let part = |angle: f64| angle * per_turn - whole_number(angle * per_turn);
    let stride = stride.max(1);
    let count = reference.len().div_ceil(stride);
    let readings = || {
        let pairs = reference.iter().zip(indicated).step_by(stride);
        let mut before = None;
        // Place and difference, followed from reading to reading.
        let (mut place, mut apart) = (0.0, 0.0);
        pairs.map(move |(&y, &x)| {
            let (last_y, last_x) = before.replace((y, x)).unwrap_or((y, x));
            let step = part(y - last_y);
            let slip = part((x - last_x) - (y - last_y));
            place += step;
            apart += slip;
            (y, step.abs(), slip.abs(), place, apart)
        })
    };
    let (mut low, mut high, mut least, mut most) = (0.0f64, 0.0f64, 0.0f64, 0.0f64);
    for (y, step, slip, place, apart) in readings() {
        found.step = found.step.max(step);
        found.long_steps += usize::from(step > long);
        found.slip = found.slip.max(slip);
        (low, high) = (low.min(place), high.max(place));
        (least, most) = (least.min(apart), most.max(apart));
        found.largest = found.largest.max(y.abs() * per_turn);
    }
    found.spread = most - least;
    found.travel = high - low;
    let mut bins = [0; TRAVEL_BINS];
    let width = found.travel / TRAVEL_BINS as f64;
    for (.., place, _) in readings() {
        bins[(((place - low) / width) as usize).min(TRAVEL_BINS - 1)] += 1;
    }
    // What holds half of the readings touches as many bins in a row as do so; its ends may lie just
    // within the outer two.
    let (mut first, mut held, mut fewest) = (0, 0, TRAVEL_BINS);
    for (last, &bin) in bins.iter().enumerate() {
        held += bin;
        while held >= count / 2 && first <= last {
            fewest = fewest.min(last + 1 - first);
            held -= bins[first];
            first += 1;
        }
    }
    found.half = fewest.saturating_sub(2) as f64 * width;
    found
}

/// Stretch of the turn that was travelled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Where it begins, in `[0, period)`.
    pub start: f64,
    /// Where it ends; `start + period` at most.
    pub stop: f64,
    /// Whether nothing is missing.
    pub full: bool,
}

/// Beyond so many angles they are counted into bins instead of sorted.
const SORTED: usize = 4096;

/// One of so many angles is looked at first: where they lie everywhere, that is all.
const FIRST: usize = 32;

/// An arc without readings counts as missing travel when it is wider than this part of a
/// turn (20 deg) ...
const MISSING: f64 = 20.0 / 360.0;

/// ... and than chance leaves between n random positions: the widest of n exponential
/// gaps exceeds (ln n + 4) times their mean in 2 % of cases.
const CHANCE: f64 = 4.0;

/// The turn without its widest gap, or the whole turn where no gap is missing travel.
///
/// Its ends are the first and the last angle. Where one of every so many of more than `most`
/// angles lies everywhere, the others are not looked at.
pub fn covered_span(angles: &[&[f64]], period: f64, most: usize) -> Span {
    let all: usize = angles.iter().map(|a| a.len()).sum();
    let stride = (all / most.max(1)).max(1);
    let fractions = |stride| {
        let some = angles.iter().flat_map(move |a| a.iter().step_by(stride));
        some.map(|&x| {
            let part = turns(x, period);
            if part < 0.0 { part + 1.0 } else { part }
        })
    };
    let (mut places, bins): (Vec<f64>, usize) = if all <= SORTED {
        (fractions(1).collect(), usize::MAX)
    } else {
        // First and last place of every bin.
        let mut seen = vec![(f64::INFINITY, f64::NEG_INFINITY); SORTED];
        let mut look = |stride| -> (Vec<f64>, usize) {
            for part in fractions(stride) {
                let (first, last) = &mut seen[(part * SORTED as f64) as usize % SORTED];
                (*first, *last) = (first.min(part), last.max(part));
            }
            let bins = seen.iter().filter(|(first, last)| first <= last);
            let places: Vec<_> = bins.flat_map(|&(first, last)| [first, last]).collect();
            let count = places.len() / 2;
            (places, count)
        };
        // Gaps only shrink with every angle: where none is wide, no other need be looked at.
        let first = look(FIRST * stride);
        if widest_gap(&first.0).is_some_and(|(gap, _)| gap <= MISSING) {
            first
        } else {
            look(1)
        }
    };
    places.sort_unstable_by(f64::total_cmp);
    places.dedup();
    let (start, stop, full) = missing_travel(&places, bins)
        .map_or((0.0, 1.0, true), |(start, stop)| (start, stop, false));
    Span {
        start: start * period,
        stop: stop * period,
        full,
    }
}

/// The widest gap between ascending places of a turn, and where it ends.
fn widest_gap(places: &[f64]) -> Option<(f64, f64)> {
    let (&first, &last) = (places.first()?, places.last()?);
    let across = (first + 1.0 - last, first);
    let gaps = places.windows(2).map(|pair| (pair[1] - pair[0], pair[1]));
    let wider = |best: (f64, f64), next: (f64, f64)| if next.0 > best.0 { next } else { best };
    Some(gaps.fold(across, wider))
}

/// Ends of the stretch outside the widest gap, where that is missing travel of so many `bins`.
fn missing_travel(places: &[f64], bins: usize) -> Option<(f64, f64)> {
    let (gap, start) = widest_gap(places)?;
    let travelled = 1.0 - gap;
    let count = places.len().min(bins) as f64;
    let chance = travelled / (count - 1.0).max(1.0) * (count.ln() + CHANCE);
    (gap > MISSING.max(chance)).then_some((start, start + travelled))
}

/// The whole number nearest to `x`, in two additions that every processor does for several
/// numbers at once; `x` is below 2^51.
#[inline(always)]
pub fn whole_number(x: f64) -> f64 {
    (x + ROUNDER) - ROUNDER
}

/// Part of a turn in `[-1/2, 1/2]`.
fn turns(angle: f64, period: f64) -> f64 {
    let part = angle / period;
    part - whole_number(part)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agreement_is_1_for_one_difference_and_0_for_a_full_turn_of_them() {
        let reference = [10.0, 350.0, 725.0, -80.0];
        let indicated = reference.map(|x| x + 179.5);
        assert!((resultant(&indicated, &reference, 360.0) - 1.0).abs() < 1e-12);
        let spread = [10.0, 440.0, 905.0, 190.0];
        assert!(resultant(&spread, &reference, 360.0) < 1e-12);
    }

    /// Against the slow form of every number, of paths drawn at random.
    #[test]
    fn what_two_angles_do_together_is_measured_or_bounded() {
        let mut state = 7u64;
        let mut draw = move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        for case in 0..200 {
            let stride = 1 + case % 3;
            let pace = 0.3 * draw();
            let (mut place, mut all, mut off) = (5.0 * draw(), Vec::new(), Vec::new());
            for _ in 0..60 + case {
                all.push(place);
                off.push(0.2 * draw());
                // Some rest at one place for a while.
                place += if draw() < 0.3 {
                    0.0
                } else {
                    pace * (draw() - 0.3)
                };
            }
            let (y, e): (Vec<f64>, Vec<f64>) = all.iter().copied().zip(off).step_by(stride).unzip();
            let reference: Vec<f64> = all.iter().map(|x| 360.0 * x).collect();
            let mut indicated = reference.clone();
            for (i, e) in e.iter().enumerate() {
                indicated[i * stride] += 360.0 * (e + f64::from(i as u32 % 3));
            }
            let found = following(&indicated, &reference, 360.0, stride, 0.1);
            let steps: Vec<f64> = y.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
            let slips = e.windows(2).map(|w| (w[1] - w[0]).abs());
            let range = |v: &[f64]| {
                let (low, high) = v
                    .iter()
                    .fold((f64::MAX, f64::MIN), |(a, b), &x| (a.min(x), b.max(x)));
                high - low
            };
            let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-9, "{a} is not {b}");
            near(found.step, steps.iter().copied().fold(0.0, f64::max));
            near(found.slip, slips.fold(0.0, f64::max));
            near(found.spread, range(&e));
            near(found.travel, range(&y));
            assert_eq!(found.long_steps, steps.iter().filter(|&&s| s > 0.1).count());
            near(found.largest, y.iter().fold(0.0f64, |a, x| a.max(x.abs())));
            let n = y.len();
            let mut sorted = y.clone();
            sorted.sort_by(f64::total_cmp);
            let held = n / 2;
            let shortest = (0..=n - held)
                .map(|i| sorted[i + held - 1] - sorted[i])
                .fold(f64::INFINITY, f64::min);
            assert!(
                found.half <= shortest + 1e-9,
                "{} of {shortest}",
                found.half
            );
            assert!(
                found.half >= shortest - 3.0 * found.travel / 64.0,
                "{}",
                found.half
            );
        }
    }

    #[test]
    fn residuals_are_wrapped_whatever_the_turns() {
        let mut fitted = [0.5, -0.25, 0.0];
        residuals(
            &[362.0, -719.0, 179.0],
            &[1.0, 1.0, 0.0],
            0.5,
            360.0,
            &mut fitted,
        );
        for (got, wanted) in fitted.iter().zip([0.0, -0.25, 178.5]) {
            assert!((got - wanted).abs() < 1e-12, "{got} is not {wanted}");
        }
    }

    #[test]
    fn bins_find_the_span_that_sorting_finds() {
        let few: Vec<f64> = (0..4000)
            .map(|i| 300.0 + 190.0 * f64::from(i) / 3999.0)
            .collect();
        let many: Vec<f64> = (0..40_000)
            .map(|i| 300.0 + 190.0 * f64::from(i) / 39_999.0)
            .collect();
        let (exact, binned) = (
            covered_span(&[&few], 360.0, usize::MAX),
            covered_span(&[&many], 360.0, usize::MAX),
        );
        assert!(!exact.full && !binned.full);
        assert!((exact.start - 300.0).abs() < 1e-9 && (exact.stop - 490.0).abs() < 1e-9);
        assert!((binned.start - 300.0).abs() < 1e-9 && (binned.stop - 490.0).abs() < 1e-9);
        // One angle at each end, far from those that are looked at first.
        let mut more = many;
        more.splice(1..1, [299.99, 490.01]);
        let wider = covered_span(&[&more], 360.0, 1 << 10);
        assert!((wider.start - 299.99).abs() < 1e-9 && (wider.stop - 490.01).abs() < 1e-9);
    }

    /// A gap between the angles that are looked at first is closed by the others, or is not.
    #[test]
    fn a_first_look_misses_no_travel() {
        let sweep = |turn: f64| -> Vec<f64> {
            (0..40_000)
                .map(|i| turn * f64::from(i) / 40_000.0)
                .collect()
        };
        assert!(covered_span(&[&sweep(359.0)], 360.0, usize::MAX).full);
        let arc = covered_span(&[&sweep(339.0)], 360.0, usize::MAX);
        assert!(!arc.full && (arc.stop - 339.0).abs() < 0.1);
        // In each 32 readings: one below 180 deg, all others above it.
        let shy: Vec<f64> = (0..40_000)
            .map(|i| f64::from(i) * 0.004_5 + if i % 32 == 0 { 0.0 } else { 180.0 })
            .collect();
        assert!(covered_span(&[&shy], 360.0, usize::MAX).full);
    }

    #[test]
    fn one_place_is_no_travel_and_none_is_a_full_turn() {
        assert_eq!(covered_span(&[&[90.0, 450.0]], 360.0, 2).stop, 90.0);
        assert!(covered_span(&[], 360.0, 2).full);
    }
}
