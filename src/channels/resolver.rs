//! Two channels of a resolver: each regressed on its excitation, period by period.

use crate::error::Error;

use std::f64::consts::TAU;

/// Readings in a period of the excitation that a regression needs.
const LEAST: f64 = 4.0;

/// Depth below the mean, in standard deviations, from which a rise through the mean begins a period.
const DEPTH: f64 = 0.5;

/// Both channels over the excitation, one value for each of its periods.
#[derive(Clone, Debug, PartialEq)]
pub struct Demodulated {
    /// First reading of every period, and their number.
    pub starts: Vec<usize>,
    /// The sine channel.
    pub sine: Vec<f64>,
    /// The cosine channel.
    pub cosine: Vec<f64>,
    /// Phase of both channels against the excitation, radians.
    pub phase: f64,
}

/// Amplitudes of the excitation in both channels, with the phase that is common to all periods, or one
/// that is known; None without periods of four readings and more.
///
/// `channel = amplitude cos(w t + p) + constant` in every period, and the ratio of the channel's
/// complex amplitude to that of the excitation is turned by the phase: half the argument of the sum
/// of the squares, within a quarter of a turn about zero.
pub fn demodulate(
    excitation: &[f64],
    sine: &[f64],
    cosine: &[f64],
    phase: Option<f64>,
) -> Result<Option<Demodulated>, Error> {
    let n = excitation.len();
    crate::check::same_length("sine", sine.len(), "excitation", n)?;
    crate::check::same_length("cosine", cosine.len(), "excitation", n)?;
    let Some(period) = period_of(excitation) else {
        return Ok(None);
    };
    let count = (n as f64 / period) as usize;
    let mut starts: Vec<usize> = (0..count)
        .map(|i| (i as f64 * period).round() as usize)
        .collect();
    starts.push(n);
    let mut ratios: Vec<[[f64; 2]; 2]> = Vec::with_capacity(count);
    for bounds in starts.windows(2) {
        let rows = bounds[0]..bounds[1];
        let carrier = amplitude(&excitation[rows.clone()], period);
        let size = carrier[0] * carrier[0] + carrier[1] * carrier[1];
        ratios.push([sine, cosine].map(|channel| {
            let [a, b] = amplitude(&channel[rows.clone()], period);
            [
                (a * carrier[0] + b * carrier[1]) / size,
                (b * carrier[0] - a * carrier[1]) / size,
            ]
        }));
    }
    let phase = phase.unwrap_or_else(|| {
        let (mut re, mut im) = (0.0, 0.0);
        for [a, b] in ratios.iter().flatten() {
            re += a * a - b * b;
            im += 2.0 * a * b;
        }
        0.5 * im.atan2(re)
    });
    let (s, c) = phase.sin_cos();
    let along = |i: usize| -> Vec<f64> {
        let turned = ratios.iter().map(|ratio| ratio[i]);
        turned.map(|[a, b]| a * c + b * s).collect()
    };
    Ok(Some(Demodulated {
        sine: along(0),
        cosine: along(1),
        starts,
        phase,
    }))
}

/// Readings in a period, by the rises through the mean.
fn period_of(excitation: &[f64]) -> Option<f64> {
    let n = excitation.len() as f64;
    let mean = excitation.iter().sum::<f64>() / n;
    let spread = (excitation.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
    let mut rises = Vec::new();
    let mut is_below = false;
    for (i, pair) in excitation.windows(2).enumerate() {
        let (from, to) = (pair[0] - mean, pair[1] - mean);
        is_below |= from < -DEPTH * spread;
        if is_below && from < 0.0 && to >= 0.0 {
            rises.push(i as f64 - from / (to - from));
            is_below = false;
        }
    }
    let periods = rises.len().checked_sub(1).filter(|periods| *periods > 0)?;
    let period = (rises[periods] - rises[0]) / periods as f64;
    (period >= LEAST).then_some(period)
}

/// Complex amplitude about the middle of some readings: real part, imaginary part.
///
/// There the sine is odd, and at right angles to the cosine and the constant.
fn amplitude(values: &[f64], period: f64) -> [f64; 2] {
    let n = values.len() as f64;
    let middle = 0.5 * (n - 1.0);
    let (mut c1, mut c2, mut s2) = (0.0, 0.0, 0.0);
    let (mut sum, mut along, mut across) = (0.0, 0.0, 0.0);
    for (i, value) in values.iter().enumerate() {
        let (s, c) = (TAU / period * (i as f64 - middle)).sin_cos();
        (c1, c2, s2) = (c1 + c, c2 + c * c, s2 + s * s);
        (sum, along, across) = (sum + value, along + value * c, across + value * s);
    }
    [(along - c1 * sum / n) / (c2 - c1 * c1 / n), -across / s2]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn amplitudes_and_the_phase_come_back_from_any_number_of_readings_in_a_period() {
        for period in [4.0, 7.3, 16.0, 31.9] {
            for lag in [-1.2, 0.0, 0.4] {
                let n = 2000;
                let carrier = |i: usize, lag: f64| (TAU * i as f64 / period + 0.9 + lag).sin();
                let of = |size: f64, off: f64, lag: f64| -> Vec<f64> {
                    (0..n).map(|i| off + size * carrier(i, lag)).collect()
                };
                let (e, y, x) = (of(2.0, 0.3, 0.0), of(-0.6, 0.1, lag), of(0.8, -0.2, lag));
                let found = demodulate(&e, &y, &x, None).unwrap().unwrap();
                assert!((found.phase - lag).abs() < 1e-4, "{} {lag}", found.phase);
                for (sine, cosine) in found.sine.iter().zip(&found.cosine) {
                    assert!((sine + 0.3).abs() < 1e-3, "{sine} {period} {lag}");
                    assert!((cosine - 0.4).abs() < 1e-3, "{cosine}");
                }
                assert_eq!(found.starts.len(), found.sine.len() + 1);
            }
        }
    }

    #[test]
    fn what_is_no_excitation_is_none() {
        let flat = vec![1.0; 50];
        assert_eq!(demodulate(&flat, &flat, &flat, None).unwrap(), None);
        let fast: Vec<f64> = (0..50).map(|i| f64::from(i % 3)).collect();
        assert_eq!(demodulate(&fast, &fast, &fast, None).unwrap(), None);
        assert_eq!(demodulate(&[], &[], &[], None).unwrap(), None);
    }
}
