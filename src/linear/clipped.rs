//! Readings taken at most so many robust standard deviations from their median.

use crate::spectrum::median;

/// A normal distribution's standard deviation over its median absolute deviation.
pub(crate) const MAD_TO_SIGMA: f64 = 1.4826;

/// Smallest standard deviation that counts as one.
const LEAST: f64 = 1e-12;

/// Residuals, outliers clipped.
#[derive(Clone, Debug)]
pub struct Clipped {
    /// The residuals, none of them beyond the limit.
    pub kept: Vec<f64>,
    /// The readings to match.
    pub target: Vec<f64>,
    /// Those that are beyond it.
    pub outlying: Vec<bool>,
}

/// Readings `y` that a fit leaves `left` of, of these roots of their weights, clipped at `most`
/// standard deviations, that of a reading being `least` at least. Where more than half would be beyond, these are counted from zero: no
/// outlier is in the majority.
pub fn clipped(y: &[f64], left: &[f64], roots: &[f64], most: f64, least: f64) -> Clipped {
    let scaled: Vec<f64> = left.iter().zip(roots).map(|(e, root)| e * root).collect();
    let middle = median(&mut scaled.clone());
    let about = |centre: f64| {
        let mut away: Vec<f64> = scaled.iter().map(|e| (e - centre).abs()).collect();
        (MAD_TO_SIGMA * median(&mut away)).max(least)
    };
    let mut limit = most * about(middle).max(LEAST);
    let beyond = |limit: f64| move |(e, root): (&f64, &f64)| e.abs() > limit / root;
    let count = left
        .iter()
        .zip(roots)
        .filter(|&pair| beyond(limit)(pair))
        .count();
    if 2 * count > left.len() {
        limit = most * about(0.0);
    }
    let outlying: Vec<bool> = left.iter().zip(roots).map(beyond(limit)).collect();
    let most_of = |root: &f64| limit / root;
    let kept: Vec<f64> = left
        .iter()
        .zip(roots)
        .map(|(&e, root)| {
            if e.abs() > most_of(root) {
                most_of(root).copysign(e)
            } else {
                e
            }
        })
        .collect();
    let target = (0..y.len())
        .map(|i| {
            if outlying[i] {
                y[i] - left[i] + kept[i]
            } else {
                y[i]
            }
        })
        .collect();
    Clipped {
        kept,
        target,
        outlying,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_lies_beyond_is_put_at_the_limit_and_the_readings_follow() {
        let left = [0.1, -0.1, 0.3, -0.2, 0.0, 9.0, -8.0];
        let y: Vec<f64> = left.iter().map(|e| 100.0 + e).collect();
        let found = clipped(&y, &left, &[1.0; 7], 4.0, 0.0);
        // Deviations from the median 0: 0, 0.1, 0.1, 0.2, 0.3, 8, 9.
        let limit = 4.0 * MAD_TO_SIGMA * 0.2;
        assert_eq!(
            found.outlying,
            [false, false, false, false, false, true, true]
        );
        assert!((found.kept[5] - limit).abs() < 1e-12 && (found.kept[6] + limit).abs() < 1e-12);
        assert_eq!(found.kept[..5], left[..5]);
        assert!((found.target[6] - (100.0 - limit)).abs() < 1e-12 && found.target[1] == 99.9);
    }

    #[test]
    fn readings_of_few_levels_are_no_outliers_one_level_apart() {
        let left = [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, -9.0];
        let found = clipped(&left, &left, &[1.0; 7], 4.0, 0.3);
        assert_eq!(found.outlying.iter().filter(|&&beyond| beyond).count(), 1);
        assert!((found.kept[6] + 1.2).abs() < 1e-12);
        assert!(clipped(&left, &left, &[1.0; 7], 4.0, 0.0).outlying[5]);
    }

    /// Readings that agree to the last bit: what is left of one counts from 4e-12 on.
    #[test]
    fn a_deviation_below_the_least_is_the_least() {
        let left = [0.0, 0.0, 0.0, 0.0, 0.0, 3.9e-12, 4.1e-12];
        let found = clipped(&left, &left, &[1.0; 7], 4.0, 0.0);
        assert_eq!(found.outlying.iter().position(|&beyond| beyond), Some(6));
        assert_eq!(found.kept[5], left[5]);
        assert!((found.kept[6] - 4.0 * LEAST).abs() < 1e-24);
    }

    #[test]
    fn a_majority_away_from_zero_is_no_outlier() {
        let left = [5.0, 5.0, 5.0, 5.0, 0.0, 0.1, -0.1];
        let found = clipped(&left, &left, &[1.0; 7], 4.0, 0.0);
        assert!(found.outlying.iter().all(|&beyond| !beyond));
    }

    #[test]
    fn a_reading_of_less_weight_may_scatter_more() {
        let left = [0.1, -0.1, 0.2, -0.2, 0.0, 2.0, 2.0];
        let mut roots = [1.0; 7];
        roots[6] = 0.1;
        let found = clipped(&left, &left, &roots, 4.0, 0.0);
        assert!(found.outlying[5] && !found.outlying[6]);
    }
}
