//! A narrow and a wide normal distribution about zero: how many values are of the wide one, and
//! how wide it is.

use crate::interrupt;

/// Share of the wide part to begin with, and the largest.
const BEGIN: f64 = 0.01;
const MOST: f64 = 0.2;

/// Least size of the wide part, in scales of the narrow one.
const LEAST_SIZE: f64 = 2.0;

/// What stands for a sum that is zero.
const TINY: f64 = 1e-300;

/// Logarithm of a density from which on it is told beside another one: below, the sum of both may
/// be less than `TINY`, and what no normal distribution reaches counts as of the narrow one.
const REACHED: f64 = -600.0;

/// Two normal distributions about zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwoNormals {
    /// Logarithm of the likelihood of the values, without `n ln(2 pi)/2`.
    pub value: f64,
    /// Share of the wide part.
    pub share: f64,
    /// Deviation of the wide part over that of the narrow one.
    pub size: f64,
    /// Deviation of the narrow part.
    pub scale: f64,
}

/// Those that so many steps of expectation-maximisation lead to from a size on (Dempster, Laird
/// and Rubin 1977); the scale is no less than `narrowest`.
pub fn two_normals(values: &[f64], start: f64, steps: usize, narrowest: f64) -> TwoNormals {
    let n = values.len() as f64;
    let squares: Vec<f64> = values.iter().map(|value| value * value).collect();
    let (mut share, mut size, mut scale) = (BEGIN, start, 1.0_f64);
    for _ in 0..steps {
        interrupt::point();
        // Odds of the narrow part: at zero, and by how much they fall.
        let odds = (1.0 - share) * size / share;
        let fall = -0.5 * (1.0 - 1.0 / (size * size)) / (scale * scale);
        let slope = -0.5 / (scale * scale * size * size);
        let (mut count, mut sum) = (0.0, 0.0);
        let (mut kept, mut rest) = (0.0, 0.0);
        for square in &squares {
            let chance = if slope * square > REACHED {
                1.0 / (1.0 + odds * (fall * square).exp())
            } else {
                let wide = share / size * (slope * square).exp();
                wide / wide.max(TINY)
            };
            count += chance;
            sum += chance * square;
            kept += 1.0 - chance;
            rest += (1.0 - chance) * square;
        }
        share = (count / n).clamp(1.0 / n, MOST);
        scale = (rest / f64::max(kept, TINY)).sqrt().max(narrowest);
        size = ((sum / count.max(TINY)).sqrt() / scale).max(LEAST_SIZE);
    }
    let narrow = ((-share).ln_1p(), -0.5 / (scale * scale));
    let wide = ((share / size).ln(), narrow.1 / (size * size));
    let logarithms = squares.iter().map(|square| {
        let (a, b) = (narrow.0 + narrow.1 * square, wide.0 + wide.1 * square);
        a.max(b) + (-(a - b).abs()).exp().ln_1p()
    });
    TwoNormals {
        value: logarithms.sum::<f64>() - n * scale.ln(),
        share,
        size,
        scale,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Quantiles of a normal distribution, nearly, and every hundredth of them 30 times as large.
    fn values() -> Vec<f64> {
        let quantile = |i: i32| {
            let p = (f64::from(i) + 0.5) / 2000.0;
            // Tukey's lambda.
            (p.powf(0.1349) - (1.0 - p).powf(0.1349)) / 0.1975
        };
        let scattered = |i: i32| quantile(i * 777 % 2000) * if i % 100 == 7 { 30.0 } else { 1.0 };
        (0..2000).map(scattered).collect()
    }

    /// The same steps with both densities as they are defined.
    fn slow(values: &[f64], start: f64, steps: usize) -> TwoNormals {
        let n = values.len() as f64;
        let (mut share, mut size, mut scale) = (0.01, start, 1.0);
        let density = |x: f64, s: f64| (-0.5 * (x / s).powi(2)).exp() / s;
        for _ in 0..steps {
            let chances: Vec<f64> = values
                .iter()
                .map(|&x| {
                    let wide = share * density(x, scale * size);
                    wide / (wide + (1.0 - share) * density(x, scale)).max(1e-300)
                })
                .collect();
            let count: f64 = chances.iter().sum();
            let pairs = || chances.iter().zip(values);
            let narrow: f64 = pairs().map(|(c, x)| (1.0 - c) * x * x).sum();
            let wide: f64 = pairs().map(|(c, x)| c * x * x).sum();
            share = (count / n).clamp(1.0 / n, 0.2);
            scale = (narrow / (n - count)).sqrt();
            size = ((wide / count).sqrt() / scale).max(2.0);
        }
        let likelihood =
            |&x: &f64| ((1.0 - share) * density(x, scale) + share * density(x, scale * size)).ln();
        TwoNormals {
            value: values.iter().map(likelihood).sum(),
            share,
            size,
            scale,
        }
    }

    #[test]
    fn steps_are_those_of_the_densities() {
        let values = values();
        for start in [3.0, 10.0] {
            let (found, expected) = (
                two_normals(&values, start, 60, 1e-6),
                slow(&values, start, 60),
            );
            for (a, b) in [
                (found.value, expected.value),
                (found.share, expected.share),
                (found.size, expected.size),
                (found.scale, expected.scale),
            ] {
                assert!((a - b).abs() < 1e-10 * b.abs(), "{found:?} {expected:?}");
            }
        }
    }

    #[test]
    fn a_hundredth_of_the_values_is_wild() {
        let found = two_normals(&values(), 10.0, 60, 1e-6);
        assert!((found.share - 0.01).abs() < 0.002, "{found:?}");
        assert!(
            (found.scale - 1.0).abs() < 0.1 && found.size > 15.0,
            "{found:?}"
        );
    }

    #[test]
    fn values_of_nothing_are_as_narrow_as_can_be() {
        let found = two_normals(&[0.0; 50], 3.0, 60, 1e-6);
        assert_eq!((found.scale, found.share), (1e-6, 0.02));
    }
}
