//! Moments against sums term by term, and their algebra.

use std::f64::consts::TAU;

use proptest::prelude::*;
use trueangle::angle::Period;
use trueangle::moments::accumulator::Accumulator;
use trueangle::moments::expected::Expected;
use trueangle::moments::spectrum::Spectrum;
use trueangle::readings::Readings;

/// Of the sum of weights: the series is exact to 3e-16, a block of sums adds some ulp.
const EXACT: f64 = 2e-15;

fn readings(seed: u64, len: usize, period: f64) -> [Vec<f64>; 3] {
    let mut state = seed;
    let mut uniform = || {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let angle = (0..len).map(|_| period * (4.0 * uniform() - 2.0)).collect();
    let error = (0..len)
        .map(|_| 0.02 * period * (uniform() - 0.5))
        .collect();
    let weights = (0..len).map(|_| 0.5 + uniform()).collect();
    [angle, error, weights]
}

fn sums(period: f64, highest: u32, data: &[Vec<f64>; 3], threads: usize) -> Accumulator {
    let mut sums = Accumulator::new(Period::new(period).unwrap(), 1.0, highest, 0.0);
    sums.update(
        Readings {
            angle: &data[0],
            error: &data[1],
            reference: None,
            weights: Some(&data[2]),
        },
        threads,
    );
    sums
}

#[test]
fn spectrum_is_the_sum_term_by_term() {
    for (period, highest) in [(TAU, 1), (TAU, 17), (360.0, 40), (1.0, 512), (65536.0, 3)] {
        let data = readings(1, 3000, period);
        let spectrum = Spectrum::new(&sums(period, highest, &data, 1), highest);
        let total: f64 = data[2].iter().sum();
        let turn = Period::new(period).unwrap();
        let at = |k: usize, values: &dyn Fn(usize) -> f64| {
            let (mut real, mut imaginary) = (0.0, 0.0);
            for (i, &x) in data[0].iter().enumerate() {
                let phase = Period::harmonic(turn.phase(x, 1.0), k as f64);
                let (sine, cosine) = trueangle::angle::sin_cos_turns(phase);
                real += values(i) * cosine;
                imaginary += values(i) * sine;
            }
            (real, imaginary)
        };
        for k in 0..=2 * highest as usize {
            let (real, imaginary) = at(k, &|i| data[2][i]);
            let found = spectrum.weight[k];
            assert!(
                (found.re - real).abs() < EXACT * total,
                "order {k} of {highest}"
            );
            assert!(
                (found.im - imaginary).abs() < EXACT * total,
                "order {k} of {highest}"
            );
        }
        for k in 0..=highest as usize {
            let (real, imaginary) = at(k, &|i| data[2][i] * data[1][i]);
            let found = spectrum.error[k];
            let scale = 0.01 * period * total;
            assert!(
                (found.re - real).abs() < EXACT * scale,
                "order {k} of {highest}"
            );
            assert!(
                (found.im - imaginary).abs() < EXACT * scale,
                "order {k} of {highest}"
            );
        }
        let squares: f64 = data[1].iter().zip(&data[2]).map(|(y, w)| w * y * y).sum();
        assert!((spectrum.squares / squares - 1.0).abs() < 1e-14);
        assert_eq!(spectrum.count, 3000);
    }
}

#[test]
fn threads_do_not_change_a_bit() {
    let data = readings(2, 600_000, 360.0);
    let one = Spectrum::new(&sums(360.0, 9, &data, 1), 9);
    for threads in [2, 3, 8] {
        let more = Spectrum::new(&sums(360.0, 9, &data, threads), 9);
        assert_eq!(one.weight, more.weight);
        assert_eq!(one.error, more.error);
        assert_eq!(one.squares, more.squares);
    }
}

#[test]
fn no_readings_change_nothing() {
    let data = readings(4, 300, 360.0);
    let mut found = sums(360.0, 5, &data, 1);
    let before = found.store();
    for threads in [1, 2] {
        let none = Readings {
            angle: &[],
            error: &[],
            reference: None,
            weights: None,
        };
        found.update(none, threads);
        assert_eq!(found.count(), 300);
        assert_eq!(found.store(), before);
    }
}

#[test]
fn equal_readings_lose_no_digits() {
    // Plain summation of two million equal terms would be off by some 1e-11.
    let len = 2_000_000;
    let data = [vec![0.3; len], vec![0.1; len], vec![1.1; len]];
    let spectrum = Spectrum::new(&sums(360.0, 5, &data, 1), 5);
    let expected = len as f64 * 1.1;
    assert!((spectrum.weight[0].re / expected - 1.0).abs() < 1e-12);
    let expected = expected * 0.1;
    assert!((spectrum.error[0].re / expected - 1.0).abs() < 1e-12);
}

#[test]
fn wild_angles_do_no_harm() {
    let data = [vec![1e300, -1e300, 1e18, 0.0], vec![0.0; 4], vec![1.0; 4]];
    let spectrum = Spectrum::new(&sums(TAU, 3, &data, 1), 3);
    assert!((spectrum.weight[0].re - 4.0).abs() < 1e-14);
}

proptest! {
    #[test]
    fn merging_is_adding(
        seed in any::<u64>(),
        cut in 0usize..500,
        centre in -170.0f64..170.0,
        turned in any::<bool>(),
    ) {
        let data = readings(seed, 500, 360.0);
        let whole = Spectrum::new(&sums(360.0, 6, &data, 1), 6);
        let parts = [0..cut, cut..500].map(|range| data.each_ref().map(|v| v[range.clone()].to_vec()));
        // The second part is counted from a centre of its own.
        let mut second = Accumulator::new(Period::new(360.0).unwrap(), 1.0, 6, centre);
        second.update(
            Readings {
                angle: &parts[1][0],
                error: &parts[1][1],
                reference: None,
                weights: Some(&parts[1][2]),
            },
            1,
        );
        let mut first = sums(360.0, 6, &parts[0], 1);
        if turned {
            // The merge then counts from the other centre: come back for the comparison.
            let mut zero = Accumulator::new(Period::new(360.0).unwrap(), 1.0, 6, 0.0);
            second.merge(&first);
            zero.merge(&second);
            first = zero;
        } else {
            first.merge(&second);
        }
        let merged = Spectrum::new(&first, 6);
        let total = whole.weight[0].re;
        for (a, b) in whole.weight.iter().zip(&merged.weight) {
            prop_assert!((a - b).norm() < EXACT * total);
        }
        // Errors counted from a centre up to 170 away lose its digits, no more.
        for (a, b) in whole.error.iter().zip(&merged.error) {
            prop_assert!((a - b).norm() < EXACT * total * (4.0 + centre.abs()));
        }
        prop_assert!((whole.squares - merged.squares).abs() < EXACT * total * 180.0 * 180.0);
        prop_assert_eq!(whole.count, merged.count);
    }
}

/// Stretches of the angle have the sums of their own readings, however many there are: few are
/// added one by one, many wait for each other.
#[test]
fn stretches_have_the_sums_of_their_own_readings() {
    let (period, highest) = (360.0, 5);
    let ends = [-400.0, 0.0, 77.7];
    for len in [300, 400_000] {
        let data = readings(7, len, period);
        let empty = || Accumulator::new(Period::new(period).unwrap(), 1.0, highest, 0.0);
        let mut stretches: Vec<_> = (0..=ends.len()).map(|_| empty()).collect();
        let all = Readings {
            angle: &data[0],
            error: &data[1],
            reference: None,
            weights: Some(&data[2]),
        };
        Accumulator::update_stretches(&mut stretches, &ends, all);
        for (i, found) in stretches.iter().enumerate() {
            let (low, high) = (
                if i == 0 { f64::MIN } else { ends[i - 1] },
                ends.get(i).copied().unwrap_or(f64::MAX),
            );
            let inside = |k: &usize| data[0][*k] > low && data[0][*k] <= high;
            let pick = |column: &Vec<f64>| -> Vec<f64> {
                (0..len).filter(inside).map(|k| column[k]).collect()
            };
            let expected = sums(period, highest, &data.each_ref().map(pick), 1);
            assert_eq!(found.count(), expected.count());
            let scale = expected.weight();
            assert!((found.weight() - scale).abs() <= EXACT * scale);
            assert!((found.squares() - expected.squares()).abs() <= EXACT * scale * period);
            let pairs = [found, &expected].map(|sums| Spectrum::new(sums, highest));
            for (a, b) in pairs[0].error.iter().zip(&pairs[1].error) {
                assert!((a - b).norm() <= EXACT * scale * period, "{i}: {a} {b}");
            }
        }
    }
}

/// Of every segment the greatest and least angle and error, whether its readings wait for each
/// other or not, and wherever parts count errors from.
#[test]
fn extremes_are_those_of_a_loop() {
    /// Of angles of half a turn that come and go as places in a segment.
    const ROUNDING: f64 = 1e-12;
    let noted = |data: &[Vec<f64>; 3], some: std::ops::Range<usize>, centre| {
        let mut sums = Accumulator::new(Period::new(360.0).unwrap(), 1.0, 3, centre);
        let mut waiting = sums.waiting(some.len(), false).noting();
        let readings = Readings {
            angle: &data[0][some.clone()],
            error: &data[1][some],
            reference: None,
            weights: None,
        };
        sums.update_piece(readings, &mut waiting);
        sums.settle(&mut waiting);
        sums
    };
    for len in [40, 20_000] {
        let data = readings(11, len, 360.0);
        let mut sums = noted(&data, 0..len / 3, 0.5);
        sums.merge(&noted(&data, len / 3..len, 2.5));
        let count = sums.moments().len();
        let mut slow = vec![None; count];
        for (x, &y) in data[0].iter().zip(&data[1]) {
            let x = x - 360.0 * (x / 360.0).round();
            let segment = ((x / 360.0 + 0.5) * count as f64) as usize;
            let [high, low, most, least] = slow[segment].get_or_insert([x, x, y, y]);
            (*high, *low) = (high.max(x), low.min(x));
            (*most, *least) = (most.max(y), least.min(y));
        }
        let slow: Vec<[f64; 4]> = slow.into_iter().flatten().collect();
        let found = sums.extremes();
        assert_eq!(found.len(), slow.len());
        for (found, slow) in found.as_flattened().iter().zip(slow.as_flattened()) {
            assert!((found - slow).abs() < 360.0 * ROUNDING, "{found} {slow}");
        }
    }
}

/// How far the farthest reading that counts is off what is expected: by a loop, where readings
/// are many enough to wait for each other.
#[test]
fn the_farthest_reading_is_that_of_a_loop() {
    const ROUNDING: f64 = 1e-12;
    let data = readings(12, 40_000, 360.0);
    let (constant, orders, coefficients) = (0.2, [1, 5], [1.0, 0.5, 0.0, -0.3]);
    for (len, waits) in [(100, false), (40_000, true)] {
        let mut errors = data[1][..len].to_vec();
        let mut weights = data[2][..len].to_vec();
        (errors[70], weights[70]) = (50.0, 0.0);
        errors[31] = -20.0;
        let mut sums = Accumulator::new(Period::new(360.0).unwrap(), 1.0, 5, 0.0);
        let segments = sums.moments().len();
        let expected = Expected::new(segments, constant, &orders, &coefficients);
        let readings = Readings {
            angle: &data[0][..len],
            error: &errors,
            reference: None,
            weights: Some(&weights),
        };
        let found = sums.update_watched(readings, 2, &expected);
        let off = |i: usize| {
            let x = data[0][i].to_radians();
            let one = coefficients[0] * x.cos() + coefficients[1] * x.sin();
            let five = coefficients[3] * (5.0 * x).sin();
            (errors[i] - constant - one - five).abs()
        };
        let counting = (0..len).filter(|&i| weights[i] > 0.0);
        let slow = counting.map(off).fold(0.0, f64::max);
        if waits {
            let missed = expected.missed() + ROUNDING;
            assert!((found - slow).abs() < missed, "{found} {slow}");
        } else {
            assert_eq!(found, f64::INFINITY);
        }
    }
}
