//! Readings of two channels that are not on their curve: at a rail, or dropped out.

use super::curve::Curve;
use super::likelihood::{Readings, fit};
use crate::error::Error;
use crate::linear::MAD_TO_SIGMA;

/// The sine channel is at its rail.
pub const SINE_RAIL: u8 = 1;
/// The cosine channel is at its rail.
pub const COSINE_RAIL: u8 = 2;
/// Both channels are off the curve.
pub const DROPOUT: u8 = 4;

/// Equal extremes from which a channel may be clipped, and how often those of a sine at rest at its
/// top are as the next code: its density falls as the square root.
const CLIPPED: usize = 8;
const TOP_CODE: f64 = 1.0 + std::f64::consts::SQRT_2;

/// Distance of a rail from the next value, as a share of the span of all.
const NEAR: f64 = 0.1;

/// Distance from the curve, in radii and in robust standard deviations, from which a reading is a
/// dropout, and the latter over the median of the distances.
pub(super) const OFF: f64 = 0.4;
const DEVIATIONS: f64 = 6.0 * MAD_TO_SIGMA;

/// Places that the curve is fitted to, and fits without the dropouts of the one before.
const LOOKED_AT: usize = 4096;
const FITS: usize = 5;

/// Bits of the narrowest counter that may wrap.
const NARROWEST: i32 = 8;

/// Flags of every reading, and the curve of those without one; None where they settle none.
///
/// A pair of values counts once however often it was read: a rest has no more weight than a place
/// passed. The curve is an ellipse, fitted without readings at a rail, and again without those that
/// are off it.
pub fn faults(sine: &[f64], cosine: &[f64]) -> Result<(Vec<u8>, Option<Curve>), Error> {
    crate::check::same_length("cosine", cosine.len(), "sine", sine.len())?;
    let mut order: Vec<usize> = (0..sine.len()).collect();
    order.sort_by(|&i, &j| {
        let first = sine[i].total_cmp(&sine[j]);
        first.then(cosine[i].total_cmp(&cosine[j]))
    });
    let is_same = |i: usize, j: usize| sine[i] == sine[j] && cosine[i] == cosine[j];
    let mut places = order.clone();
    places.dedup_by(|a, b| is_same(*a, *b));
    let at = |values: &[f64]| -> Vec<f64> { places.iter().map(|&i| values[i]).collect() };
    let (y, x) = (at(sine), at(cosine));
    let mut flags = vec![0; places.len()];
    mark_rails(&y, SINE_RAIL, &mut flags);
    mark_rails(&x, COSINE_RAIL, &mut flags);
    let curve = mark_dropouts(&y, &x, &mut flags)?;
    let mut found = vec![0; sine.len()];
    let mut place = 0;
    for &i in &order {
        if !is_same(i, places[place]) {
            place += 1;
        }
        found[i] = flags[place];
    }
    Ok((found, curve))
}

/// Mark the greatest and the least value, where more places have it than the next code explains.
fn mark_rails(values: &[f64], rail: u8, flags: &mut [u8]) {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let codes: Vec<(f64, usize)> = sorted
        .chunk_by(|a, b| a == b)
        .map(|equal| (equal[0], equal.len()))
        .collect();
    if codes.len() < 3 {
        return;
    }
    let mut steps: Vec<f64> = codes.windows(2).map(|pair| pair[1].0 - pair[0].0).collect();
    steps.sort_by(f64::total_cmp);
    let step = steps[steps.len() / 2];
    let span = sorted[sorted.len() - 1] - sorted[0];
    let last = codes.len() - 1;
    for (end, next) in [(0, 1), (last, last - 1)] {
        let (code, count) = codes[end];
        let near = codes.iter().filter(|c| (c.0 - code).abs() <= 1.5 * step);
        let beside = near.map(|c| c.1).sum::<usize>() - count;
        // Three standard deviations of a count above what the next code explains.
        let most = TOP_CODE * beside as f64;
        let is_often = count >= CLIPPED && count as f64 > most + 3.0 * most.sqrt();
        // A channel reaches its rail from near it; a value far off the others is a dropout.
        if is_often && (codes[next].0 - code).abs() < NEAR * span {
            for (flag, value) in flags.iter_mut().zip(values) {
                *flag |= rail * u8::from(*value == code);
            }
        }
    }
}

/// Mark places off the curve of the others; none where they settle no curve.
fn mark_dropouts(sine: &[f64], cosine: &[f64], flags: &mut [u8]) -> Result<Option<Curve>, Error> {
    let mut curve = None;
    for _ in 0..FITS {
        let kept: Vec<usize> = (0..sine.len()).filter(|&i| flags[i] == 0).collect();
        let stride = kept.len().div_ceil(LOOKED_AT).max(1);
        let some = |values: &[f64]| -> Vec<f64> {
            kept.iter().step_by(stride).map(|&i| values[i]).collect()
        };
        let (y, x) = (some(sine), some(cosine));
        let readings = Readings {
            sine: &y,
            cosine: &x,
            weights: &vec![1.0; y.len()],
            variances: [1.0, 1.0],
        };
        let Some(found) = fit(readings, &[], None)? else {
            break;
        };
        let off = |i: usize| distance(&found.curve, sine[i], cosine[i]);
        let mut sizes: Vec<f64> = kept.iter().map(|&i| off(i)).collect();
        sizes.sort_by(f64::total_cmp);
        let most = OFF.max(DEVIATIONS * sizes[sizes.len() / 2]);
        let before: usize = flags.iter().filter(|&&flag| flag == DROPOUT).count();
        for (i, flag) in flags.iter_mut().enumerate() {
            if *flag & (SINE_RAIL | COSINE_RAIL) == 0 {
                *flag = DROPOUT * u8::from(off(i) > most);
            }
        }
        curve = Some(found.curve);
        if before == flags.iter().filter(|&&flag| flag == DROPOUT).count() {
            break;
        }
    }
    Ok(curve)
}

