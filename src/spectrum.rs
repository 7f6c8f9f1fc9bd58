//! Spectra divided by their own level: what is left is 1 on average wherever there is no line.

use std::f64::consts::LN_2;

/// Share of the highest level below which a level is rounding.
const LEAST: f64 = 1e-12;

/// Products in a row, each of which may round: less than 1e-14 in all.
const RENEWED: usize = 32;

/// Divides a spectrum by its level about every frequency, which lines do not raise.
///
/// The level is the median of each block between `cuts` over ln 2 (the median of an exponential
/// distribution), its logarithm shared with the neighbours as 1 : 2 : 1 and drawn straight from
/// the middle of a block to the next.
pub fn divide_by_level(power: &mut [f64], cuts: &[usize]) {
    let mut sorted = Vec::new();
    let mut level: Vec<f64> = cuts
        .windows(2)
        .map(|cut| {
            sorted.clear();
            sorted.extend_from_slice(&power[cut[0]..cut[1]]);
            median(&mut sorted) / LN_2
        })
        .collect();
    let top = level.iter().copied().fold(1e-300, f64::max);
    for x in &mut level {
        *x = x.max(LEAST * top).ln();
    }
    if level.len() >= 3 {
        level = (0..level.len())
            .map(|k| {
                let after = level[(k + 1).min(level.len() - 1)];
                0.25 * level[k.saturating_sub(1)] + 0.5 * level[k] + 0.25 * after
            })
            .collect();
    }
    let middle: Vec<f64> = cuts
        .windows(2)
        .map(|cut| 0.5 * (cut[0] as f64 + cut[1] as f64 - 1.0))
        .collect();
    let mut from = 0;
    for block in 0..level.len() {
        let (to, slope) = match middle.get(block + 1) {
            Some(next) => {
                let slope = (level[block + 1] - level[block]) / (next - middle[block]);
                (next.ceil() as usize, slope)
            }
            None => (power.len(), 0.0),
        };
        // Before the first middle the level is flat.
        let flat = (middle[block].ceil() as usize).clamp(from, to);
        for x in &mut power[from..flat] {
            *x *= (-level[block]).exp();
        }
        divide_by_slope(
            &mut power[flat..to],
            level[block] + slope * (flat as f64 - middle[block]),
            slope,
        );
        from = to;
    }
}

/// Divides by an exponential: every `RENEWED` numbers it is told anew.
fn divide_by_slope(power: &mut [f64], start: f64, slope: f64) {
    let step = (-slope).exp();
    for (k, part) in power.chunks_mut(RENEWED).enumerate() {
        let mut factor = (-(start + slope * (k * RENEWED) as f64)).exp();
        for x in part {
            *x *= factor;
            factor *= step;
        }
    }
}

/// Adds to every total the running mean of `values` over so many of them, times a weight.
///
/// Totals may be shorter than the values, all alike: their means look beyond them.
pub fn add_running_means(values: &[f64], boxes: &[(usize, f64)], totals: &mut [f64]) {
    let n = values.len();
    let width = totals.len() / boxes.len().max(1);
    let mut sum = Vec::with_capacity(n + 1);
    let mut before = 0.0;
    sum.push(before);
    for x in values {
        before += x;
        sum.push(before);
    }
    for (&(wide, weight), total) in boxes.iter().zip(totals.chunks_exact_mut(width.max(1))) {
        if wide <= 1 {
            for (out, x) in total.iter_mut().zip(values) {
                *out += weight * x;
            }
            continue;
        }
        for (k, out) in total.iter_mut().enumerate() {
            let low = k.saturating_sub(wide / 2);
            let high = (k + wide - wide / 2).min(n);
            *out += weight * (sum[high] - sum[low]) / (high - low) as f64;
        }
    }
}

/// The mean of the two middle values, or the one there is; NaN stands last, and there is one
/// without any.
pub fn median(values: &mut [f64]) -> f64 {
    let n = values.len();
    if n == 0 {
        return f64::NAN;
    }
    let (below, upper, _) = values.select_nth_unstable_by(n / 2, f64::total_cmp);
    if n % 2 == 1 {
        return *upper;
    }
    0.5 * (*upper + below.iter().copied().fold(f64::NEG_INFINITY, f64::max))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_level_of_one_number_leaves_ones() {
        let mut power = vec![3.0 * LN_2; 40];
        divide_by_level(&mut power, &[1, 5, 20, 40]);
        for x in power {
            assert!((x - LN_2).abs() < 1e-14);
        }
    }

    #[test]
    fn a_line_stands_above_a_level_that_falls_exponentially() {
        let fall = |k: usize| (-0.01 * k as f64).exp();
        let mut power: Vec<f64> = (0..400).map(fall).collect();
        power[200] = 50.0 * fall(200);
        let cuts: Vec<usize> = (0..=20).map(|k| 20 * k).collect();
        divide_by_level(&mut power, &cuts);
        // The outermost block shares its level with itself: up to the middle of the next one
        // the level is not straight.
        for (k, x) in power.iter().enumerate().take(370).skip(30) {
            let expected = if k == 200 { 50.0 * LN_2 } else { LN_2 };
            assert!((x / expected - 1.0).abs() < 0.01, "{k}: {x}");
        }
    }

    #[test]
    fn medians_are_those_of_sorted_values() {
        assert_eq!(median(&mut [4.0, 1.0, 3.0]), 3.0);
        assert_eq!(median(&mut [4.0, 1.0, 3.0, 9.0]), 3.5);
    }

    #[test]
    fn running_means_are_narrower_at_the_ends() {
        let values = [1.0, 2.0, 4.0, 8.0];
        let mut totals = [0.0; 8];
        add_running_means(&values, &[(1, 2.0), (3, 1.0)], &mut totals);
        assert_eq!(totals[..4], [2.0, 4.0, 8.0, 16.0]);
        assert_eq!(totals[4..], [1.5, 7.0 / 3.0, 14.0 / 3.0, 6.0]);
        let mut shorter = [0.0; 6];
        add_running_means(&values, &[(1, 2.0), (3, 1.0)], &mut shorter);
        assert_eq!(shorter, [2.0, 4.0, 8.0, 1.5, 7.0 / 3.0, 14.0 / 3.0]);
    }
}