/// How far a reading is off the ellipse, in radii.
fn distance(curve: &Curve, sine: f64, cosine: f64) -> f64 {
    let p = &curve.parameters;
    let x = (cosine - p[0]) / p[2];
    let y = (sine - p[1] - p[4] * x) / p[3];
    (x.hypot(y) - 1.0).abs()
}

/// The number of codes after which a counter wraps; None where it does not.
///
/// Whole numbers of which some steps, less than half of them, are nearly that number: without it no
/// more than twice the greatest ordinary step. Ends of runs may be between the two.
pub fn wraps_at(values: &[f64]) -> Option<f64> {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for &value in values {
        if value.fract() != 0.0 {
            return None;
        }
        (low, high) = (low.min(value), high.max(value));
    }
    let bits = (high - low + 1.0).log2().ceil();
    let codes = 2.0_f64.powf(bits.max(f64::from(NARROWEST)));
    let steps: Vec<f64> = values.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
    let (small, large): (Vec<f64>, Vec<f64>) = steps.iter().partition(|s| **s < 0.25 * codes);
    let most = (2.0 * small.iter().copied().fold(0.0, f64::max)).min(0.25 * codes);
    let jumps = large
        .iter()
        .filter(|jump| (codes - *jump).abs() <= most)
        .count();
    let is_wrapped = jumps > 4 * (large.len() - jumps) && 2 * jumps < steps.len();
    is_wrapped.then_some(codes)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Codes of two turns, `n` readings, of an amplitude about a middle.
    fn codes(n: usize, amplitude: f64, middle: f64) -> [Vec<f64>; 2] {
        let phases = (0..n).map(|i| 4.0 * std::f64::consts::PI * (i as f64 + 0.3) / n as f64);
        let of = |f: fn(f64) -> f64| -> Vec<f64> {
            phases
                .clone()
                .map(|phase| (middle + amplitude * f(phase)).round())
                .collect()
        };
        [of(f64::sin), of(f64::cos)]
    }

    #[test]
    fn readings_on_the_curve_have_no_flag_and_those_off_it_have_theirs() {
        for middle in [0.0, 2048.0] {
            let [mut sine, mut cosine] = codes(1000, 900.0, middle);
            assert!(faults(&sine, &cosine).unwrap().0.iter().all(|f| *f == 0));
            for i in 300..350 {
                (sine[i], cosine[i]) = (0.0, 0.0);
                (sine[i + 400], cosine[i + 400]) = (4095.0, 4095.0);
            }
            let found = faults(&sine, &cosine).unwrap().0;
            for (i, flag) in found.iter().enumerate() {
                let is_off = (300..350).contains(&i) || (700..750).contains(&i);
                assert_eq!(*flag, DROPOUT * u8::from(is_off), "{i} {middle}");
            }
        }
    }

    #[test]
    fn a_rail_is_no_dropout() {
        let [mut sine, cosine] = codes(1000, 900.0, 2048.0);
        for value in &mut sine {
            *value = value.min(2700.0);
        }
        let found = faults(&sine, &cosine).unwrap().0;
        for (flag, value) in found.iter().zip(&sine) {
            assert_eq!(*flag, SINE_RAIL * u8::from(*value == 2700.0));
        }
    }

    #[test]
    fn counters_that_wrap_are_those_that_jump_by_their_codes() {
        let [sine, _] = codes(500, 25_000.0, 0.0);
        assert_eq!(wraps_at(&sine), None);
        let unsigned: Vec<f64> = sine.iter().map(|v| v.rem_euclid(65_536.0)).collect();
        assert_eq!(wraps_at(&unsigned), Some(65_536.0));
        let [sine, _] = codes(500, 33_500.0, 0.0);
        let over: Vec<f64> = sine
            .iter()
            .map(|v| (v + 32_768.0).rem_euclid(65_536.0) - 32_768.0)
            .collect();
        assert_eq!(wraps_at(&over), Some(65_536.0));
        let [mut sine, _] = codes(500, 2040.0, 2048.0);
        sine[100..110].fill(0.0);
        assert_eq!(wraps_at(&sine), None);
        for few in [2, 3, 4, 5, 7] {
            assert_eq!(wraps_at(&codes(2 * few, 2047.0, 2048.0)[0]), None, "{few}");
        }
        assert_eq!(wraps_at(&[0.5, 1.5]), None);
        assert_eq!(wraps_at(&[]), None);
    }
}
